"""VehicleType: SUMO's passenger car by default, with brakes that can do what the law asks."""

from __future__ import annotations

import pytest

from minisim.errors import InputError
from minisim.vehicle import VehicleType


def test_defaults_are_the_passenger_car_of_sumo() -> None:
    """SUMO documentation, "Vehicle Type Parameter Defaults", class passenger."""
    car = VehicleType()
    assert (car.length, car.width, car.min_gap) == (5.0, 1.8, 2.5)
    assert (car.acceleration, car.deceleration, car.max_deceleration) == (2.6, 4.5, 9.0)
    assert car.headway == 1.0


def test_the_brakes_must_do_what_the_law_asks_before_a_standing_obstacle() -> None:
    """k²/b − a = k, the closed form, and a quarter more; with less the follower ran into it."""
    car = VehicleType(length=4.0, min_gap=2.0, deceleration=2.0)
    k = car.needed_braking / 1.25
    assert k * k / car.deceleration - car.acceleration == pytest.approx(k)
    with pytest.raises(InputError, match=r"at least 7\.93 m/s².* law itself brakes that hard"):
        VehicleType(max_deceleration=7.9)
    with pytest.raises(InputError, match="the car-following law itself brakes that hard"):
        VehicleType(length=4.0, min_gap=2.0, deceleration=2.0, max_deceleration=2.0)
