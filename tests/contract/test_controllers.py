"""Every controller keeps the contract, and its check finds each way to break it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
import pytest

import minisim
from baselines import V2IC, Actuated, Adaptive, AllWayStop, FixedTime, MaxPressure, Reservation
from dim import AsRunDim, Dim, Mixed, Monitor, NoisyPerception
from minisim.arrivals import Arrivals
from minisim.channel import Channel
from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Close,
    Command,
    Controller,
    Go,
    Hold,
    Observed,
    Open,
    Plan,
    Session,
    Site,
    Unregulated,
    View,
    Wake,
    cover_of,
)
from minisim.errors import ControllerError, InputError
from minisim.link import Linked, radio_of
from minisim.results.run import Run
from minisim.testing import ContractError, check_commands, check_controller, drained, small_scenario
from minisim.vehicle import VehicleType
from scenarios import four_way, three_way
from scenarios.controllers import controller_named, safe
from tests.builders import ScriptedSession, as_run, hardest_braking

#: Variants beside those of the table: parameters at their edges, and some together.
MORE: tuple[Controller, ...] = (
    Dim(priorities="inflow"),
    Dim(order="lanes", gate="harmonious", priorities="inflow"),
    Dim(gate="harmonious", priorities="waiting"),
    Mixed(share=0.3),
    Mixed(Dim(gate="harmonious"), 0.6, trust="signals"),
    Mixed(share=1.0),
    Dim(perception=NoisyPerception(intent_error=0.15, kind="symmetric"), monitor=Monitor()),
    FixedTime(amber=0.0),
    FixedTime(greens=2.0, amber=3.0, all_red=1.0),
    FixedTime(equal_greens=True, max_cycle=90.0),
    Adaptive(amber=0.0, min_green=0.5, max_green=8.0, extend_max_green=True),
    Actuated(amber=0.0, min_green=0.5, max_green=8.0, max_gap=1.0),
    MaxPressure(interval=2.0, amber=0.0, detector_range=30.0),
    AllWayStop(reaction=0.0),
    V2IC(reach=100.0, period=0.2),
    Reservation(reach=120.0, buffer=0.0, period=0.2),
)

#: Those whose messages may fail, with some that do.
FAILING = tuple(
    Linked(it, Channel(latency=0.2, jitter=0.2, loss=0.3))
    for it in map(controller_named, safe())
    if radio_of(it)
)

#: Everything that promises no collision; a new controller of the table is among them.
CONTROLLERS = (*map(controller_named, safe()), *MORE, *FAILING)


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: c.name)
def test_every_controller_keeps_the_contract(controller: Controller) -> None:
    check_controller(controller, horizon=120.0)


#: Corners of what a scenario may be, each with options of `small_scenario` and of its vehicles.
EDGES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "drivers who differ": ({}, {"speed_deviation": 0.5}),
    "Krauss's law": ({"dt": 0.25}, {"model": "krauss", "deceleration": 0.5, "headway": 10.0}),
    "the improved IDM": ({}, {"model": "iidm", "min_gap": 0.5}),
    "long and slow vehicles": ({}, {"length": 6.0, "acceleration": 0.8, "min_gap": 20.0}),
    "a crawl": ({"speed_limit": 0.5, "arm_length": 60.0}, {}),
    "coarse steps": ({"speed_limit": 1.0, "dt": 0.5, "arm_length": 60.0}, {}),
    "a race track": ({"speed_limit": 100.0}, {}),
}


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: c.name)
def test_what_a_controller_covers_is_safe_and_served_or_refused(controller: Controller) -> None:
    for what, (options, vehicle) in EDGES.items():
        scenario = small_scenario(
            3, demand_time=30.0, drain=20_000.0, vehicle=VehicleType(**vehicle), **options
        )
        if scenario.vehicle not in cover_of(controller):
            with pytest.raises(InputError, match="is for vehicles of the models"):
                minisim.simulate(scenario, controller, 1)
            continue
        try:
            run = minisim.simulate(scenario, controller, 1, on_collision="record")
        except (InputError, ControllerError):  # of the site, not of its vehicles
            continue
        assert len(run.columns.lane) > 3
        assert run.collisions == (), what
        assert run.columns.arrived.all(), what


@pytest.mark.parametrize("controller", [AsRunDim(), AsRunDim(order="size")], ids=lambda c: c.name)
def test_the_published_rules_keep_the_contract_but_for_collisions(controller: Controller) -> None:
    """With the vehicle and the step that they are made for; 0.1 s is too coarse for their zones."""

    def run(scenario: Any, controller: Controller, seed: int = 0, **options: Any) -> Run:
        return minisim.simulate(as_run(scenario), controller, seed, **options)

    check_controller(controller, horizon=120.0, collision_free=False, host=run)


def before(run: Run, time: float) -> pd.DataFrame:
    """The trips that were over by then."""
    return run.trips[run.trips["arrival_s"] < time]


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda c: c.name)
def test_what_happens_does_not_depend_on_the_horizon(controller: Controller) -> None:
    short, long = (
        minisim.simulate(four_way(300, profile="fair", arm_length=200.0, horizon=t), controller, 3)
        for t in (120.0, 180.0)
    )
    assert len(before(short, 120.0)) > 10
    pd.testing.assert_frame_equal(before(short, 120.0), before(long, 120.0))


@pytest.mark.parametrize("name", safe())
def test_braking_is_comfortable_in_ordinary_traffic(name: str) -> None:
    for road, seed in ((four_way, 1), (three_way, 3)):
        scenario = road(350, profile="fair", horizon=600.0)
        run = minisim.simulate(scenario, controller_named(name), seed, record="all")
        assert hardest_braking(run) <= run.site.vehicle.deceleration + 1e-6


def test_the_contract_without_safety() -> None:
    check_controller(Unregulated(), arms=(4,), density=20.0, collision_free=False)


# Controllers that break the contract, one clause each.


@dataclass(frozen=True)
class Broken:
    """A fixed-time signal at heart; each subclass breaks one thing."""

    name: str = "broken"

    def start(self, site: Site) -> Session:
        return FixedTime().start(site)


@dataclass(frozen=True)
class Leaking(Broken):
    """What a run does depends on how many were started before."""

    runs: list[Site] = field(default_factory=list, compare=False, repr=False)

    def start(self, site: Site) -> Session:
        self.runs.append(site)
        return FixedTime(greens=5.0 + len(self.runs)).start(site)


COUNTER = itertools.count()
LATEST = [0.0]


def globally_leaking(site: Site) -> Session:
    """The same through a global."""
    return FixedTime(greens=5.0 + next(COUNTER)).start(site)


def interfering(site: Site) -> Session:
    """Only two runs at once disturb each other: one signal remembers the time of another run."""
    LATEST[0] = 0.0

    def decide(view: View) -> Iterable[Command]:
        LATEST[0] = max(LATEST[0], view.time)
        green = int(LATEST[0] // 10.0) % 4
        yield from (Open(lane) if lane == green else Close(lane) for lane in range(4))
        yield Wake(view.time + 1.0)

    return ScriptedSession(Plan(wake_on_clear=True), decide)


@dataclass(frozen=True)
class SelfChanging(Broken):
    """A run changes its controller."""

    last_seed: int = 0

    def start(self, site: Site) -> Session:
        object.__setattr__(self, "last_seed", site.seed)
        return super().start(site)


@dataclass(frozen=True)
class ForgetfulCopy(Broken):
    """Its pickled copy is another signal."""

    greens: float = field(default=20.0, compare=False, repr=False)

    def __getstate__(self) -> dict[str, object]:
        return {"name": self.name, "greens": 5.0}

    def start(self, site: Site) -> Session:
        return FixedTime(greens=self.greens).start(site)


@dataclass
class Unhashable:
    """A dataclass that is not frozen."""

    name: str = "broken"
    start = Broken.start  # type: ignore[assignment]


@dataclass(frozen=True)
class Unpicklable(Broken):
    """It holds a function that has no name to find it by."""

    rule: Callable[[], int] = field(default_factory=lambda: lambda: 5)


class NoValue:
    """It compares by identity."""

    name = "no-value"
    start = Broken.start  # type: ignore[assignment]


EVERY_SECOND = Plan(period=1.0)


@dataclass(frozen=True)
class Says(Broken):
    """It gives the same answer to every view."""

    answer: Any = ()
    plan: Any = EVERY_SECOND

    def start(self, site: Site) -> Session:
        return ScriptedSession(self.plan, lambda view: self.answer)


def never_d(site: Site) -> Session:
    """A signal whose last head stays red."""
    signal = FixedTime().start(site)
    return ScriptedSession(signal.plan, lambda at: [c for c in signal.decide(at) if c != Open(3)])


@dataclass(frozen=True)
class Starting(Broken):
    """It starts what this makes of a site."""

    make: Any = None

    def start(self, site: Site) -> Any:
        return self.make(site)


BROKEN = {
    "leaks": (Leaking(), "same seed gave other trips"),
    "leaks through a global": (Starting(make=globally_leaking), "same seed gave other trips"),
    "shares its session": (Starting(make=interfering), "same seed gave other trips"),
    "changes itself": (SelfChanging(), "must not change its controller"),
    "pickles to another": (ForgetfulCopy(), "pickled copy gave other trips"),
    "unhashable": (Unhashable(), "not hashable"),
    "unpicklable": (Unpicklable(), "not picklable"),
    "no value": (NoValue(), "copy of it is not equal"),
    "collides": (Unregulated(), "vehicles collided: at .* s vehicle"),
    "never releases": (Says(), r"(\d+) of \1 vehicles were never served on 4 arms \(lanes a, b"),
    "starves a lane": (Starting(make=never_d), r"vehicles were never served on 4 arms \(lanes d\)"),
    "unknown vehicle": (Says(answer=(Go(10**6),)), "this vehicle is not in the view"),
    "unknown lane": (Says(answer=(Open(4),)), "lane must be an integer 0 … 3"),
    "past wake-up": (Says(answer=(Wake(0.0),)), "is not after 0 s"),
    "no command": (Says(answer=("go",)), "is not a command"),
    "no answer": (Says(answer=None), "must return commands, .* got None"),
    "no session": (Starting(make=str), "must return a Session with a Plan"),
    "no plan": (Says(plan="none"), "must return a Session with a Plan"),
    "no name": (Broken(name=""), "the name of .* must be a text"),
    "no controller": (5, "is not a controller"),
    "a class": (FixedTime, "is not a controller"),
}


@pytest.mark.parametrize(("controller", "message"), BROKEN.values(), ids=BROKEN.keys())
def test_a_broken_contract_is_found(controller: Any, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        check_controller(controller, arms=(4,), density=350.0, horizon=300.0)


def test_a_broken_contract_is_a_failed_assertion_and_a_minisim_error() -> None:
    with pytest.raises(AssertionError, match="controller 'broken'") as caught:
        check_controller(Says())
    assert isinstance(caught.value, minisim.MinisimError)


def test_a_site_that_the_controller_refuses_is_its_own_error() -> None:
    with pytest.raises(InputError, match="4 values for 3 lanes"):
        check_controller(FixedTime(greens=(5, 5, 5, 5)))


VIEW = View(10.0, (Observed(3, 0, 1, 5.0, 5.0, 5.0), Observed(9, 2, 1, 5.0, 5.0, 5.0)))


def test_valid_commands_pass() -> None:
    valid = (
        Go(3), Hold(9), Open(0), Close(3), Advise(9, 0.0), Advise(3, math.inf), Brake(3, 4.5),
        Brake(9, 0.0), Accelerate(3, -2.0), Accelerate(9, math.inf), Wake(10.1),
        Wake(12.0, undisturbed=12.0), Wake(12.0, undisturbed=9.0),
    )  # fmt: skip
    check_commands(valid, VIEW, small_scenario(4).site(0))


@pytest.mark.parametrize(
    "command",
    [
        Go(4), Hold(-1), Advise(10, 5.0), Advise(3, -1.0), Advise(3, math.nan), Open(4), Close(-1),
        Brake(4, 1.0), Brake(3, -1.0), Brake(3, math.nan), Brake(3, math.inf),
        Accelerate(4, 1.0), Accelerate(3, math.nan), Accelerate(3, -math.inf),
        Wake(10.0), Wake(math.nan), Wake(math.inf), (3,), None,
        Wake(12.0, undisturbed=12.1), Wake(12.0, undisturbed=math.nan),
    ],
)  # fmt: skip
def test_invalid_commands_do_not(command: Any) -> None:
    with pytest.raises(ContractError, match=r"at 10\.0 s: "):
        check_commands([command], VIEW, small_scenario(4).site(0))


def test_a_drained_scenario_demands_only_at_first() -> None:
    scenario = drained(4, density=350, demand_time=60.0)
    arrivals: Arrivals = scenario.arrivals(1)
    assert len(arrivals) > 5
    assert arrivals.time.max() < 60.0
    assert scenario.horizon > 600.0
    assert scenario.site(1).demand == pytest.approx((350.0,) * 4)
    assert hash(scenario) == hash(drained(4, density=350, demand_time=60.0))


def test_a_test_scenario_has_three_arms_or_more() -> None:
    with pytest.raises(InputError, match="arms must be an integer 3 … 12, got 2"):
        small_scenario(2)
