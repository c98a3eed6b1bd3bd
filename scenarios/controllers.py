"""Controllers by their command-line names."""

from __future__ import annotations

from collections.abc import Callable

from baselines import FixedTime
from dim import Dim
from minisim.control import Controller, Unregulated
from minisim.errors import choice
from scenarios.scenario import Profile, profile_named

#: Name -> what makes the controller for a profile. A new controller needs one line here.
CONTROLLERS: dict[str, Callable[[Profile], Controller]] = {
    "dim": lambda _: Dim(),
    "dim-harmonious": lambda _: Dim(gate="harmonious"),
    "dim-lanes": lambda _: Dim(order="lanes"),
    "dim-inflow": lambda _: Dim(priorities="inflow"),
    "dim-paper-commit": lambda _: Dim(commit="paper"),
    "fixed-time": lambda _: FixedTime(),
    "fixed-time-equal": lambda _: FixedTime(equal_greens=True, name="fixed-time-equal"),
    "unregulated": lambda _: Unregulated(),
}


def controller_named(name: str, profile: str | Profile = "paper") -> Controller:
    """The controller of a command-line name, set up for a profile.

    Raises:
        InputError: unknown name (with the nearest one) or profile.
    """
    return CONTROLLERS[choice("controller", name, CONTROLLERS)](profile_named(profile))
