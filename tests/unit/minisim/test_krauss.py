"""Krauß's law against theory, and the vehicle of the published signal runs against its trips."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import minisim
from baselines import FixedTime
from minisim.carfollowing import krauss, safe_speed, semi_implicit, stepwise_towards
from minisim.control import Open, Plan, Unregulated
from minisim.errors import InputError
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.profiles import AS_RUN_SIGNALS
from tests.builders import Fixed, replayed

#: SUMO's passenger car under Krauß's law.
CAR = VehicleType(model="krauss")
#: The vehicle of the signals by minisim's own rules, which the host shares.
HOSTED = replace(AS_RUN_SIGNALS, vehicle=replace(AS_RUN_SIGNALS.vehicle, sumo=None))
ALIKE = replace(HOSTED, vehicle=replace(HOSTED.vehicle, speed_deviation=0.0))


def follower(dt: float, leader_v: float, seconds: float, gap: float, v: float) -> tuple[float, ...]:
    """Gap and speed after so long behind a leader at constant speed; CAR, desired 14 m/s."""
    leader, s = gap, 0.0
    for _ in range(round(seconds / dt)):
        safe = safe_speed(leader - s - CAR.min_gap, leader_v, 4.5, 1.0, dt)
        v = krauss(v, 14.0, safe, 2.6, 4.5, dt)
        s += v * dt
        leader += leader_v * dt
    return leader - s, v


@pytest.mark.parametrize("dt", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("leader_v", [2.0, 10.0, 14.0])
def test_the_equilibrium_gap_is_the_headway_at_any_step(dt: float, leader_v: float) -> None:
    """v·T + s0 (Krauß 1998, §3.1: v_safe = v at gap v·T); SUMO's millimetre beside it."""
    gap, v = follower(dt, leader_v, 120.0, gap=40.0, v=5.0)
    assert v == pytest.approx(leader_v, abs=1e-6)
    if leader_v < 14.0:
        assert gap == pytest.approx(leader_v * 1.0 + CAR.min_gap + 1e-3, abs=1e-4)
    assert safe_speed(leader_v + 1e-3, leader_v, 4.5, 1.0, dt) == pytest.approx(leader_v)


def test_small_steps_give_the_safe_speed_of_krauss() -> None:
    """−bT + √(b²T² + v_l² + 2b·gap), Krauß 1998 (SUMO's documentation gives the same)."""
    for gap, v_leader, b in itertools.product((1.0, 14.0, 80.0), (0.0, 6.0, 14.0), (2.0, 4.5)):
        exact = -b + math.sqrt(b * b + v_leader**2 + 2.0 * b * gap)
        assert safe_speed(gap, v_leader, b, 1.0, 1e-4) == pytest.approx(exact, abs=2e-3)


def test_a_hand_made_case_in_whole_steps_of_braking() -> None:
    """b·dt = 1 m/s: 3 m/s for 1 s, then 2, 1 and 0 m/s for 0.5 s each take 4.5 m."""
    assert safe_speed(4.501, 0.0, 2.0, 1.0, 0.5) == pytest.approx(3.0)
    assert stepwise_towards(0.0, 3.0, 2.0, 0.5) == pytest.approx(3.0)
    assert stepwise_towards(1.0, 3.0, 2.0, 0.5) == pytest.approx(3.0)
    assert stepwise_towards(2.0, 1.0, 2.0, 0.5) == 2.0
    assert safe_speed(0.0, 14.0, 4.5, 1.0, 0.1) == safe_speed(-3.0, 14.0, 4.5, 1.0, 0.1) == 0.0


def test_next_speed_is_the_least_of_wish_engine_and_safety() -> None:
    assert krauss(10.0, 14.0, math.inf, 2.6, 4.5, 0.1) == pytest.approx(10.26)
    assert krauss(13.9, 14.0, math.inf, 2.6, 4.5, 0.1) == 14.0
    assert krauss(14.0, 14.0, 6.0, 2.6, 4.5, 0.1) == 6.0
    assert krauss(14.0, 8.0, math.inf, 2.6, 4.5, 0.1) == pytest.approx(14.0 - 0.45)


@pytest.mark.parametrize("dt", [0.01, 0.1])
@pytest.mark.parametrize("b", [4.5, 1000.0])
def test_it_stops_at_a_standing_obstacle(dt: float, b: float) -> None:
    s, v = 0.0, 14.0
    for _ in range(round(60.0 / dt)):
        safe = safe_speed(100.0 - s - 2.0, 0.0, b, 1.0, dt)
        s, v = semi_implicit(s, v, (krauss(v, 14.0, safe, 2.6, b, dt) - v) / dt, dt)
    assert v == pytest.approx(0.0, abs=1e-9)
    assert s == pytest.approx(98.0, abs=2e-3)
    assert s < 98.0


@pytest.mark.parametrize(("manoeuvre", "length"), [(1, 990.53), (2, 995.9), (3, 995.7)])
def test_an_isolated_vehicle_takes_as_long_as_published(manoeuvre: int, length: float) -> None:
    """The free road at 14 m/s and what SUMO books beside it: 0.13 … 0.17 s of starting and, in
    turns, 9.03 m at 6.51 and 14.2 m at 8.00 m/s (`my_network.net.xml`; published trips such as
    v17.c_2 of 350_TTL.xml: 69.45 s for 995.9 m at 14.37 m/s with a time loss of 0.14 s). Our turn
    speeds are those of arcs, 5.55 and 6.96 m/s: up to 0.3 s longer.
    """
    what = replayed(four_way(100, profile=ALIKE), (0.0, 0, manoeuvre), horizon=200.0)
    run = minisim.simulate(what, Fixed(Plan(), (Open(0),)))
    slow = {1: 9.03 / 6.51 - 9.03 / 14.0, 2: 0.0, 3: 14.2 / 8.0 - 14.2 / 14.0}[manoeuvre]
    expected = length / 14.0 + 0.15 + slow
    assert run.columns.travel_time[0] == pytest.approx(expected, abs=0.35)
    assert run.columns.waiting_time[0] == 0.0


def test_the_second_vehicle_of_a_second_is_inserted_when_the_first_has_cleared_its_place() -> None:
    """Published: departure delays of 0.54 … 0.59 s (v14.b_1 and v116.a_3 of 350_TTL.xml).

    4 m of car and 2 m of gap at 14 m/s after a start at 50 m/s²: 0.57 s, and a step at most.
    """
    what = replayed(four_way(100, profile=ALIKE), (0.0, 0, 2), (0.0, 0, 2), horizon=90.0)
    run = minisim.simulate(what, Unregulated())
    assert run.columns.depart[1] == pytest.approx(0.57, abs=0.1)


def test_queues_discharge_at_the_saturation_flow_of_the_law() -> None:
    """A vehicle every T + (length + s0)/v: 1.43 s, 2520 veh/h, for the published vehicle."""
    trips = [(2.0 * k, 0, 2) for k in range(12)]
    what = replayed(four_way(100, profile=ALIKE), *trips, horizon=400.0)
    run = minisim.simulate(what, FixedTime(greens=(50.0, 50.0, 50.0, 50.0), order=(1, 2, 3, 0)))
    arrival = np.sort(run.columns.arrival)
    assert np.diff(arrival)[3:].mean() == pytest.approx(1.0 + 6.0 / 14.0, abs=0.05)


def test_its_brakes_need_no_more_than_its_deceleration() -> None:
    assert VehicleType(model="krauss", max_deceleration=4.5).needed_braking == 4.5
    with pytest.raises(InputError, match=r"at least 4\.50"):
        VehicleType(model="krauss", max_deceleration=4.4)


def test_a_step_of_a_tenth_gives_the_waits_of_a_hundredth() -> None:
    """The published step is 0.01 s; common arrivals and drivers, half an hour.

    A single quarter differs by up to 9 % (16 seeds), the mean of all by 3 %.
    """

    def means(dt: float) -> tuple[float, float]:
        road = four_way(250, profile=replace(HOSTED, dt=dt), horizon=900.0)
        rows = [minisim.simulate(road, FixedTime(greens=10.75), k).summary() for k in (1, 2)]
        waiting, travel = ([row[f"{of}_time_s"] for row in rows] for of in ("waiting", "travel"))
        return sum(waiting) / 2.0, sum(travel) / 2.0

    (coarse, slow), (fine, quick) = means(0.1), means(0.01)
    assert coarse == pytest.approx(fine, rel=0.04)
    assert slow == pytest.approx(quick, abs=0.8)
