"""Geometry on random junctions: what safety rests on."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st

from minisim.control import Site
from minisim.errors import InputError
from minisim.junction.conflicts import SWEEP_STEP, conflicts, corridor, entry_room
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.junction.partings import branch
from minisim.junction.paths import ARC_SEGMENTS
from minisim.junction.tracing import MIN_PATH_RADIUS
from minisim.vehicle import VehicleType
from scenarios.strategies import bearings, floats, intersections, vehicles
from tests.builders import share


def fits(intersection: Intersection, vehicle: VehicleType) -> bool:
    """Whether the vehicle may be simulated there at all."""
    try:
        Site(intersection, vehicle, 14.0, (100.0,) * intersection.n)
    except InputError:
        return False
    return True


@given(intersections())
def test_paths_are_smooth_and_drivable(intersection: Intersection) -> None:
    for path in intersection.paths:
        assert path.radius >= MIN_PATH_RADIUS - 1e-9
        pieces = np.diff(path.points, axis=0)
        lengths = np.linalg.norm(pieces, axis=1)
        np.testing.assert_allclose(lengths, lengths[0], rtol=1e-6)
        assert lengths.sum() == pytest.approx(path.exit - path.entry, rel=2e-3)
        directions = np.vstack([path.heading_in, pieces / lengths[:, None], path.heading_out])
        turns = np.linalg.norm(np.diff(directions, axis=0), axis=1)
        # 150° at most, spread evenly over 32 pieces: no kink, at the seams half a piece's turn.
        assert turns.max() <= math.radians(150.0) / ARC_SEGMENTS + 1e-6


@given(intersections(), vehicles(), st.data())
def test_corridor_contains_every_body(
    intersection: Intersection, vehicle: VehicleType, data: st.DataObject
) -> None:
    """Between two samples of the sweep, a corner leaves their hull where its bumper turns.

    A bumper that turns by α halfway is d/2·sin(α/2) off the line between its places at the samples,
    d apart; a corner is further out by the body's turn.
    """
    path = data.draw(st.sampled_from(intersection.paths))
    s = data.draw(floats(path.entry, path.exit + vehicle.length))
    body = shapely.polygons(path.bodies(s, vehicle))
    turn = max(SWEEP_STEP / path.radius, math.radians(150.0) / ARC_SEGMENTS)
    off = SWEEP_STEP / 2.0 * math.sin(turn / 2.0) * (1.0 + vehicle.width / vehicle.length)
    assert shapely.contains(shapely.buffer(corridor(path, vehicle), off), body)


@share(0.5)
@given(intersections(), vehicles())
def test_no_vehicle_touches_one_held(intersection: Intersection, vehicle: VehicleType) -> None:
    """Right of way is given to movements, so a held vehicle must be out of the way of all others.

    Cars are at most 6 × 2 m, lanes at least 2.8 m wide. A car takes its width of the lane, and its
    inner side cuts the corner by 2/27·L²/r for a tangent arc of radius r (the offset of the chord
    at the tangent point, largest when a third of the body is past it).
    """
    room = entry_room(intersection, vehicle)
    fronts = intersection.approach_length - np.array([0.0, 3.0])
    arms = range(intersection.n)
    paths = [intersection.path(Movement(arm, 1)) for arm in arms]
    held = [shapely.polygons(path.bodies(fronts, vehicle)) for path in paths]
    for path in intersection.paths:
        swept = corridor(path, vehicle)
        for arm in set(arms) - {path.movement.origin}:
            assert shapely.distance(swept, held[arm]).min() >= room - 1e-9
    tightest = min(path.radius for path in intersection.paths)
    cut = 2.0 / 27.0 * vehicle.length**2 / tightest
    assert room >= intersection.lane_width - vehicle.width - cut - 0.1
    assert room > 0.0


@given(bearings(), floats(2.0, 4.0), floats(0.0, 1.0), floats(3.0, 15.0), floats(1.5, 3.0))
@example((0.0, 72.0, 144.0, 216.0, 288.0), 2.0, 1.0, 6.0, 2.0)
@example((0.0, 60.0, 120.0), 3.2, 1.0, 12.0, 2.5)
def test_a_vehicle_that_does_not_fit_the_lanes_is_refused(
    angles: tuple[float, ...], lane_width: float, shrink: float, length: float, width: float
) -> None:
    """`Site` accepts a vehicle only when no other touches it while it is held."""
    radius = Intersection(angles, lane_width=lane_width).junction_radius * (0.75 + 0.25 * shrink)
    try:
        intersection = Intersection(angles, lane_width=lane_width, junction_radius=radius)
    except InputError:  # tighter than a car can turn
        return
    vehicle = VehicleType(length=length, width=width)
    if width >= lane_width:
        assert not fits(intersection, vehicle)
    assert fits(intersection, vehicle) == (entry_room(intersection, vehicle) > 0.0)


@share(0.5)
@given(intersections(), vehicles(), st.data())
def test_past_the_branch_no_vehicle_on_the_other_path_is_in_the_way(
    intersection: Intersection, vehicle: VehicleType, data: st.DataObject
) -> None:
    """Car following ignores a leader whose rear has passed the branch: they must not touch."""
    origin = data.draw(st.integers(0, intersection.n - 1))
    turns = st.permutations(range(1, intersection.n))
    first, second = (Movement(origin, j) for j in data.draw(turns)[:2])
    leaves = branch(intersection, vehicle)[intersection.index(first), intersection.index(second)]
    path, other = intersection.path(first), intersection.path(second)
    rear = leaves + np.linspace(0.0, 15.0, 20)
    ahead = shapely.polygons(path.bodies(rear + vehicle.length, vehicle))
    fronts = np.linspace(other.entry, other.exit + 30.0, 90)
    behind = shapely.polygons(other.bodies(fronts, vehicle))
    assert shapely.distance(np.array(ahead)[:, None], np.array(behind)[None, :]).min() > 0.25


@share(0.4)
@given(intersections(), vehicles(), floats(0.0, 2.0), floats(0.0, 2.0))
def test_conflicts_grow_with_clearance_and_hold_wherever_paths_merge(
    intersection: Intersection, vehicle: VehicleType, one: float, other: float
) -> None:
    narrow, wide = (conflicts(intersection, vehicle, c) for c in sorted((one, other)))
    assert not (narrow & ~wide).any()
    exits = intersection.movements.exits
    assert narrow[exits[:, None] == exits[None, :]].all()
