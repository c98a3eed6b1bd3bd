"""VehicleType: SUMO's passenger car by default, every field checked."""

from __future__ import annotations

import dataclasses

import pytest

from minisim.errors import InputError
from minisim.vehicle import VehicleType


def test_defaults_are_the_passenger_car_of_sumo() -> None:
    """SUMO documentation, "Vehicle Type Parameter Defaults", class passenger."""
    car = VehicleType()
    assert (car.length, car.width, car.min_gap) == (5.0, 1.8, 2.5)
    assert (car.acceleration, car.deceleration, car.max_deceleration) == (2.6, 4.5, 9.0)
    assert car.headway == 1.0


def test_is_a_frozen_value() -> None:
    assert VehicleType(length=4.0) == VehicleType(length=4.0)
    assert hash(VehicleType()) == hash(VehicleType())
    with pytest.raises(dataclasses.FrozenInstanceError):
        VehicleType().length = 4.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("length", 0, "vehicle length"),
        ("width", 5, "vehicle width"),
        ("acceleration", 0, "acceleration .* above 0"),
        ("deceleration", -1, "deceleration"),
        ("headway", -0.1, "headway"),
        ("min_gap", 0, "min_gap"),
        ("exponent", 0.5, "exponent"),
        ("max_deceleration", 7.9, r"max_deceleration must be at least 7\.93"),
        ("speed_deviation", 0.6, "speed_deviation"),
        ("model", "gipps", "car-following model 'gipps'; allowed: idm, iidm, krauss"),
    ],
)
def test_each_field_is_checked(field: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        VehicleType(**{field: value})  # type: ignore[arg-type]


def test_the_brakes_must_do_what_the_law_asks_before_a_standing_obstacle() -> None:
    """k²/b − a = k, the closed form, and a quarter more; with less the follower ran into it."""
    car = VehicleType(length=4.0, min_gap=2.0, deceleration=2.0)
    k = car.needed_braking / 1.25
    assert k * k / car.deceleration - car.acceleration == pytest.approx(k)
    with pytest.raises(InputError, match="the car-following law itself brakes that hard"):
        VehicleType(length=4.0, min_gap=2.0, deceleration=2.0, max_deceleration=2.0)
