"""Car following against theory: equilibria, free road, stopping, integration."""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from minisim.carfollowing import (
    ballistic,
    free_road,
    gap_ratio,
    idm,
    iidm,
    insertion_speed,
    krauss,
    safe_speed,
    semi_implicit,
    speed_towards,
)


class Driver(NamedTuple):
    """v0, a, b, T, s0, δ."""

    v0: float
    a: float
    b: float
    headway: float
    min_gap: float
    delta: float = 4.0

    def z(self, v: float, gap: float, v_leader: float) -> float:
        return gap_ratio(v, gap, v_leader, self.a, self.b, self.headway, self.min_gap)

    def idm(self, v: float, gap: float, v_leader: float) -> float:
        return idm(v, self.v0, self.z(v, gap, v_leader), self.a, self.b, self.delta)

    def iidm(self, v: float, gap: float, v_leader: float) -> float:
        return iidm(v, self.v0, self.z(v, gap, v_leader), self.a, self.b, self.delta)


#: Treiber, Hennecke, Helbing 2000, PRE 62:1805, table I (v0 = 120 km/h).
TREIBER = Driver(v0=120 / 3.6, a=0.73, b=1.67, headway=1.6, min_gap=2.0)
#: SUMO's passenger car on a road of 14 m/s.
SUMO = Driver(v0=14.0, a=2.6, b=4.5, headway=1.0, min_gap=2.5)
DRIVERS = (TREIBER, SUMO, SUMO._replace(delta=1.0), TREIBER._replace(delta=8.0))


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0])
def test_free_acceleration_is_a_times_one_minus_the_power(driver: Driver, share: float) -> None:
    v = share * driver.v0
    expected = driver.a * (1.0 - share**driver.delta)
    assert driver.idm(v, math.inf, v) == pytest.approx(expected, abs=1e-12)
    assert driver.iidm(v, math.inf, v) == pytest.approx(expected, abs=1e-12)


def test_above_the_desired_speed_braking_is_comfortable_at_most() -> None:
    assert free_road(15.0 / 14.0, 2.6, 4.5, 4.0) == pytest.approx(2.6 * (1 - (15 / 14) ** 4))
    assert free_road(40.0 / 14.0, 2.6, 4.5, 4.0) == -4.5
    for v in (14.1, 20.0, 40.0):
        assert -4.5 <= SUMO.iidm(v, math.inf, v) < 0.0


@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.95, 1.0])
@pytest.mark.parametrize("model", ["idm", "iidm"])
def test_each_law_has_its_equilibrium_gap(driver: Driver, share: float, model: str) -> None:
    """IDM: s_e = (s0 + vT) / √(1 − (v/v0)^δ), PRE 62:1805, eq. 9. Improved IDM: s0 + vT up to the
    desired speed, Treiber, Kesting, Traffic Flow Dynamics, 2013, §11.3.7."""
    if model == "idm" and share == 1.0:
        return
    law, v = getattr(driver, model), share * driver.v0
    gap = driver.min_gap + v * driver.headway
    gap /= math.sqrt(1.0 - share**driver.delta) if model == "idm" else 1.0
    assert law(v, gap, v) == pytest.approx(0.0, abs=1e-12)
    assert law(v, 0.99 * gap, v) < 0.0
    assert law(v, 1.01 * gap, v) > 0.0 or share == 1.0


@pytest.mark.parametrize("model", ["idm", "iidm"])
def test_a_follower_settles_at_the_equilibrium_gap(model: str) -> None:
    """300 s behind a leader at 10 m/s, from a wrong gap and a wrong speed."""
    law = getattr(SUMO, model)
    leader, s, v, dt = 60.0, 0.0, 2.0, 0.1
    for _ in range(3000):
        s, v = ballistic(s, v, law(v, leader - s, 10.0), dt)
        leader += 10.0 * dt
    wanted = 2.5 + 10.0
    if model == "idm":
        wanted /= math.sqrt(1.0 - (10.0 / 14.0) ** 4)
    assert leader - s == pytest.approx(wanted, abs=1e-3)
    assert v == pytest.approx(10.0, abs=1e-4)


def test_desired_gap_never_falls_below_the_gap_at_standstill() -> None:
    """s* = s0 + max(0, vT + v·Δv / 2√(ab)), by hand."""
    driver = Driver(v0=20.0, a=1.0, b=4.0, headway=1.5, min_gap=2.0)
    assert driver.z(10.0, 11.0, 8.0) == pytest.approx((2 + 15 + 20 / 4) / 11)
    assert driver.z(10.0, 8.0, 30.0) == 2.0 / 8.0


@pytest.mark.parametrize("gap", [0.0, -0.1, -100.0])
def test_an_overlap_is_never_hidden(gap: float) -> None:
    assert SUMO.z(5.0, gap, 5.0) == math.inf
    assert SUMO.idm(5.0, gap, 5.0) == -math.inf
    assert SUMO.iidm(5.0, gap, 5.0) == -math.inf


def test_improved_idm_is_continuous_where_its_branches_meet() -> None:
    for v in (5.0, 13.9):
        gap = 2.5 + v
        assert SUMO.iidm(v, gap * (1 - 1e-9), v) == pytest.approx(
            SUMO.iidm(v, gap * (1 + 1e-9), v), abs=1e-6
        )
    for gap in (5.0, 16.5, 40.0):
        below, above = (SUMO.iidm(14.0 + d, gap, 14.0) for d in (-1e-9, 1e-9))
        assert below == pytest.approx(above, abs=1e-6)


def test_ballistic_is_uniform_acceleration() -> None:
    s, v = 3.0, 5.0
    for _ in range(40):
        s, v = ballistic(s, v, 1.5, 0.1)
    assert s == pytest.approx(3.0 + 5.0 * 4.0 + 0.5 * 1.5 * 16.0)
    assert v == pytest.approx(5.0 + 1.5 * 4.0)


def test_ballistic_stops_where_the_speed_reaches_zero() -> None:
    """A vehicle braking at b from v stops after v²/2b, whatever the step."""
    for dt in (0.01, 0.1, 0.37, 1.0):
        s, v = 0.0, 7.3
        for _ in range(math.ceil(7.3 / 2.0 / dt) + 1):
            s, v = ballistic(s, v, -2.0, dt)
        assert v == 0.0
        assert s == pytest.approx(7.3**2 / 4.0)


def krauss_law(v: float, gap: float, v_leader: float, dt: float) -> float:
    v_safe = safe_speed(gap - SUMO.min_gap, v_leader, SUMO.b, SUMO.headway, dt)
    return (krauss(v, SUMO.v0, v_safe, SUMO.a, SUMO.b, dt) - v) / dt


@pytest.mark.parametrize(
    ("law", "move", "within"),
    [(lambda *state: SUMO.idm(*state[:3]), ballistic, 0.05), (krauss_law, semi_implicit, 0.5)],
    ids=["idm", "krauss"],
)
def test_the_scheme_is_of_first_order(law: Any, move: Any, within: float) -> None:
    """Halving dt halves the error (Treiber, Kanagaraj 2015, §3)."""

    def final_position(dt: float) -> float:
        """A follower closes in on a leader at 8 m/s for 20 s."""
        leader, s, v = 50.0, 0.0, 14.0
        for k in range(round(20.0 / dt)):
            s, v = move(s, v, law(v, leader + 8.0 * k * dt - s, 8.0, dt), dt)
        return s

    exact = final_position(0.1 / 64)
    errors = [abs(final_position(dt) - exact) for dt in (0.1, 0.05, 0.025)]
    orders = [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]
    assert all(0.7 < order < 1.4 for order in orders), (errors, orders)
    assert errors[0] < within


@pytest.mark.parametrize("dt", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("v_target", [0.0, 5.5])
def test_following_speed_towards_brakes_at_exactly_b(dt: float, v_target: float) -> None:
    """Neither earlier nor harder than needed, and at the target with the target speed."""
    b, v, distance = 2.0, 11.0, 100.0
    s = 0.0
    braking = []
    while v > v_target and s < distance:
        v_new = speed_towards(v, v_target, distance - s, b, dt)
        if v_new <= v_target:
            break
        acc = (min(v, v_new) - v) / dt
        braking.append(-acc)
        s, v = ballistic(s, v, acc, dt)
    needed = (11.0**2 - v_target**2) / (2.0 * b)
    coasting = [a for a in braking if a < 1e-9]
    assert len(coasting) * dt * 11.0 <= distance - needed <= (len(coasting) + 1) * dt * 11.0
    full = braking[len(coasting) + 1 :]
    assert full
    np.testing.assert_allclose(full, b, rtol=1e-9)
    assert max(braking) <= b * (1.0 + 1e-9)
    # What is left takes less than one step at b, and the way to go is just enough for it.
    assert v - v_target <= b * dt + 1e-9
    assert distance - s == pytest.approx((v * v - v_target**2) / (2.0 * b), abs=1e-9)


def test_speed_towards_solves_its_equation() -> None:
    for v, target, distance in itertools.product((0.0, 3.0, 14.0), (0.0, 5.0), (0.5, 8.0, 60.0)):
        v_new = speed_towards(v, target, distance, 3.0, 0.1)
        if v_new >= 0.0 and v_new > v - 3.0 * 0.1:
            way = (v + v_new) / 2.0 * 0.1 + (v_new**2 - target**2) / 6.0
            assert way == pytest.approx(distance)


def test_speed_towards_asks_for_more_than_b_where_b_cannot_make_it() -> None:
    """The caller bounds the braking and so decides what becomes of the line."""
    assert speed_towards(14.0, 0.0, 1.0, 3.0, 0.1) < 14.0 - 3.0 * 0.1


@pytest.mark.parametrize("gap", [2.5, 3.0, 10.0, 80.0])
@pytest.mark.parametrize("v_leader", [0.0, 6.0, 14.0])
def test_the_insertion_speed_is_the_highest_that_keeps_the_gap(gap: float, v_leader: float) -> None:
    v = insertion_speed(gap, v_leader, 2.6, 4.5, 1.0, 2.5)
    assert v >= 0.0
    assert SUMO.z(v, gap, v_leader) == pytest.approx(1.0)
    assert SUMO.z(v + 0.01, gap, v_leader) > 1.0


def test_no_vehicle_is_inserted_closer_than_the_gap_at_standstill() -> None:
    assert insertion_speed(2.49, 14.0, 2.6, 4.5, 1.0, 2.5) < 0.0
    assert insertion_speed(2.5, 0.0, 2.6, 4.5, 1.0, 2.5) == pytest.approx(0.0, abs=1e-12)
