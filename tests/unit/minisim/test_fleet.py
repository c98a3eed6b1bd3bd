"""Fleets: shares and ready types."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from minisim.demand import Demand
from minisim.errors import InputError
from minisim.fleet import MIXES, TYPES, Fleet, fleet_named
from minisim.vehicle import CruiseVehicle, VehicleType
from scenarios import four_way

CAR = VehicleType()


def test_shares_are_given_as_a_table_a_text_or_a_name() -> None:
    made = fleet_named({"car": 0.9, "bus": 0.1}, CAR)
    assert made.names == ("car", "bus")
    assert made.of_lane(3) == (0.9, 0.1)
    assert fleet_named("car:0.9, bus:0.1", CAR) == made
    assert fleet_named(str(made), CAR) == made
    assert fleet_named("india", CAR).names == tuple(MIXES["india"])
    assert fleet_named("truck", CAR).types == (TYPES["truck"],)
    assert fleet_named(CAR, CAR) == Fleet((CAR,))


def test_shares_may_differ_by_lane() -> None:
    made = fleet_named("car:1/0.5/1/0.5,bus:0/0.5/0/0.5", CAR)
    assert [made.of_lane(lane) for lane in range(2)] == [(1.0, 0.0), (0.5, 0.5)]
    assert str(made) == "car:1/0.5/1/0.5,bus:0/0.5/0/0.5"
    lane, rank = np.repeat(range(4), 50), np.tile(range(50), 4)
    drawn = made.drawn(lane, rank, seed=1)
    assert not drawn[(lane == 0) | (lane == 2)].any()
    with pytest.raises(InputError, match="shares for 4 lanes, the junction has 3"):
        made.check(3)


def test_the_law_of_the_profile_drives_every_type() -> None:
    krauss = replace(CAR, model="krauss")
    assert {it.model for it in fleet_named("india", krauss).types} == {"krauss"}


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("car:0.9,bus:0.2", r"shares must sum to 1, got 1.1 \(car: 0.9, bus: 0.2\)"),
        ("car:0.5,car:0.5", "names a vehicle type twice"),
        ("car:0.5,buss:0.5", "unknown vehicle type 'buss'.*did you mean 'bus'"),
        ("indai", "unknown fleet 'indai'.*did you mean 'india'"),
        ("car:half,bus:0.5", "fleet must be shares of vehicle types such as"),
        ("car=0.5,bus=0.5", "fleet must be a mix or type by name, or shares .* such as car:0.8"),
        ({"car": 1.5, "bus": -0.5}, "share of a type must be"),
        ({}, "fleet must be shares"),
        ("car:1/0.5,bus:0/0.4", r"shares on lane b must sum to 1, got 0.9"),
        ("car:1/0.5/1,bus:0/0.5", "a number per lane"),
    ],
)
def test_wrong_shares_are_refused_in_one_sentence(value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fleet_named(value, CAR)


def test_what_cannot_be_mixed_is_refused() -> None:
    with pytest.raises(InputError, match="needs the profile paper or fair"):
        fleet_named("india", CruiseVehicle())
    with pytest.raises(InputError, match="same car-following model"):
        Fleet((CAR, VehicleType(name="other", model="krauss")), ((0.5,), (0.5,)))
    with pytest.raises(InputError, match="cannot be mixed"):
        Fleet((CruiseVehicle(), CruiseVehicle(name="b")), ((0.5,), (0.5,)))
    with pytest.raises(InputError, match="stands for two types"):
        Fleet((CAR, CAR), ((0.5,), (0.5,)))
    with pytest.raises(InputError, match=r"10.1 × 2.43 m \(bus\) do not fit lanes of 3.2 m"):
        four_way(fleet="india").site()


def test_the_worst_vehicle_is_as_bad_as_each_type_in_every_respect() -> None:
    fleet = fleet_named({name: 1.0 / len(TYPES) for name in TYPES}, CAR)
    for it in fleet.types:
        assert fleet.worst.length >= it.length
        assert fleet.worst.width >= it.width
        assert fleet.worst.deceleration <= it.deceleration
        assert fleet.worst.max_deceleration <= it.max_deceleration
    assert Fleet((CAR,)).worst is CAR


def test_types_are_drawn_by_lane_and_rank_in_the_given_shares() -> None:
    fleet = fleet_named("india", CAR)
    arrivals = Demand(density=1000.0).draw(4, 36_000.0, seed=1)
    drawn = fleet.drawn(arrivals.lane, arrivals.rank, seed=1)
    counts = np.bincount(drawn, minlength=len(fleet.types))
    wanted = np.array(fleet.of_lane(0)) * len(drawn)
    assert ((counts - wanted) ** 2 / wanted).sum() < 13.3  # χ² of 4 degrees of freedom, 1 %
    fewer = arrivals.lane == 2  # alone, a lane's vehicles have the same types
    alone = fleet.drawn(arrivals.lane[fewer], arrivals.rank[fewer], seed=1)
    assert (alone == drawn[fewer]).all()


def test_ready_types_that_off_track_are_the_same_vehicles_with_a_rear_axle() -> None:
    """AASHTO's design vehicles P, SU and CITY-BUS: 14 of 19, 24 of 30 and 32 of 40 feet."""
    for name, share in (("car", 14 / 19), ("truck", 0.8), ("bus", 0.8), ("sumo-bus", 0.8)):
        plain, dragging = TYPES[name], TYPES[f"{name}-offtracking"]
        assert dragging == replace(plain, name=dragging.name, rear_axle=dragging.rear_axle)
        assert dragging.rear_axle == pytest.approx(share * plain.length, abs=0.005)
    assert not {f"{name}-offtracking" for name in ("motorcycle", "sumo-trailer")} & set(TYPES)
    plain, dragging = (fleet_named(name, CAR) for name in ("india", "india-offtracking"))
    assert plain.shares == dragging.shares
    assert plain.worst.rear_axle is None
    assert dragging.worst.rear_axle == TYPES["bus-offtracking"].rear_axle


def test_a_bus_that_off_tracks_needs_a_larger_junction() -> None:
    four_way(fleet="bus", lane_width=3.5).site()
    with pytest.raises(InputError, match=r"\(bus-offtracking\) do not fit lanes of 3.5 m"):
        four_way(fleet="bus-offtracking", lane_width=3.5).site()
    arms = four_way().intersection
    wide = replace(arms, lane_width=3.5, junction_radius=22.0)
    replace(four_way(fleet="bus-offtracking"), intersection=wide).site()
