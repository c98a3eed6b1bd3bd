"""Right of way by messages that come late or never."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import pytest

import minisim
from baselines import V2IC, AllWayStop, V2ICAsRun
from dim import Dim
from minisim.channel import Channel
from minisim.control import (
    Advise,
    Command,
    Controller,
    Go,
    Hold,
    Observed,
    Plan,
    Radio,
    Reserve,
    Session,
    Site,
    View,
    Wake,
)
from minisim.errors import CollisionError, ControllerError, InputError
from minisim.link import Confirmed, Link, Linked, Office, Order, Status, Vehicles
from minisim.testing import small_scenario
from scenarios import four_way
from tests.builders import Fixed, Scripted, car, digest, replayed, said, view

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


# ---------------------------------------------------------------------------- whole runs


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
        return [*commands, Wake(view.time + 1.0)]

    with pytest.raises(CollisionError):
        minisim.simulate(scenario, Scripted(greedy, PLAN))
    run = minisim.simulate(scenario, Forced(Linked(Scripted(greedy, PLAN, radio=Radio()), channel)))
    assert run.columns.arrived.all()
    minisim.simulate(scenario, Forced(Scripted(fickle, PLAN)))


def test_published_rules_run_over_a_link_too() -> None:
    scenario = four_way(300, profile="as_run", horizon=100.0)
    run = minisim.simulate(scenario, Linked(V2ICAsRun(), Channel(loss=0.5)), on_collision="record")
    assert run.counts["messages_lost"] > 0


# ---------------------------------------------------------------------------- what is refused


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
    with pytest.raises(ControllerError, match=r"at 0\.0 s: test_link\.py, line \d+: KeyError"):
        minisim.simulate(FAIR, failing)
    odd: Any = lambda _: [7]  # noqa: E731
    failing = Linked(Scripted(odd, radio=Radio()), Channel(loss=0.1))
    with pytest.raises(ControllerError, match=r"at 0\.0 s: 7 is not a command"):
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


# ---------------------------------------------------------------------------- the controller's side


def told(office: Office, now: int) -> list[Order]:
    return [*office.orders(now, 1)]


def heard(office: Office, *vehicles: Observed, at: int = 0, **more: Any) -> bool:
    """Hear from vehicles; returns whether the session is woken."""
    news = {"number": 0, "holds": False, "left": False} | more
    return max([office.hear(Status(it, at, **news)) for it in vehicles])


def test_an_order_is_repeated_until_the_vehicle_names_it() -> None:
    office, me = Office(SITE, PLAN), car(0, "a2", 40.0)
    heard(office, me)
    office.take(Go(0))
    assert told(office, 0) == told(office, 1) == [Order(0, 1, go=True)]
    office.take(Advise(0, 5.0))
    assert told(office, 2) == [Order(0, 2, go=True, speed=5.0)]
    heard(office, me, at=3, number=1, holds=True)
    assert told(office, 3) == [Order(0, 2, go=True, speed=5.0)]
    heard(office, me, at=4, number=2, holds=True)
    assert told(office, 4) == []
    office.take(Advise(0, 5.0))  # nothing new
    assert not office.talking


def test_right_of_way_waits_until_no_vehicle_in_conflict_may_hold_it() -> None:
    office, first, second = (
        Office(SITE, PLAN),
        car(0, "a2", 40.0),
        car(0, "b2", 40.0)._replace(id=1),
    )
    heard(office, first, second)
    for vehicle in (0, 1):
        office.take(Go(vehicle))
    assert told(office, 0) == [Order(0, 1, go=True)]
    office.take(Hold(0))  # lost, perhaps, and the first message was not
    assert told(office, 1) == [Order(0, 2)]
    heard(office, first, at=2, number=1, holds=True)
    heard(office, first, at=3, number=2, holds=True)  # it could no longer stop
    assert told(office, 3) == []
    heard(office, first, at=4, number=2, holds=False)
    assert told(office, 4) == [Order(1, 1, go=True)]


def test_an_early_word_does_not_free_the_way() -> None:
    """It held nothing when it said so, but a grant was under way."""
    office, first, second = (
        Office(SITE, PLAN),
        car(0, "a2", 40.0),
        car(0, "b2", 40.0)._replace(id=1),
    )
    heard(office, first, second)
    office.take(Go(0))
    told(office, 0)
    office.take(Hold(0))
    office.take(Go(1))
    heard(office, first, at=1, number=0, holds=False)
    assert [order.vehicle for order in told(office, 1)] == [0]
    heard(office, first, at=9, number=2, holds=False)
    heard(office, first, at=2, number=1, holds=True)  # overtaken on the way
    assert [order.vehicle for order in told(office, 9)] == [1]


def test_a_vehicle_is_known_once_all_ahead_of_it_are_and_until_it_says_that_it_left() -> None:
    office = Office(SITE, PLAN)
    leader, follower = car(0, "a2", 40.0), car(1, "a2", 60.0)
    assert not heard(office, follower)
    assert office.view(0).vehicles == ()
    assert heard(office, leader)
    assert office.view(0).vehicles == (leader, follower)
    assert heard(office, leader, left=True)
    assert not heard(office, leader, at=0)  # it came late
    assert office.view(1).vehicles == (follower,)
    office.take(Go(0))
    assert not office.talking


def test_one_that_left_unheard_holds_up_none() -> None:
    office = Office(SITE, PLAN)
    heard(office, car(1, "a2", 60.0))
    heard(office, car(0, "a2", -20.0), left=True)
    assert [it.id for it in office.view(0).vehicles] == [1]


def test_in_a_lane_right_of_way_is_given_from_front_to_back() -> None:
    office = Office(SITE, PLAN)
    heard(office, car(0, "a2", 40.0), car(1, "a1", 60.0))
    office.take(Go(1))
    assert told(office, 0) == []
    office.take(Go(0))
    assert [order.vehicle for order in told(office, 1)] == [0]
    assert [order.vehicle for order in told(office, 2)] == [0, 1]


def test_the_session_wakes_at_its_marks() -> None:
    office = Office(SITE, PLAN)
    assert heard(office, car(0, "a2", 70.0))
    assert not heard(office, car(0, "a2", 60.0), at=1)
    assert heard(office, car(0, "a2", 50.0), at=2)
    assert not heard(office, car(0, "a2", 40.0), at=3)


def test_a_view_says_when_each_vehicle_spoke() -> None:
    office = Office(SITE, PLAN)
    heard(office, car(0, "a2", 70.0), at=3, holds=True)
    assert office.view(9).time == pytest.approx(0.9)
    assert office.view(9).reports == {0: (pytest.approx(0.3), True)}


# ---------------------------------------------------------------------------- the vehicles' side


def obeyed(vehicles: Vehicles, *messages: Order | Reserve | Confirmed, now: int = 0) -> list[str]:
    return said(it for message in messages for it in vehicles.obey(message, now))


def beside(vehicle: Observed, now: int = 0) -> Vehicles:
    vehicles = Vehicles(SITE)
    vehicles.look(view(vehicle, time=now * SITE.dt))
    return vehicles


def test_a_vehicle_does_what_the_newest_order_says() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    new, old = Order(0, 2, go=True, speed=3.0, braking=1.0), Order(0, 1)
    assert obeyed(vehicles, new, old, new) == ["Go 0", "Advise 0", "Brake 0"]
    assert obeyed(vehicles, Order(0, 3, go=True), Order(0, 4)) == ["Advise 0", "Brake 0", "Hold 0"]
    (status,) = vehicles.statuses(7)
    assert status == Status(car(0, "a2", 40.0, 5.0), 7, number=4, holds=False, left=False)


def test_one_that_cannot_stop_keeps_its_right_of_way_and_says_so() -> None:
    vehicles = beside(car(0, "a2", 5.0, 13.0))
    assert obeyed(vehicles, Order(0, 1, go=True), Order(0, 2)) == ["Go 0"]
    (status,) = vehicles.statuses(0)
    assert (status.number, status.holds) == (2, True)


def test_a_vehicle_says_that_it_left_until_that_is_confirmed() -> None:
    vehicles = beside(car(0, "a2", -10.0, 10.0))
    vehicles.look(view())
    (status,) = vehicles.statuses(1)
    assert status.left
    assert obeyed(vehicles, Order(0, 1, go=True)) == []
    assert obeyed(vehicles, Confirmed(0)) == []
    assert not vehicles.talking


def reserving(time: float, keeps: Callable[[Observed, float], bool]) -> Reserve:
    return Reserve(0, time, keeps)


def test_a_reservation_takes_effect_when_both_know() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    assert obeyed(vehicles, reserving(0.5, lambda *_: True), now=3) == []
    assert said(vehicles.reserve(4)) == []
    assert said(vehicles.reserve(5)) == ["Go 0"]
    assert [status.holds for status in vehicles.statuses(5)] == [True]


def test_one_that_comes_too_late_is_void() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    obeyed(vehicles, reserving(0.5, lambda *_: True), now=6)
    assert said(vehicles.reserve(6)) == []


def test_a_vehicle_off_its_passage_gives_it_up_if_it_can_stop() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    obeyed(vehicles, reserving(0.0, lambda me, time: time < 1.0))
    assert said(vehicles.reserve(0)) == ["Go 0"]
    vehicles.look(view(car(0, "a2", 5.0, 13.0), time=1.0))
    assert said(vehicles.reserve(10)) == []
    vehicles.look(view(car(0, "a2", 5.0, 3.0), time=1.1))
    assert said(vehicles.reserve(11)) == ["Hold 0"]
    assert [status.holds for status in vehicles.statuses(11)] == [False]


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
