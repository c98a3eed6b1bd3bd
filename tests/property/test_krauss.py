"""Krauß's law over all ordinary drivers: no collisions, exact stops, one law in both rules."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import minisim
from baselines import FixedTime
from dim import Dim
from minisim.carfollowing import (
    STILL,
    braking_distance,
    krauss,
    safe_speed,
    semi_implicit,
    stepwise_towards,
)
from minisim.control import Controller
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.profiles import AS_RUN_SIGNALS, FAIR, Profile
from scenarios.strategies import floats

STEPS = st.sampled_from([0.01, 0.05, 0.1, 0.5])
HEADWAYS = floats(0.5, 2.0)
BRAKING = floats(1.0, 9.0) | st.just(1000.0)
SPEEDS = floats(0.0, 30.0)


@st.composite
def drivers(draw: st.DrawFn) -> VehicleType:
    """Passenger cars under Krauß's law, and the abrupt ones of the published runs."""
    b = draw(floats(1.5, 5.0) | st.just(1000.0))
    return VehicleType(
        length=draw(floats(3.0, 6.0)), acceleration=draw(floats(0.8, 4.0) | st.just(50.0)),
        deceleration=b, max_deceleration=min(1000.0, 1.25 * b),
        headway=draw(HEADWAYS), min_gap=draw(floats(1.0, 4.0)), model="krauss",
    )  # fmt: skip


@given(floats(0.01, 200.0), SPEEDS, BRAKING, HEADWAYS, STEPS)
def test_the_safe_speed_uses_up_the_room_and_no_more(
    gap: float, v_leader: float, b: float, headway: float, dt: float
) -> None:
    """Driven for the headway, then braked to a stop: gap + the leader's braking distance.

    After the headway the first step of braking is already b·dt slower: `braking_distance`.
    """
    v = safe_speed(gap, v_leader, b, headway, dt)
    room = max(gap - STILL, 0.0) + (braking_distance(v_leader, b, dt) if gap > STILL else 0.0)
    assert v * headway + braking_distance(v, b, dt) == pytest.approx(room, abs=1e-6, rel=1e-9)


@given(SPEEDS, BRAKING, STEPS)
def test_the_braking_distance_is_the_sum_of_its_steps(v: float, b: float, dt: float) -> None:
    s, left = 0.0, v
    while left > b * dt:
        s, left = semi_implicit(s, left, -b, dt)
    assert braking_distance(v, b, dt) == pytest.approx(s, abs=1e-6)


@given(floats(0.1, 20.0), floats(0.0, 20.0), floats(0.01, 150.0), BRAKING, STEPS)
@example(5.0, 4.0, 1.25, 2.0, 0.1)
def test_driving_stepwise_towards_a_limit_meets_it_where_it_begins(
    v0: float, target: float, distance: float, b: float, dt: float
) -> None:
    """Never faster than the limit past its beginning; harder braking than b only at the very end.

    There the rule spreads the rest of the way over one step, as SUMO's does, however much that is:
    `minisim.laws.slow_down` brakes at b at most.
    """
    v = min(max(v0, target), stepwise_towards(target, distance, b, dt))
    s = v * dt
    for _ in range(100_000):
        if v <= target + 1e-9 or s >= distance:
            break
        v_new = max(min(v0, stepwise_towards(target, distance - s, b, dt)), target)
        at_the_end = distance - s <= (target + b * dt) * dt
        assert at_the_end or v - v_new <= b * dt * (1.0 + 1e-6) + 1e-9
        s, v = s + v_new * dt, v_new
    assert v <= target + 1e-6 or s <= distance + 1e-6


@given(drivers(), floats(5.0, 20.0), floats(0.05, 1.0), st.sampled_from([0.1, 0.5]))
def test_a_platoon_behind_a_leader_that_brakes_to_a_stop_keeps_its_gaps(
    driver: VehicleType, v0: float, share: float, dt: float
) -> None:
    """From equilibrium, the leader brakes at b: all stop `min_gap` behind, none closer."""
    a, b, headway = driver.acceleration, driver.deceleration, driver.headway
    v = [share * v0] * 4
    s = [-i * (share * v0 * headway + driver.min_gap + STILL) for i in range(4)]
    for _ in range(round((30.0 * headway + 20.0 / b) / dt)):
        speeds = [max(v[0] - b * dt, 0.0)]
        for i in range(1, 4):
            safe = safe_speed(s[i - 1] - s[i] - driver.min_gap, v[i - 1], b, headway, dt)
            speeds.append(krauss(v[i], v0, safe, a, b, dt))
            assert speeds[i] >= v[i] - b * dt - 1e-6
        v = speeds
        s = [position + speed * dt for position, speed in zip(s, v, strict=True)]
        gaps = [ahead - behind for ahead, behind in pairwise(s)]
        assert min(gaps) >= driver.min_gap - 1e-6
    assert v == [0.0] * 4
    assert gaps == pytest.approx([driver.min_gap] * 3, abs=2e-3)


@given(drivers(), floats(0.0, 20.0), floats(0.01, 60.0), STEPS)
def test_more_room_is_as_safe(driver: VehicleType, v_leader: float, gap: float, dt: float) -> None:
    b, headway = driver.deceleration, driver.headway
    here = safe_speed(gap, v_leader, b, headway, dt)
    assert safe_speed(gap * 1.01, v_leader, b, headway, dt) >= here - 1e-9
    assert safe_speed(gap, v_leader + 0.1, b, headway, dt) >= here - 1e-9
    assert 0.0 <= here < math.inf


@given(
    drivers(),
    st.sampled_from([FAIR, AS_RUN_SIGNALS]),
    st.sampled_from([FixedTime(greens=15.0), Dim(), Dim(gate="harmonious")]),
    st.integers(0, 1000),
)
def test_no_run_has_a_collision(
    driver: VehicleType, profile: Profile, controller: Controller, seed: int
) -> None:
    scenario = four_way(300.0, profile=replace(profile, vehicle=driver), horizon=150.0)
    assert minisim.simulate(scenario, controller, seed).collisions == ()
