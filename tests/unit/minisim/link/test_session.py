"""Right of way by messages that come late or never."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import pytest

import minisim
from baselines import V2IC, AllWayStop, V2ICAsRun
from dim import Dim
from minisim.channel import Channel
from minisim.control import (
    Accelerate,
    Command,
    Controller,
    Go,
    Hold,
    Plan,
    Radio,
    Session,
    Site,
    View,
    Wake,
)
from minisim.errors import CollisionError, ControllerError, InputError
from minisim.link import Link, Linked
from minisim.testing import small_scenario
from scenarios import four_way
from tests.builders import PEDALS, Fixed, Scripted, digest, replayed

FAIR = four_way(250, profile="fair", horizon=300.0)
SITE = FAIR.site(1)
PLAN = Plan(marks=(50.0,), sight=100.0, wake_on_clear=True)


@dataclass(frozen=True)
class Forced:
    """A controller with a link even if no message fails."""

    controller: Controller
    name: str = "forced"
    radio = Radio()

    def start(self, site: Site) -> Session:
        return Link(self.controller.start(site), self.radio, site)


def greedy(view: View) -> Iterable[Command]:
    """Let all vehicles go at once, again every second."""
    return [*(Go(it.id) for it in view.vehicles), Wake(view.time + 1.0)]


@pytest.mark.parametrize("density", [150, 350])
def test_a_link_that_delivers_at_once_changes_nothing(density: int) -> None:
    scenario = four_way(density, profile="fair", horizon=300.0)
    plain, linked = (minisim.simulate(scenario, it, 2) for it in (V2IC(), Forced(V2IC())))
    assert digest(linked) == digest(plain)
    assert linked.counts["messages_lost"] == 0


def test_without_faults_there_is_no_link() -> None:
    session = Linked(V2IC(), Channel()).start(SITE)
    assert not isinstance(session, Link)


def test_no_vehicle_goes_without_a_message() -> None:
    run = minisim.simulate(FAIR, Linked(V2IC(), Channel(loss=1.0)), 1, record="junction")
    assert not run.columns.arrived.any()
    assert run.trace["s"].max() < run.site.intersection.approach_length
    assert run.counts["orders_sent"] == 0 < run.counts["states_sent"] == run.counts["messages_lost"]


def test_the_same_seed_loses_the_same_messages() -> None:
    failing = Linked(V2IC(), Channel(latency=0.1, jitter=0.3, loss=0.3))
    runs = [minisim.simulate(FAIR, failing, seed) for seed in (1, 1, 2)]
    assert digest(runs[0]) == digest(runs[1]) != digest(runs[2])
    assert runs[0].counts == runs[1].counts


def test_messages_are_counted_lost_or_not() -> None:
    failing = Linked(V2IC(), Channel(loss=0.2))
    run = minisim.simulate(FAIR, failing, 1)
    counts, summary = run.counts, run.summary(["messages", "message_bytes"])
    assert summary["messages"] == counts["states_sent"] + counts["orders_sent"]
    assert summary["message_bytes"] == 190 * summary["messages"]
    assert 0.18 < counts["messages_lost"] / summary["messages"] < 0.22


@pytest.mark.parametrize("channel", [Channel(), Channel(latency=0.4, jitter=0.4, loss=0.4)])
def test_whatever_a_controller_commands_none_collides(channel: Channel) -> None:
    """One that lets all go at once, and one that takes half of that back, at any time."""
    scenario = small_scenario(4, density=600.0, demand_time=120.0, drain=600.0)

    def fickle(view: View) -> Iterable[Command]:
        wanted = (Hold if (it.id + int(view.time)) % 3 else Go for it in view.vehicles)
        commands = (kind(it.id) for kind, it in zip(wanted, view.vehicles, strict=True))
        rates = (PEDALS[(it.id + int(view.time)) % len(PEDALS)] for it in view.vehicles)
        told = (Accelerate(it.id, a) for it, a in zip(view.vehicles, rates, strict=True))
        return [*commands, *told, Wake(view.time + 1.0)]

    with pytest.raises(CollisionError):
        minisim.simulate(scenario, Scripted(greedy, PLAN))
    run = minisim.simulate(scenario, Forced(Linked(Scripted(greedy, PLAN, radio=Radio()), channel)))
    assert run.columns.arrived.all()
    minisim.simulate(replace(scenario, drain=60.0), Forced(Scripted(fickle, PLAN)))


def test_published_rules_run_over_a_link_too() -> None:
    scenario = four_way(300, profile="as_run", horizon=100.0)
    run = minisim.simulate(scenario, Linked(V2ICAsRun(), Channel(loss=0.5)), on_collision="record")
    assert run.counts["messages_lost"] > 0


def test_commands_arrive_with_the_latency_and_vehicles_speak_every_interval() -> None:
    """Seen at 0 s, known after 0.2 s, and let go after 0.4 s."""
    scenario = replayed(four_way(0, profile="fair"), (0.0, 0, 2), horizon=120.0)
    gone: list[float] = []

    def answer(view: View) -> list[Command]:
        gone.extend(view.time for it in view.vehicles if not gone and it.distance <= 100.0)
        return [Go(it.id) for it in view.vehicles]

    failing = Linked(Scripted(answer, PLAN, radio=Radio(interval=0.2)), Channel(latency=0.2))
    run = minisim.simulate(scenario, failing, record="all")
    go = run.trace["released"].argmax()
    passed = (run.trace["s"] >= run.site.intersection.approach_length - 100.0).argmax()
    assert gone == [pytest.approx(run.trace["tick"][passed] * 0.1 + 0.2)]
    step = run.trace["tick"][go] - 1  # a step is recorded before its commands
    assert step * 0.1 == pytest.approx(gone[0] + 0.2)
    left = (run.trace["s"] >= run.site.intersection.paths[1].exit + 5.0).argmax()
    seen = 0.1 * (run.trace["tick"][left] - run.trace["tick"][passed])
    assert run.counts["states_sent"] == pytest.approx(seen / 0.2, abs=4)


@pytest.mark.parametrize("silent", [Dim(), AllWayStop(), Fixed()])
def test_a_controller_without_messages_is_refused(silent: Controller) -> None:
    wanted = f"a controller that vehicles talk to, such as v2ic; {silent.name} sends none"
    with pytest.raises(InputError, match=wanted):
        Linked(silent, Channel(loss=0.1))


def test_what_is_no_controller_or_fails_already_is_refused() -> None:
    with pytest.raises(InputError, match="is not a controller: it has no name"):
        Linked(3)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"the messages of v2ic\+loss=0.1 fail already"):
        Linked(Linked(V2IC(), Channel(loss=0.1)), Channel(loss=0.1))


def test_an_error_of_the_session_is_told_with_its_file_and_line() -> None:
    def wrong(view: View) -> Iterable[Command]:
        raise KeyError("mine")

    failing = Linked(Scripted(wrong, radio=Radio()), Channel(loss=0.1))
    with pytest.raises(ControllerError, match=r"at 0\.0 s: test_session\.py, line \d+: KeyError"):
        minisim.simulate(FAIR, failing)
    odd: Any = lambda _: [7]  # noqa: E731
    failing = Linked(Scripted(odd, radio=Radio()), Channel(loss=0.1))
    with pytest.raises(ControllerError, match=r"at 0\.0 s: 7 is not a command"):
        minisim.simulate(FAIR, failing)
    odd = lambda _: 7  # noqa: E731
    failing = Linked(Scripted(odd, radio=Radio()), Channel(loss=0.1))
    with pytest.raises(ControllerError, match=r"at 0\.0 s: decide\(\) must return commands"):
        minisim.simulate(FAIR, failing)


def test_what_else_a_session_has_is_kept() -> None:
    class Sorted(Session):
        plan = PLAN
        counts: Mapping[str, float] = {"mine": 3.0}

        def decide(self, view: View) -> Iterable[Command]:
            return ()

        def kind(self, lane: int, rank: int) -> str:
            return "odd" if rank % 2 else "even"

    @dataclass(frozen=True)
    class Sorting:
        name: str = "sorting"
        radio = Radio()

        def start(self, site: Site) -> Session:
            return Sorted()

    run = minisim.simulate(FAIR, Linked(Sorting(), Channel(loss=0.5)))
    assert run.counts["mine"] == 3.0
    assert {*run.kinds} == {"odd", "even"}
