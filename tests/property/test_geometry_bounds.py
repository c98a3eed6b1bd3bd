"""The bounds of the geometry against the plain way: every body, every place, every gap."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from minisim.fleet import TYPES, Fleet, Vehicles
from minisim.junction.conflicts import CLEARANCE, conflicts, corridors, entry_room, separation
from minisim.junction.geometry import Intersection
from minisim.junction.partings import BEYOND, BRANCH_ROOM, BRANCH_STEP, branch, turning_room
from minisim.junction.paths import Path
from minisim.vehicle import VehicleType
from scenarios.strategies import floats, intersections, vehicles
from tests.builders import share


@st.composite
def fleets(draw: st.DrawFn) -> Fleet:
    """One type, with or without a rear axle, or two ready types."""
    if draw(st.booleans()):
        names = draw(st.lists(st.sampled_from(sorted(TYPES)), min_size=2, max_size=2, unique=True))
        return Fleet(tuple(TYPES[name] for name in names), (0.5, 0.5))
    it = draw(vehicles())
    axle = draw(st.none() | floats(0.4 * it.length, 0.95 * it.length))
    return Fleet((VehicleType(length=it.length, width=it.width, rear_axle=axle),))


CLEARANCES = st.just(CLEARANCE) | st.sampled_from([0.0, 0.2, 1.0, 3.0, 10.0])


@share(0.3)
@given(intersections(), fleets(), CLEARANCES, st.booleans())
def test_conflicts_are_those_of_the_measured_distances(
    intersection: Intersection, fleet: Fleet, clearance: float, by_type: bool
) -> None:
    found = conflicts(intersection, fleet, clearance, by_type)
    assert (found == (separation(intersection, fleet, by_type) <= clearance)).all()


def slow_entry_room(intersection: Intersection, vehicles: Vehicles) -> float:
    """`entry_room`, from the corridors themselves."""
    swept, movements, allowed = (
        corridors(intersection, vehicles),
        intersection.movements,
        intersection.allowed,
    )
    dragging, rooms = any(it.rear_axle for it in vehicles.types), [math.inf]
    for arm in intersection.approaches:
        first = intersection.paths[movements.rows[arm][1]]
        others = swept[allowed & (movements.origins != arm)]
        for it in vehicles.types:
            held = shapely.Polygon(first.bodies(intersection.approach_length, it))
            rooms.append(shapely.distance(others, held).min(initial=math.inf))
        leaving = np.flatnonzero(allowed & (movements.exits == arm))
        if dragging and len(leaving):
            path, far = (
                intersection.paths[leaving[0]],
                2.0 * max(it.length for it in vehicles.types),
            )
            lane = shapely.LineString([path.points[-1], path.points[-1] + far * path.heading_out])
            wide = max(it.width for it in vehicles.types)
            strip = lane.buffer(wide / 2.0, cap_style="flat")
            rooms.append(shapely.distance(swept[allowed & (movements.origins == arm)], strip).min())
    return float(min(rooms))


@share(0.3)
@given(intersections(), fleets())
def test_the_room_at_the_entry_is_that_of_the_corridors(
    intersection: Intersection, fleet: Fleet
) -> None:
    wanted = slow_entry_room(intersection, fleet)
    assert entry_room(intersection, fleet) == pytest.approx(wanted, abs=1e-8)


def slow_branch(intersection: Intersection, vehicles: Vehicles, path: Path, other: Path) -> float:
    """`branch` of two paths, from every place on the first."""
    s = np.arange(path.entry, path.exit + BEYOND, BRANCH_STEP)
    rears = [path.position(s)]
    for it in vehicles.types:
        if it.rear_axle is not None:
            centre, heading = path.pose(s + it.length, it)
            rears.append(centre - heading * (it.length / 2.0))
    gaps = shapely.distance(shapely.points(np.array(rears)), other.line).min(axis=0)
    room = max(it.width for it in vehicles.types) + BRANCH_ROOM
    return float(s[np.flatnonzero(gaps < room)[-1]]) + BRANCH_STEP


@share(0.3)
@given(intersections(), fleets())
def test_branches_are_those_of_every_place(intersection: Intersection, fleet: Fleet) -> None:
    found, paths = branch(intersection, fleet), intersection.paths
    origins = intersection.movements.origins
    for (p, q), at in np.ndenumerate(found):
        if origins[p] != origins[q]:
            assert at == 0.0
        elif p == q:
            assert at == math.inf
        else:
            assert at == slow_branch(intersection, fleet, paths[p], paths[q])


def slow_turning_room(intersection: Intersection, fleet: Fleet) -> float:
    """`turning_room`, from every gap at every place, with bodies as polygons."""
    vehicle, reach, paths = fleet.worst, branch(intersection, fleet), intersection.paths
    gaps, allowed, most = np.arange(0.0, 3.0, 0.1) * vehicle.width, intersection.allowed, 0.0
    for p, q in np.argwhere((reach > 0.0) & allowed & allowed[:, None]).tolist():
        end = min(float(reach[p, q]), paths[p].exit + vehicle.length)
        rear = np.arange(paths[p].entry, end, 0.3)
        ahead = shapely.polygons(paths[p].bodies(rear + vehicle.length, vehicle))
        behind = shapely.polygons(paths[q].bodies(rear - gaps[:, None], vehicle))
        most = max(most, *gaps[shapely.intersects(ahead, behind).any(axis=1)], 0.0)
    return float(most) + 0.1 * vehicle.width


@share(0.15)
@given(intersections(), fleets())
def test_corners_need_the_room_of_every_gap_and_place(
    intersection: Intersection, fleet: Fleet
) -> None:
    assert turning_room(intersection, fleet) == slow_turning_room(intersection, fleet)
