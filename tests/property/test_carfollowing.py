"""Car following over all ordinary drivers: no vehicle hits a leader that brakes to a stop."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from minisim.carfollowing import ballistic, gap_ratio, idm, iidm, insertion_speed, speed_towards
from minisim.vehicle import VehicleType
from scenarios.strategies import floats, vehicles

#: Desired speeds from a side road to a main road [m/s].
SPEEDS = floats(5.0, 20.0)
STEPS = st.sampled_from([0.05, 0.1])


def acceleration(driver: VehicleType, v: float, v0: float, gap: float, v_leader: float) -> float:
    """The driver's law, bounded by the brakes."""
    a, b = driver.acceleration, driver.deceleration
    z = gap_ratio(v, gap, v_leader, a, b, driver.headway, driver.min_gap)
    wanted = (iidm if driver.model == "iidm" else idm)(v, v0, z, a, b, driver.exponent)
    return max(wanted, -driver.max_deceleration)


def equilibrium_gap(driver: VehicleType, v: float, v0: float) -> float:
    gap = driver.min_gap + v * driver.headway
    return gap / math.sqrt(1.0 - (v / v0) ** driver.exponent) if driver.model == "idm" else gap


def check_no_collision(
    driver: VehicleType, v0: float, v: float, leader_v: float, leader: float, dt: float
) -> None:
    """Behind a leader that brakes to a stop at b, until the follower stands, too."""
    s = 0.0
    while v > 1e-3 or leader_v > 0.0:
        acc = acceleration(driver, v, v0, leader - s, leader_v)
        leader, leader_v = ballistic(leader, leader_v, -driver.deceleration, dt)
        s, v = ballistic(s, v, acc, dt)
        assert leader - s > 0.0


@given(vehicles(), SPEEDS, floats(0.05, 0.98), STEPS)
def test_safe_behind_a_leader(driver: VehicleType, v0: float, share: float, dt: float) -> None:
    v = share * v0
    check_no_collision(driver, v0, v, v, equilibrium_gap(driver, v, v0), dt)


@given(vehicles(), SPEEDS, floats(0.0, 1.0), floats(0.0, 60.0), STEPS)
def test_no_collision_after_an_insertion_with_the_safe_speed(
    driver: VehicleType, v0: float, share: float, spare: float, dt: float
) -> None:
    """The leader brakes to a stop as soon as the follower has been inserted."""
    leader_v, gap = share * v0, driver.min_gap + spare
    a, b = driver.acceleration, driver.deceleration
    v = min(v0, insertion_speed(gap, leader_v, a, b, driver.headway, driver.min_gap))
    check_no_collision(driver, v0, v, leader_v, gap, dt)


@given(vehicles(), floats(0.0, 20.0), SPEEDS, floats(0.01, 200.0), floats(0.0, 20.0))
def test_more_gap_or_a_faster_leader_never_means_less_acceleration(
    driver: VehicleType, v: float, v0: float, gap: float, v_leader: float
) -> None:
    here = acceleration(driver, v, v0, gap, v_leader)
    assert acceleration(driver, v, v0, gap * 1.01, v_leader) >= here - 1e-9
    assert acceleration(driver, v, v0, gap, v_leader + 0.1) >= here - 1e-9
    assert -driver.max_deceleration <= here <= driver.acceleration


@given(floats(0.0, 30.0), floats(0.0, 200.0), floats(-20.0, 5.0), floats(0.01, 0.5))
def test_ballistic_is_exact_and_never_reverses(v: float, s: float, acc: float, dt: float) -> None:
    s_new, v_new = ballistic(s, v, acc, dt)
    assert s_new >= s
    assert v_new >= 0.0
    assert v_new**2 - v**2 == pytest.approx(2.0 * acc * (s_new - s), abs=1e-9)


@given(floats(0.5, 30.0), floats(0.0, 1.0), floats(1.0, 6.0), floats(0.02, 0.2), floats(1.0, 3.0))
def test_following_speed_towards_reaches_the_target_speed_in_time(
    v: float, share: float, b: float, dt: float, room: float
) -> None:
    """Braking never exceeds b, and the line is not crossed faster than allowed."""
    v_target = share * v
    distance = room * (v * v - v_target * v_target) / (2.0 * b) + 1e-6
    assume(distance > 1e-3)
    s = 0.0
    for _ in range(20_000):
        v_new = speed_towards(v, v_target, distance - s, b, dt)
        if v_new <= max(v_target, 0.0):
            break
        acc = (min(v, v_new) - v) / dt
        assert acc >= -b - 1e-6
        s, v = ballistic(s, v, acc, dt)
        assert v * v - v_target * v_target <= 2.0 * b * max(distance - s, 0.0) + 1e-6
        if v <= v_target + 1e-12:
            break
