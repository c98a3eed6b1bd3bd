"""Passenger car units."""

from __future__ import annotations

import pytest

from minisim.errors import InputError
from minisim.fleet import fleet_named
from minisim.pcu import UNITS, mean_pcu, pcu_factors
from minisim.vehicle import VehicleType
from scenarios import four_way

CAR = VehicleType()


def test_the_units_of_irc_106_depend_on_the_share() -> None:
    """Table 1: a motorcycle counts 0.5 at 5 % of the traffic and 0.75 at 10 % or more."""
    factors = [
        pcu_factors(fleet_named({"motorcycle": share, "car": 1.0 - share}, CAR), "pcu", 4)[0]
        for share in (0.02, 0.05, 0.075, 0.1, 0.7)
    ]
    assert factors == pytest.approx([0.5, 0.5, 0.625, 0.75, 0.75])
    assert pcu_factors(fleet_named("motorcycle", CAR), "pcu", 4) == (0.75,)
    with pytest.raises(InputError, match="vehicle type in pcu-hcm"):
        pcu_factors(fleet_named("india", CAR), "pcu-hcm", 4)
    for unit, table in UNITS.items():
        assert table["car"] == (1.0, 1.0), unit


def test_a_density_in_passenger_car_units_becomes_vehicles() -> None:
    mix = "car:0.5,bus:0.5"  # 0.5·1 + 0.5·3.7 = 2.35 units a vehicle
    made = four_way(235, unit="pcu", fleet=mix, lane_width=3.5)
    assert made.density == pytest.approx(100.0)
    assert made.demand.split is None
    lanes = "car:1/0.5/1/0.5,bus:0/0.5/0/0.5"
    by_lane = four_way(200, unit="pcu-irc64", fleet=lanes, lane_width=3.5)
    assert mean_pcu(by_lane.vehicles, "pcu-irc64", 4) == (1.0, 2.0, 1.0, 2.0)
    assert by_lane.demand.inflow(4).rates[0] == pytest.approx((200.0, 100.0, 200.0, 100.0))
    with pytest.raises(InputError, match="unit 'pcu' needs a fleet"):
        four_way(200, unit="pcu")


def test_a_type_that_off_tracks_counts_as_much() -> None:
    plain, dragging = (fleet_named(name, CAR) for name in ("india", "india-offtracking"))
    assert pcu_factors(dragging, "pcu", 4) == pcu_factors(plain, "pcu", 4)
