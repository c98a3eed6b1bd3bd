"""How vehicles come onto the roads."""

from __future__ import annotations

import pytest

from baselines import AllWayStop, FixedTime
from minisim.simulation import simulate
from minisim.testing import small_scenario
from minisim.vehicle import VehicleType


def test_a_departure_speed_above_a_drivers_own_is_capped_and_shuts_no_lane() -> None:
    """Each driver whose factor is below 10/14 would have kept its lane shut for ever."""
    slow = VehicleType(speed_deviation=0.3)
    scenario = small_scenario(4, density=400, demand_time=200, depart_speed=10.0, vehicle=slow)
    columns = simulate(scenario, FixedTime(), seed=1).columns
    assert columns.departed[columns.demand_time < 190.0].all()


@pytest.mark.parametrize("speed", [5.0, 11.1, 14.0])
def test_a_departure_speed_too_high_for_a_short_arm_is_capped(speed: float) -> None:
    """Before a closed line, brakes of 2 m/s² allow 10.5 m/s: no faster one was ever inserted."""
    gentle = VehicleType(deceleration=2.0)
    scenario = small_scenario(
        4, density=150.0, demand_time=100.0, drain=200.0, arm_length=40.0, depart_speed=speed,
        vehicle=gentle,
    )  # fmt: skip
    run = simulate(scenario, AllWayStop(), seed=1, record="all")
    assert run.columns.arrived.all()
    first = run.trajectories.groupby("vehicle")["speed_mps"].first()
    assert first.max() <= speed + 0.3


def test_a_vehicle_enters_at_the_departure_speed_where_nothing_is_in_its_way() -> None:
    scenario = small_scenario(4, density=20.0, demand_time=100.0, depart_speed=6.0)
    first = simulate(scenario, AllWayStop(), seed=1, record="all").trajectories.groupby("vehicle")
    assert len(first) > 0
    assert first["speed_mps"].first().tolist() == pytest.approx([6.0 + 0.26] * len(first), abs=0.1)
