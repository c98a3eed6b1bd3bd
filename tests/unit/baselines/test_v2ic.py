"""V2I-C on hand-made situations: leaving times, advice, the list, the right of way."""

from __future__ import annotations

import math
from functools import partial

import pytest

import minisim
from baselines import V2IC
from baselines.v2ic import V2ICSession, advised_speed, time_to_cover
from minisim.control import Advise, Command, Go, Observed, View, Wake
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.profiles import Profile
from tests.builders import replayed, seen

FAIR_FOUR = four_way(100, profile="fair")
SITE = FAIR_FOUR.site(1)
car = partial(seen, speed=14.0)


def session() -> V2ICSession:
    return V2IC().start(SITE)


def decided(run: V2ICSession, time: float, *cars: Observed) -> list[Command]:
    return list(run.decide(View(time, cars)))


def test_time_to_cover_is_that_of_uniform_acceleration_up_to_the_limit() -> None:
    assert time_to_cover(20.0, 0.0, 2.5, 14.0) == pytest.approx(4.0)  # ½·2.5·4² = 20
    # From 4 to 14 m/s at 2.5: 4 s and 36 m; the other 28 m at 14 m/s take 2 s.
    assert time_to_cover(64.0, 4.0, 2.5, 14.0) == pytest.approx(6.0)
    assert time_to_cover(28.0, 14.0, 2.5, 14.0) == pytest.approx(2.0)
    assert time_to_cover(30.0, 15.0, 2.5, 14.0) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("distance", "speed", "time", "advice"),
    [
        (60.0, 12.0, 8.0, 3.0),  # (12 + 3)/2 · 8 = 60
        (50.0, 14.0, 10.0, 0.0),  # 2·50/10 − 14 is negative
        (100.0, 2.0, 5.0, 14.0),  # 38 m/s is above the limit
        (10.0, 5.0, 0.0, 14.0),  # no vehicle to wait for
        (0.0, 3.0, 5.0, 0.0),  # at the line
        (-1.0, 3.0, 5.0, 0.0),  # past it
    ],
)
def test_advice_is_where_uniform_braking_ends_within_0_and_the_limit(
    distance: float, speed: float, time: float, advice: float
) -> None:
    """v − dec·M with dec = 2(vM − D)/M² (Li and Liu): the mean of both speeds covers D in M."""
    assert advised_speed(distance, speed, time, 14.0) == advice


def test_leaving_times_are_distance_by_speed_up_to_a_cap() -> None:
    serving = session()
    assert serving.leaving_time(140.0, 14.0, 0.0, 2.6, 14.0) == pytest.approx(10.0, abs=1e-4)
    from_rest = time_to_cover(20.0, 0.0, SITE.vehicle.acceleration, 14.0)
    assert serving.leaving_time(20.0, 0.0, 0.0, 2.6, 14.0) == pytest.approx(from_rest)
    assert serving.leaving_time(20.0, 0.0, 7.0, 2.6, 14.0) == pytest.approx(7.0 + from_rest)
    assert serving.leaving_time(0.0, 14.0, 0.0, 2.6, 14.0) > 0.0


def test_the_first_goes_and_a_later_one_in_conflict_is_advised() -> None:
    first, second = car(5, 0, 2, 180.0), car(6, 1, 2, 185.0)
    go, free, advice, wake = decided(session(), 10.0, first, second)
    assert (go, free, wake) == (Go(5), Advise(5, math.inf), Wake(11.0))
    # The first drives at the limit; its rear is expected to leave after distance over speed.
    leaving = (180.0 + SITE.intersection.path(first.movement).crossing + first.length) / 14.0
    assert isinstance(advice, Advise)
    assert advice.vehicle == 6
    assert advice.speed == pytest.approx(2.0 * 185.0 / leaving - 14.0)


def test_vehicles_in_harmony_go_at_once_and_no_further_call_is_needed() -> None:
    commands = decided(session(), 0.0, car(1, 0, 2, 190.0), car(2, 2, 2, 195.0))
    assert [c for c in commands if not isinstance(c, Advise)] == [Go(1), Go(2)]


def test_the_list_is_in_order_of_registration_not_of_distance() -> None:
    run = session()
    decided(run, 0.0, car(1, 0, 2, 199.0, speed=3.0))
    commands = decided(run, 5.0, car(1, 0, 2, 184.0, speed=3.0), car(2, 1, 2, 150.0))
    assert run.order == [1, 2]
    assert Go(2) not in commands


def test_a_waiting_vehicle_blocks_those_in_conflict_behind_it() -> None:
    """b2 waits for a2; c1 conflicts with b2 alone, and comes later: it waits for b2."""
    conflicts, index = SITE.conflicts, SITE.intersection.index
    a2, b2 = car(1, 0, 2, 20.0), car(2, 1, 2, 60.0)
    assert conflicts[index(a2.movement), index(b2.movement)]
    run = session()
    assert [c for c in decided(run, 0.0, a2, b2) if isinstance(c, Go)] == [Go(1)]
    c1 = car(4, 2, 1, 150.0)
    assert conflicts[index(c1.movement), index(b2.movement)]
    assert not conflicts[index(c1.movement), index(a2.movement)]
    a2, b2 = car(1, 0, 2, 6.0, speed=2.0), car(2, 1, 2, 50.0, speed=2.0)
    commands = decided(run, 1.0, a2, b2, c1)
    assert Go(4) not in commands
    assert any(isinstance(c, Advise) and c.vehicle == 4 and c.speed < 14.0 for c in commands)


def test_the_right_of_way_comes_when_the_other_has_left_and_not_before() -> None:
    run = session()
    decided(run, 0.0, car(1, 0, 2, 20.0), car(2, 1, 2, 60.0))
    leaving = car(1, 0, 2, -18.9)  # its rear is still in the junction
    waiting = car(2, 1, 2, 15.0, speed=5.0)
    assert Go(2) not in decided(run, 3.0, leaving, waiting)
    assert decided(run, 3.1, waiting) == [Go(2), Advise(2, math.inf)]
    assert run.order == [2]


def test_a_vehicle_alone_is_not_delayed() -> None:
    scenario = replayed(FAIR_FOUR, (0.0, 0, 2), horizon=120.0)
    run, free = (minisim.simulate(scenario, it) for it in (V2IC(), minisim.control.Unregulated()))
    assert run.columns.travel_time == pytest.approx(free.columns.travel_time)


def test_advice_spares_stops() -> None:
    """At 250 veh/h/lane hardly any vehicle stands, thanks to the advice."""
    run = minisim.simulate(four_way(250, profile="fair", horizon=900.0), V2IC(), seed=1)
    assert run.columns.waiting_time.max() < 5.0
    assert run.columns.waiting_time.mean() < 0.1


def test_at_a_crawl_coarse_steps_serve_as_soon_as_fine_ones() -> None:
    """Steps of 0.5 s passed the limit and fell back to 0: the last arrived at 518 s, not at 307."""
    trips = [(0.0, lane, manoeuvre) for lane in range(4) for manoeuvre in (1, 2, 3)]
    last = []
    for dt in (0.1, 0.5):
        profile = Profile(name="test", vehicle=VehicleType(), speed_limit=1.0, dt=dt)
        scenario = replayed(four_way(profile=profile, arm_length=80.0), *trips, horizon=1000.0)
        last.append(minisim.simulate(scenario, V2IC()).trips["arrival_s"].max())
    assert last[1] == pytest.approx(last[0], rel=0.03)
