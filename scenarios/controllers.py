"""Controllers by their command-line names."""

from __future__ import annotations

from collections.abc import Callable

from baselines import (
    V2IC,
    Actuated,
    Adaptive,
    AllWayStop,
    FixedTime,
    LongestQueue,
    Reservation,
    V2ICAsRun,
)
from dim import AsRunDim, Dim, Monitor, NoisyPerception
from dim.senses.noise import CLASSIFIER, UNSIGNALLED
from minisim.control import Controller, Unregulated
from minisim.errors import choice
from scenarios.scenario import AS_RUN, Profile, profile_named


def _dim(profile: Profile) -> Controller:
    """DIM as the profile has it: the authors' own rules go with the vehicle of their runs."""
    return AsRunDim() if profile.name == AS_RUN.name else Dim()


def _v2ic(profile: Profile) -> Controller:
    """V2I-C as the profile has it: the published one goes with the vehicle of the paper's runs."""
    return V2ICAsRun() if profile.name == AS_RUN.name else V2IC()


#: Name -> what makes the controller for a profile. A new controller needs one line here.
CONTROLLERS: dict[str, Callable[[Profile], Controller]] = {
    "dim": _dim,
    "dim-harmonious": lambda _: Dim(gate="harmonious"),
    "dim-lanes": lambda _: Dim(order="lanes"),
    "dim-inflow": lambda _: Dim(priorities="inflow"),
    "dim-rotating": lambda _: Dim(priorities="rotating"),
    "dim-waiting": lambda _: Dim(priorities="waiting"),
    "dim-lanes-rotating": lambda _: Dim(order="lanes", priorities="rotating"),
    "dim-lanes-waiting": lambda _: Dim(order="lanes", priorities="waiting"),
    "dim-paper-commit": lambda _: Dim(commit="paper"),
    "dim-monitored": lambda _: Dim(monitor=Monitor()),
    "dim-symmetric-0.15": lambda _: Dim(perception=NoisyPerception(CLASSIFIER, "symmetric")),
    "dim-unsignalled": lambda _: Dim(perception=NoisyPerception(unsignalled=UNSIGNALLED)),
    "dim-occlusion": lambda _: Dim(perception=NoisyPerception(occlusion=True)),
    "dim-as-run": lambda _: AsRunDim(),
    "dim-as-run-size": lambda _: AsRunDim(order="size"),
    "dim-as-run-exit-14": lambda _: AsRunDim(exit_speed=14.0),
    "fixed-time": lambda _: FixedTime(),
    "fixed-time-equal": lambda _: FixedTime(equal_greens=True, name="fixed-time-equal"),
    "adaptive": lambda _: Adaptive(),
    "actuated": lambda _: Actuated(),
    "all-way-stop": lambda _: AllWayStop(),
    "longest-queue": lambda _: LongestQueue(),
    "v2ic": _v2ic,
    "v2ic-as-run": lambda _: V2ICAsRun(),
    "v2ic-as-run-14": lambda _: V2ICAsRun(approach_speed=14.0),
    "reservation": lambda _: Reservation(),
    "unregulated": lambda _: Unregulated(),
}


def controller_named(name: str, profile: str | Profile = "paper") -> Controller:
    """The controller of a command-line name, set up for a profile.

    Raises:
        InputError: unknown name (with the nearest one) or profile.
    """
    return CONTROLLERS[choice("controller", name, CONTROLLERS)](profile_named(profile))
