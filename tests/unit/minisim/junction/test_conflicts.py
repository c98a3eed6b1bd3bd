"""Corridors, zones, clearing distances and areas against closed forms and finer searches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import assume, given

from minisim.junction.conflicts import (
    AREA_STEP,
    CLEARANCE,
    bodies,
    clearing_distances,
    conflict_areas,
    conflict_zones,
    conflicts,
    corridor,
    entry_room,
    separation,
)
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.strategies import floats, intersections
from tests.builders import share

CAR = VehicleType()
SQUARE = (0.0, 90.0, 180.0, 270.0)
ODD = (10.0, 80.0, 190.5, 260.0, 300.0)
SITE = four_way(100, profile="fair").site(1)
JUNCTION = SITE.intersection
ENTRY = JUNCTION.approach_length


def test_turning_the_whole_junction_changes_nothing_but_the_view() -> None:
    first, turned = (Intersection(tuple(b + by for b in ODD)) for by in (0.0, 20.0))
    np.testing.assert_allclose(separation(turned, CAR), separation(first, CAR), atol=1e-9)


def test_corridor_of_a_straight_movement_is_a_rectangle() -> None:
    swept = corridor(Intersection(SQUARE).path(Movement(0, 2)), CAR)
    # From the rear at the entry's front to the front when the rear leaves: 14.4 + 2 · 5 m.
    assert shapely.area(swept) == pytest.approx((14.4 + 2 * 5.0) * 1.8)
    assert shapely.bounds(swept) == pytest.approx((1.6 - 0.9, -12.2, 1.6 + 0.9, 12.2))


def test_opposite_straight_corridors_are_a_lane_minus_a_body_apart() -> None:
    four = Intersection(SQUARE)
    apart = separation(four, CAR)
    a2, c2 = four.index(Movement(0, 2)), four.index(Movement(2, 2))
    assert apart[a2, c2] == pytest.approx(3.2 - 1.8)
    assert conflicts(four, CAR, 1.39)[a2, c2] == np.False_
    assert conflicts(four, CAR, 1.41)[a2, c2] == np.True_


@pytest.mark.parametrize("side", ["left", "right"])
def test_room_beside_a_held_vehicle(side: str) -> None:
    """Straight traffic passes at a lane minus a body; a vehicle that turns in cuts the corner."""
    square = Intersection(SQUARE, side=side)  # type: ignore[arg-type]
    assert 1.0 < entry_room(square, CAR) < 3.2 - 1.8
    bus = VehicleType(length=12.0, width=2.5)
    assert entry_room(square, bus) == 0.0


def test_zones_of_two_straight_paths() -> None:
    """Perpendicular corridors of width w, c apart: body within w/2 + c of the other's centre line.

    a2 drives south 1.6 m east of the centre, b2 west 1.6 m south of it: they cross
    7.2 + 1.6 = 8.8 m past the entry of a2, 7.2 − 1.6 = 5.6 m past that of b2.
    """
    zones = conflict_zones(JUNCTION, SITE.vehicle)
    half, length = SITE.vehicle.width / 2.0 + 0.5, SITE.vehicle.length
    for p, q, centre in ((1, 4, 8.8), (4, 1, 5.6)):
        first, last = zones[p, q]
        assert centre - half - 1.0 <= first <= centre - half
        assert centre + half + length <= last <= centre + half + length + 1.0


def test_zones_of_merging_paths_end_where_the_rear_has_left() -> None:
    b1, a2 = JUNCTION.index("b1"), JUNCTION.index("a2")  # both leave to the south
    for p, q in ((b1, a2), (a2, b1)):
        last = JUNCTION.paths[p].crossing + SITE.vehicle.length
        assert conflict_zones(JUNCTION, SITE.vehicle)[p, q, 1] == pytest.approx(last)


def test_a_vehicle_is_in_the_way_until_its_body_has_left_it() -> None:
    """Every pair of movements, against a much finer search."""
    clearing = clearing_distances(JUNCTION, SITE.vehicle)
    paths = JUNCTION.paths
    assert np.array_equal(clearing > -np.inf, SITE.conflicts)
    checked = 0
    for p, q in np.argwhere(np.isfinite(clearing)).tolist():
        swept = corridor(paths[p], SITE.vehicle)
        last = paths[q].crossing + SITE.vehicle.length
        after = np.arange(clearing[p, q], last, 0.02)
        bodies = shapely.polygons(paths[q].bodies(paths[q].entry + after, SITE.vehicle))
        assert shapely.distance(swept, bodies).min() > CLEARANCE - 0.01
        before = paths[q].bodies(paths[q].entry + clearing[p, q] - 0.3, SITE.vehicle)
        assert shapely.distance(swept, shapely.polygons(before)) < CLEARANCE + 0.01
        checked += 1
    assert checked > 20


def test_a_vehicle_that_leaves_by_the_same_arm_is_in_the_way_until_it_is_out() -> None:
    clearing, movements = clearing_distances(JUNCTION, SITE.vehicle), JUNCTION.movements
    merging = (movements.exits[:, None] == movements.exits) & movements.apart
    assert np.isinf(clearing[merging]).all()


def test_the_conflict_area_of_two_straight_movements() -> None:
    """a2 drives south at x = 1.6 ± 0.9; b2 drives west at y = −1.6 ± 0.9."""
    areas = conflict_areas(JUNCTION, SITE.vehicle)
    a2, b2 = map(JUNCTION.index, ("a2", "b2"))
    # a2's front reaches y = −0.7 after 7.2 + 0.7 m; its rear leaves y = −2.5 after 7.2 + 2.5 + 5.
    assert areas.enter[a2, b2] - ENTRY == pytest.approx(7.9, abs=AREA_STEP)
    assert areas.leave[a2, b2] - ENTRY == pytest.approx(14.7, abs=AREA_STEP)
    # b2's front reaches x = 2.5 after 7.2 − 2.5 m; its rear leaves x = 0.7 after 7.2 − 0.7 + 5.
    assert areas.enter[b2, a2] - ENTRY == pytest.approx(4.7, abs=AREA_STEP)
    assert areas.leave[b2, a2] - ENTRY == pytest.approx(11.5, abs=AREA_STEP)


def test_conflict_areas_of_merging_movements_end_at_the_exit_line() -> None:
    leave = conflict_areas(JUNCTION, SITE.vehicle).leave
    a1, d2 = map(JUNCTION.index, ("a1", "d2"))
    for p, q in ((a1, d2), (d2, a1)):
        clear = JUNCTION.paths[p].exit + SITE.vehicle.length
        assert leave[p, q] == pytest.approx(clear, abs=2 * AREA_STEP)


def test_movements_that_never_meet_have_no_conflict_area() -> None:
    enter, leave = conflict_areas(JUNCTION, SITE.vehicle)
    inside = np.isfinite(enter)
    assert inside.sum() > 20
    assert not inside[~SITE.conflicts].any()
    assert (inside == inside.T).all()
    assert (inside == np.isfinite(leave)).all()
    assert (leave[inside] > enter[inside]).all()


@share(0.3)
@given(intersections(), floats(2.0, 12.0), floats(0.4, 1.0))
def test_a_body_that_fits_stays_beside_its_neighbours_beyond_the_exit(
    junction: Intersection, length: float, axle: float
) -> None:
    """`entry_room` looks at a vehicle that waits at the line; farther out there may be others."""
    it = VehicleType(length=length, width=2.0, rear_axle=axle * length)
    assume(entry_room(junction, it) > 0.0)
    for path, movement in zip(junction.paths, junction.movements, strict=True):
        waits = junction.paths[junction.movements.rows[path.exit_arm][1]]
        queue = bodies(waits, waits.entry - np.arange(0.0, 60.0, it.length / 3.0), it)
        leaving = bodies(path, path.exit + np.arange(0.0, 50.0, 0.5), it)
        assert not shapely.intersects(leaving[:, None], queue).any(), movement


def test_a_long_overhang_that_swings_into_the_next_lane_does_not_fit() -> None:
    wide = Intersection((0, 90, 180, 270), lane_width=3.0, junction_radius=20.0)
    bus = VehicleType(length=12.0, width=2.5)
    assert entry_room(wide, replace(bus, rear_axle=11.0)) == 0.0, "its rear cuts the corner"
    assert entry_room(wide, replace(bus, length=9.0, rear_axle=2.0)) == 0.0, "its tail swings out"
    assert entry_room(wide, replace(bus, length=9.0)) > 0.0
