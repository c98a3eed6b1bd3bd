"""The all-way stop: which vehicle stands at the line, which goes next, and when."""

from __future__ import annotations

import numpy as np
import pytest

import minisim
from baselines import AllWayStop
from minisim.control import Observed, Session
from minisim.junction.movements import Movement
from scenarios.library import four_way
from tests.builders import EveryStep, drained, replayed, seen, show

FAIR = four_way(profile="fair")
SITE = FAIR.site()
STRAIGHT = 2


def standing(id: int, lane: int, manoeuvre: int = STRAIGHT) -> Observed:
    return seen(id, lane, manoeuvre, 0.25)


def session_with(*vehicles: Observed, reaction: float = 1.0) -> Session:
    """At 10 s all of these have just come to stand, in the order of their ids."""
    session = AllWayStop(reaction=reaction).start(SITE)
    for k in range(1, len(vehicles) + 1):
        there = sorted(vehicles, key=lambda v: v.id)[:k]
        time = 10.0 - 0.1 * (len(vehicles) - k)
        assert show(session, time, *sorted(there, key=lambda v: v.lane)) == []
    return session


def test_one_vehicle_goes_once_after_its_reaction_time() -> None:
    session = session_with(standing(1, 0))
    answers = [show(session, time, standing(1, 0)) for time in (10.9, 11.0, 11.1)]
    assert answers == [[], ["Go 1"], []]


def test_without_reaction_time_it_goes_at_once() -> None:
    session = AllWayStop(reaction=0.0).start(SITE)
    assert show(session, 3.0, seen(1, 0, 2, 0.3, 0.2)) == []
    assert show(session, 3.1, seen(1, 0, 2, 0.25, 0.1)) == ["Go 1"]


def test_a_vehicle_that_moves_or_is_not_at_the_line_does_not_queue() -> None:
    for place in ((1.1, 0.0), (0.3, 0.11), (0.9, 2.0)):
        session = AllWayStop().start(SITE)
        assert not any(show(session, time, seen(1, 0, 2, *place)) for time in (1.0, 2.0, 3.0, 4.0))


def test_a_vehicle_that_moves_again_has_to_stop_again() -> None:
    session = session_with(standing(1, 0))
    assert show(session, 10.5, seen(1, 0, 2, 0.2, 0.3)) == []
    assert show(session, 11.0, standing(1, 0)) == []
    assert show(session, 12.0, standing(1, 0)) == ["Go 1"]


def test_only_the_first_of_a_lane_queues() -> None:
    session = session_with(standing(1, 0))
    second = seen(2, 0, 2, 0.9)
    assert show(session, 11.0, standing(1, 0), second) == ["Go 1"]
    # The first is let go. Now the second is the head, and its standing time starts.
    assert show(session, 11.5, seen(1, 0, 2, -1.0, 1.0), second) == []
    assert show(session, 12.5, seen(1, 0, 2, -5.0, 3.0), second) == ["Go 2"]


def test_the_first_to_stand_goes_first_and_of_two_that_of_the_first_arm() -> None:
    a, b = standing(2, 0), standing(1, 1)
    session = session_with(a, b)
    assert show(session, 10.9, a, b) == ["Go 1"]
    # b2 is on its way: a waits until b2 has left its way.
    assert show(session, 11.2, a, seen(1, 1, 2, 0.1, 0.8)) == []
    assert show(session, 12.0, a, seen(1, 1, 2, -2.0, 3.0)) == []
    assert show(session, 14.0, a, seen(1, 1, 2, -17.0, 8.0)) == ["Go 2"]
    session = AllWayStop().start(SITE)  # equal times
    assert show(session, 10.0, a, b) == []
    assert show(session, 11.0, a, b) == ["Go 2"]


def test_no_vehicle_overtakes_a_conflicting_one_that_has_waited_longer() -> None:
    # a2 goes; b2 has to wait for it; c2 does not conflict with a2, but with b2, which was first.
    a, b, c = standing(1, 0), standing(2, 1), standing(3, 2)
    session = session_with(a, b, c)
    assert show(session, 10.8, a, b, c) == ["Go 1"]
    assert show(session, 12.0, seen(1, 0, 2, -2.0, 3.0), b, c) == []
    gone = seen(1, 0, 2, -17.0, 8.0)
    assert show(session, 14.0, gone, b, c) == ["Go 2"]
    assert show(session, 14.1, b, c) == []


def test_a_later_vehicle_without_conflicts_overtakes() -> None:
    # d1 turns left into a: it is in the way only of vehicles that leave by a.
    a, b, d = standing(1, 0), standing(2, 1), standing(3, 3, 1)
    assert not SITE.conflicts[SITE.intersection.index(Movement(3, 1)), [1, 4]].any()
    session = session_with(a, b, d)
    assert show(session, 10.8, a, b, d) == ["Go 1"]
    assert show(session, 11.0, seen(1, 0, 2, 0.1, 0.4), b, d) == ["Go 3"]


def test_a_later_vehicle_is_held_back_by_one_that_still_hesitates() -> None:
    # The reaction time of each starts with its own standstill, but the order is that of standing.
    a, b = standing(1, 0), standing(2, 1)
    session = AllWayStop().start(SITE)
    assert show(session, 9.0, a) == show(session, 9.5, a, b) == []
    assert show(session, 10.0, a, b) == ["Go 1"]
    assert show(session, 10.5, seen(1, 0, 2, -0.5, 1.0), b) == []


def test_a_lone_vehicle_stops_for_the_reaction_time() -> None:
    run = minisim.simulate(replayed(FAIR, (0.0, 0, 2), horizon=120.0), AllWayStop(), record="all")
    frame = run.trajectories
    entry = run.site.intersection.approach_length
    still = frame[(frame["speed_mps"] == 0.0) & (frame["s_m"] > 400.0)]
    assert entry - 0.3 <= still["s_m"].min() <= still["s_m"].max() < entry
    # One step more: a wait ends with the step in which it is over.
    assert run.summary()["waiting_time_s"] == pytest.approx(1.1, abs=0.11)


def test_to_look_in_every_step_would_change_nothing() -> None:
    scenario = four_way(350, profile="fair", horizon=600.0)
    controllers = AllWayStop(), EveryStep(AllWayStop())
    some, every = (minisim.simulate(scenario, it, seed=3).trips for it in controllers)
    assert some.equals(every)


def test_it_carries_what_was_measured_in_the_field() -> None:
    """400–1400 veh/h in all, says Al-Kaisy 2023 of all-way stops of single lanes.

    All lanes have a queue all the time; what leaves in the second half hour is the capacity.
    """
    scenario = four_way(500, profile="fair", horizon=3600.0)
    arrival = minisim.simulate(scenario, AllWayStop(), seed=1).columns.arrival
    capacity = 2 * int(np.sum(arrival > 1800.0))
    assert 1200 < capacity < 1600


def test_every_vehicle_gets_its_turn() -> None:
    busy = four_way(350, split=(8, 8, 8, 1), profile="fair", horizon=600.0)
    trips = minisim.simulate(drained(busy, 1, 2000.0), AllWayStop()).columns
    assert trips.arrived.all()
    # Lane d has hardly a queue of its own, so no vehicle there waits for long.
    assert trips.waiting_time[trips.lane == 3].max() < 40.0
