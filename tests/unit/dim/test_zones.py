"""Road markings: where the limit holds, and that vehicles can slow down to it."""

from __future__ import annotations

import dataclasses
import itertools

import pytest

from dim import Dim, Zones
from minisim.control import Site
from minisim.errors import InputError
from minisim.junction.roads import Road
from scenarios import FAIR, PAPER, four_way

KMH = 1 / 3.6


def site(speed_limit: float = PAPER.speed_limit, deceleration: float = 2.0) -> Site:
    vehicle = dataclasses.replace(PAPER.vehicle, deceleration=deceleration)
    return Site(four_way().intersection, vehicle, speed_limit, (350.0,) * 4)


def test_the_papers_markings() -> None:
    """From 40 to 20 km/h at 2 m/s² takes 23.15 m (the paper prints 23.14)."""
    slowed = 38 - ((40 * KMH) ** 2 - (20 * KMH) ** 2) / (2 * 2.0)
    assert slowed == pytest.approx(38 - 23.148, abs=1e-3)
    assert [(m.name, m.start, m.end, m.speed) for m in Zones().markings(site())] == [
        ("red", 38, pytest.approx(slowed), None),
        ("red", pytest.approx(slowed), 8, pytest.approx(20 * KMH)),
        ("yellow", 8, 2, pytest.approx(20 * KMH)),
        ("green", 2, 0, pytest.approx(20 * KMH)),
    ]


@pytest.mark.parametrize(
    ("zones", "limit", "deceleration", "names"),
    [
        (Zones(), FAIR.speed_limit, 4.5, "red red yellow green"),
        (Zones(), 14.0, 3.5, "red red yellow green"),
        (Zones(), 40 * KMH, 1.0, "red yellow green"),  # 46 m of braking in a zone of 30 m
        (Zones(red=5), 40 * KMH, 2.0, "red yellow green"),
        (Zones(red=0), 40 * KMH, 2.0, "yellow green"),
        (Zones(red_speed=15.0), 40 * KMH, 2.0, "red yellow green"),  # nothing to slow down for
        (Zones(red_speed=40 * KMH), 40 * KMH, 2.0, "red yellow green"),
    ],
)
def test_markings_join_and_the_limit_holds_from_the_yellow_zone_on(
    zones: Zones, limit: float, deceleration: float, names: str
) -> None:
    markings = zones.markings(site(limit, deceleration))
    assert " ".join(m.name for m in markings) == names
    assert markings[0].start == pytest.approx(zones.red_start)
    assert markings[-1].end == 0
    for one, other in itertools.pairwise(markings):
        assert one.end == other.start
    braking = max(0.0, (limit**2 - zones.red_speed**2) / (2 * deceleration))
    limited = max(zones.red_start - braking, zones.yellow_start)
    for marking in markings:
        assert marking.speed == (zones.red_speed if marking.start < limited + 1e-6 else None)


def test_roads_must_hold_the_zones_before_an_inserted_vehicle() -> None:
    place = site()  # approach lanes of 492.8 m, vehicles of 4 m
    Zones(red=480.7).check(place)
    with pytest.raises(
        InputError, match=r"leaves only 488.8 m .*; arm_length .* at least .*, got 500"
    ):
        Zones(red=481).check(place)


def test_a_held_vehicle_must_stand_in_the_yellow_zone() -> None:
    """It stops up to 0.3 m before the hold line; before the zone, it would wait for ever."""
    with pytest.raises(InputError, match=r"yellow zone \[m\] must be .*0\.5.*got 0\.3"):
        Zones(yellow=0.3)
    signals = four_way(profile="as_run_signals").site()
    Zones(yellow=1.1).check(signals)
    with pytest.raises(InputError, match=r"must be more than 1 with SUMO's vehicles.*got 0\.9"):
        Zones(yellow=0.9).check(signals)


def test_a_road_of_its_own_length_is_named() -> None:
    """Not the length of the others."""
    road = four_way(roads={"b": Road(length=30.0)})
    with pytest.raises(InputError, match=r"; length \[m\] of the road of arm b must be at least 4"):
        Dim().start(road.site(1))
    Dim().start(four_way(roads={"b": Road(length=50.0)}).site(1))
