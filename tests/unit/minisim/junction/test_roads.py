"""Roads that differ: lengths, widths, one-way traffic and forbidden movements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from minisim.control import Site
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.junction.roads import Road
from minisim.junction.tracing import MIN_PATH_RADIUS
from minisim.vehicle import VehicleType
from scenarios import four_way, from_bearings

SQUARE = (0.0, 90.0, 180.0, 270.0)


def square(**options: Any) -> Intersection:
    return Intersection(SQUARE, **options)


def test_roads_like_all_others_are_no_roads() -> None:
    assert square(roads=(Road(),) * 4) == square()


def test_one_way_roads_and_forbidden_movements_are_not_allowed() -> None:
    roads = (Road(), Road(traffic="in"), Road(), Road(traffic="out"))
    one_way = square(roads=roads, forbidden=("c3", "a2"))
    names = np.array(one_way.movements.names)
    assert names[one_way.allowed].tolist() == ["a3", "b1", "b2", "b3", "c1", "c2"]
    assert one_way.approaches == (0, 1, 2)
    assert one_way.departures == (0, 2, 3)
    assert one_way.forbidden == ("a2", "c3")  # in the order of movements


def test_a_shorter_road_begins_later_and_ends_sooner() -> None:
    roads = (Road(length=120.0), Road(), Road(), Road())
    short, usual = square(roads=roads), square()
    assert short.approach_length == usual.approach_length
    assert short.shortest_approach == pytest.approx(120.0 - 7.2)
    for path, other in zip(short.paths, usual.paths, strict=True):
        assert path.entry == other.entry
        assert path.start == pytest.approx(380.0 if path.movement.origin == 0 else 0.0)
        lost = other.length - path.length
        assert lost == pytest.approx(380.0 if path.exit_arm == 0 else 0.0)
        assert (path.points == other.points).all()


def test_the_only_lane_of_a_one_way_road_is_on_its_axis() -> None:
    roads = (Road(traffic="in", lane_width=4.0), Road(), Road(), Road())
    into = square(roads=roads).path(square().parse("a2"))
    assert into.position(into.entry) == pytest.approx(np.array([0.0, 7.2]))
    assert into.position(into.exit)[0] == pytest.approx(1.6)  # left-hand traffic, southwards
    assert into.radius == pytest.approx(14.4**2 / 6.0 / 1.6, rel=0.03)


def test_wider_lanes_move_the_entries_and_the_kerb() -> None:
    roads = (Road(lane_width=4.0), Road(), Road(), Road())
    wide = square(roads=roads)
    assert wide.junction_radius == pytest.approx(4.0 + 4.0)
    assert wide.path(wide.parse("a1")).position(wide.approach_length)[0] == pytest.approx(2.0)


def test_only_allowed_movements_need_a_wide_enough_path() -> None:
    close = {"bearings": (0.0, 40.0, 180.0), "junction_radius": 10.0}
    with pytest.raises(InputError, match="leaves a path of radius"):
        Intersection(**close)
    sharp = Intersection(**close, forbidden=("a1", "b2"))
    radii = np.array([path.radius for path in sharp.paths])
    assert radii[sharp.allowed].min() >= MIN_PATH_RADIUS


def test_paths_are_tangent_to_their_lanes_whatever_the_roads() -> None:
    roads = (Road(lane_width=2.8), Road(traffic="in"), Road(lane_width=4.0), Road(traffic="out"))
    for side in ("left", "right"):
        mixed = Intersection((0.0, 75.0, 182.0, 260.0), side=side, roads=roads)  # type: ignore[arg-type]
        for path in mixed.paths:
            near = path.position([path.entry - 1.0, path.entry, path.entry + 0.05])
            far = path.position([path.exit - 0.05, path.exit, path.exit + 1.0])
            for a, b, c in (near, far):
                first, second = (b - a) / np.linalg.norm(b - a), (c - b) / np.linalg.norm(c - b)
                assert float(first @ second) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"roads": (Road(),) * 2 + (Road(length=50.0),)}, "one Road per arm, 4, got 3"),
        ({"roads": (1, 2, 3, 4)}, r"roads\[0\] must be a Road, got 1"),
        ({"forbidden": ("a4",)}, "no movement 'a4'"),
        ({"roads": (Road(traffic="in"),) * 4}, "no movement is allowed"),
        ({"roads": (Road(length=20.0), *(Road(),) * 3), "junction_radius": 11.0},
         r"junction_radius \[m\] must be above 0 and below 10"),
    ],
)  # fmt: skip
def test_bad_roads_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        square(**options)


def test_a_road_says_what_is_wrong_with_it() -> None:
    with pytest.raises(InputError, match=r"unknown traffic 'inn'; allowed: both, in, out"):
        Road(traffic="inn")
    with pytest.raises(InputError, match=r"length \[m\] must be at least 20"):
        Road(length=3.0)


def test_a_site_knows_each_roads_limit_and_the_highest() -> None:
    roads = (Road(speed_limit=8.0), Road(), Road(speed_limit=20.0), Road())
    site = Site(square(roads=roads), VehicleType(), 14.0, (100.0,) * 4)
    assert [site.limit(arm) for arm in range(4)] == [8.0, 14.0, 20.0, 14.0]
    assert site.speed_limit == 20.0
    assert four_way().site().limits == ()


def test_demand_keeps_to_allowed_movements() -> None:
    roads = {"b": Road(traffic="in"), "d": Road(traffic="out")}
    scenario = from_bearings(SQUARE, 200.0, roads=roads, forbidden=("a2",), horizon=3600.0)
    assert scenario.rates == (200.0, 200.0, 200.0, 0.0)
    arrivals = scenario.arrivals(1)
    taken = scenario.intersection.movements.index_of[arrivals.lane, arrivals.manoeuvre]
    assert set(taken.tolist()) == set(np.flatnonzero(scenario.intersection.allowed).tolist())
    with pytest.raises(InputError, match="split gives lane d a share"):
        from_bearings(SQUARE, 200.0, roads=roads, split="1:1:1:1")
    with pytest.raises(InputError, match="turns leave lane b none of the manoeuvres"):
        from_bearings(SQUARE, 200.0, forbidden=("b2",), turns="0:1:0").arrivals(1)
    with pytest.raises(InputError, match="unknown arm in roads 'e'"):
        from_bearings(SQUARE, roads={"e": Road()})
    with pytest.raises(InputError, match="takes a2, which is forbidden here"):
        from_bearings(SQUARE, forbidden=("a2",), recorded=four_way().arrivals(1))
