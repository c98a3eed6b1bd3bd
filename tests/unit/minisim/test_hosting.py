"""What hosts share: the alarm clock of a session, and the window of a recording."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import pytest

import minisim
from minisim.control import Marking, Open, Plan, Session, Site, Wake
from minisim.errors import ControllerError, InputError, MinisimError
from minisim.hosting import Alarm, checked_window, start
from minisim.testing import small_scenario
from minisim.ticks import NEVER
from scenarios.controllers import VARIANTS, controller_named, safe
from scenarios.library import four_way
from scenarios.profiles import FAIR
from scenarios.termination import Terminated
from tests.builders import Fixed, Scripted


def test_a_period_rings_at_once_and_then_regularly() -> None:
    alarm = Alarm(0.5, 0.1)
    rung = []
    for tick in range(12):
        if tick >= alarm.tick:
            rung.append(tick)
            alarm.reset(tick)
    assert rung == [0, 5, 10]


def test_without_a_period_it_rings_once_when_asked() -> None:
    alarm = Alarm(None, 0.1)
    assert alarm.tick == NEVER
    alarm.set(Wake(0.95))
    alarm.set(Wake(0.65))  # replaces the earlier one
    assert alarm.tick == 7
    alarm.reset(6)
    assert alarm.tick == 7
    alarm.reset(7)
    assert alarm.tick == NEVER


def test_the_earlier_of_both_rings() -> None:
    alarm = Alarm(1.0, 0.1)
    alarm.reset(0)
    alarm.set(Wake(0.3))
    assert alarm.tick == 3
    alarm.reset(3)
    assert alarm.tick == 10


def test_vehicles_wake_it_unless_it_wants_to_be_undisturbed() -> None:
    alarm = Alarm(None, 0.1)
    assert alarm.heeds == 0
    alarm.set(Wake(1.0, undisturbed=0.75))
    assert (alarm.tick, alarm.heeds) == (10, 8)
    alarm.set(Wake(2.0))  # replaces all of the earlier one
    assert (alarm.tick, alarm.heeds) == (20, 0)


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ([0.0, 1.0], r"must be \(from, to\) in seconds"),
        ((0.0,), r"must be \(from, to\) in seconds"),
        ((-1.0, 1.0), "start of record_window .* at least 0"),
        ((2.0, 1.0), "end of record_window .* at least 2, got 1"),
        ((math.inf, math.inf), "start of record_window .* finite"),
    ],
)
def test_windows_are_checked(window: object, message: str) -> None:
    assert checked_window((1, 2.5)) == (1, 2.5)
    assert checked_window((0.0, math.inf)) == (0.0, math.inf)
    with pytest.raises(InputError, match=message):
        checked_window(window)


@pytest.mark.parametrize("answer", [None, Open(1), 7])
def test_decide_must_return_commands(answer: object) -> None:
    silent = Scripted(lambda view: answer)  # type: ignore[arg-type, return-value]
    said = r"'scripted.*' at 0.0 s: decide\(\) must return commands"
    with pytest.raises(ControllerError, match=said):
        minisim.simulate(small_scenario(), silent)


class Broken:
    """A controller, and its session, that raises an error in one of its methods."""

    name = "broken"
    plan = Plan(period=1.0)

    def __init__(self, where: str, raised: BaseException) -> None:
        self.where, self.raised = where, raised

    def start(self, site: object) -> Broken:
        self.fail("start")
        return self

    def decide(self, view: object) -> list[Wake]:
        self.fail("decide")
        return []

    def kind(self, lane: int, rank: int) -> str:
        self.fail("kind")
        return "x"

    def fail(self, where: str) -> None:
        if where == self.where:
            raise self.raised


@pytest.mark.parametrize("where", ["start", "decide", "kind"])
@pytest.mark.parametrize("raised", [KeyError("lost"), SystemExit("lost")])
def test_an_error_of_a_controller_is_told_with_its_line(where: str, raised: BaseException) -> None:
    """`sys.exit` is an error like any other."""
    line = Broken.fail.__code__.co_firstlineno + 2
    kind = type(raised).__name__
    told = rf"^controller 'broken'.*: test_hosting.py, line {line}: {kind}: '?lost'?$"
    with pytest.raises(ControllerError, match=told) as caught:
        minisim.simulate(small_scenario(demand_time=20.0), Broken(where, raised))
    assert caught.value.__cause__ is raised, "the traceback is there"


@pytest.mark.parametrize("raised", [KeyboardInterrupt, Terminated])
def test_what_ends_the_process_is_no_error_of_a_controller(raised: type[BaseException]) -> None:
    with pytest.raises(raised):
        minisim.simulate(small_scenario(), Broken("decide", raised()))


def test_a_controller_without_a_name_to_read_is_refused() -> None:
    class Nameless:
        @property
        def name(self) -> str:
            sys.exit("no name")

        def start(self, site: Site) -> Session:
            raise NotImplementedError

        def __repr__(self) -> str:
            raise ZeroDivisionError

    told = "a Nameless whose repr raises ZeroDivisionError has no name: test_hosting.py, line "
    with pytest.raises(InputError, match=rf"^{told}\d+: SystemExit: no name$"):
        minisim.simulate(small_scenario(), Nameless())


#: Controllers that wake up at intervals: their defaults and what goes with them.
WAKING = (
    *VARIANTS, "dim:perception=noisy(delay=0.3)",
    "dim:perception=noisy(intent_error=0.15,persistent=false),monitor=on",
)  # fmt: skip


@pytest.mark.parametrize("dt", [0.13, 0.5])
@pytest.mark.parametrize("name", WAKING)
def test_no_default_is_refused_at_any_step(name: str, dt: float) -> None:
    scenario = four_way(200, horizon=2.0, profile=replace(FAIR, dt=dt))
    minisim.simulate(scenario, controller_named(name), 1)


@pytest.mark.parametrize("spec", [
    "v2ic:period=0.1", "reservation:period=0.1", "dim:period=0.1", "slots:period=0.1",
    "dim:perception=noisy(delay=0.3,frame=0.1)",
    "dim:perception=noisy(delay=0.3,frame=0.1),period=1",
])  # fmt: skip
def test_no_interval_is_shorter_than_a_step(spec: str) -> None:
    site = four_way(profile=replace(FAIR, dt=0.2)).site()
    told = r"(period|frame of the perception|period of the plan) \[s\], in steps of the host, must"
    with pytest.raises(MinisimError, match=rf"^(controller )?'?{spec[:4]}.*{told} be at least 0.2"):
        start(controller_named(spec), site)


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        (Plan(sight=1000.0), r"sight \[m\] of the plan.* at most 492.8, got 1000"),
        (Plan(marks=(10.0, 600.0)), r"marks\[1\] \[m\] of the plan.* at most 492.8, got 600"),
        (Plan(hold_distance=490.0), r"hold_distance .* at most .*, got 490"),
        (Plan(markings=(Marking("far", 500.0, 10.0),)), r"start of marking 'far' .* got 500"),
        (Plan(period=0.05), r"period of the plan \[s\].* at least 0.1, got 0.05"),
    ],
)
def test_a_plan_that_cannot_act_is_refused(plan: Plan, told: str) -> None:
    with pytest.raises(ControllerError, match=f"controller 'fixed.*': {told}"):
        minisim.simulate(four_way(horizon=1.0), Fixed(plan))


@pytest.mark.parametrize("name", [name for name in safe() if not name.startswith("dim")])
def test_no_plan_of_ours_reaches_beyond_a_short_road(name: str) -> None:
    """The default sight may, and `start` refuses any other."""
    site = four_way(100, arm_length=40.0).site(0)
    _, plan = start(controller_named(name), site)
    assert max(plan.sight, *plan.marks, 0.0) <= max(site.intersection.approach_length, Plan().sight)
