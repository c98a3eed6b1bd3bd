"""Where vehicles from different arms come too close to each other.

A corridor is the area that a vehicle's body sweeps on its way through the junction. Two movements
conflict when their corridors come closer than `CLEARANCE`. The corridor of a fleet is that of all
its types together: a short body swings out more in a turn than a long one, which cuts the corner.
In shapes, m is the number of movements, and so of paths. Tables are cached and cannot be written.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from minisim.errors import number
from minisim.fleet import Vehicles
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools
from minisim.junction.paths import Floats, Path
from minisim.junction.sweeps import ROUNDING, SWEEP_STEP, boxed, fronts, least_gap, meeting, sweep
from minisim.vehicle import VehicleType

Shapes = npt.NDArray[np.object_]

#: Room between two corridors that may be used at the same time [m]: twice the static buffer of
#: 0.25 m around each body in Dresner & Stone, JAIR 31 (2008), §3.
CLEARANCE = 0.5

#: Spacing of the bodies tested for clearing distances [m]; half the clearance misses none.
CLEARING_STEP = CLEARANCE / 2.0

#: Spacing of the bodies tested for areas [m].
AREA_STEP = 0.1


class Areas(NamedTuple):
    """Conflict areas of each pair of movements, shape (m, m) each [m], NaN where there is none.

    A body on path p overlaps the part of corridor q inside the junction while its front bumper is
    at an `s` between enter[p, q] and leave[p, q].
    """

    enter: Floats
    leave: Floats


def corridor(path: Path, vehicles: Vehicles) -> shapely.Geometry:
    """The area that bodies sweep from when their front enters until their rear has left [m]."""
    rows = [path.bodies(fronts(path, it), it) for it in vehicles.types]
    pairs = np.concatenate([np.concatenate([it[:-1], it[1:]], axis=1) for it in rows])
    return shapely.union_all(shapely.convex_hull(shapely.multipoints(pairs)))


def bodies(path: Path, fronts: Floats, vehicle: VehicleType) -> Shapes:
    """Bodies on a path with their `fronts` at these `s` [m], as polygons; both have shape (k,)."""
    return np.asarray(shapely.polygons(path.bodies(fronts, vehicle)))


@lru_cache(maxsize=256)
def corridors(intersection: Intersection, vehicles: Vehicles) -> Shapes:
    """The corridors of all movements, prepared for many tests, shape (m,)."""
    return _prepared([corridor(path, vehicles) for path in intersection.paths])


@lru_cache(maxsize=256)
def separation(intersection: Intersection, vehicles: Vehicles, by_type: bool = False) -> Floats:
    """Distance [m] between the corridors of each pair of movements, shape (m, m).

    0 where they overlap, and between movements from the same arm, which begin together. If
    `by_type`, rows and columns are types and movements, shape (types·m, types·m): all movements of
    the first type, then those of the second.
    """
    kinds: tuple[Vehicles, ...] = vehicles.types if by_type else (vehicles,)
    swept = np.concatenate([corridors(intersection, it) for it in kinds])
    apart = np.tile(intersection.movements.apart, (len(kinds), len(kinds)))
    i, j = np.nonzero(np.triu(apart))
    result = np.zeros(apart.shape)
    result[i, j] = result[j, i] = shapely.distance(swept[i], swept[j])
    return _fixed(result)


def conflicts(
    intersection: Intersection, vehicles: Vehicles, clearance: float = CLEARANCE,
    by_type: bool = False,
) -> Bools:  # fmt: skip
    """Whether two movements come within `clearance` [m]; symmetric, with the shape of `separation`.

    Movements from the same arm always do. Raises `InputError` for a clearance that is not 0 … 10 m.
    """
    clearance = number("clearance [m]", clearance, low=0, high=10)
    return _conflicts(intersection, vehicles, clearance, by_type)


@lru_cache(maxsize=256)
def _conflicts(
    intersection: Intersection, vehicles: Vehicles, clearance: float, by_type: bool
) -> Bools:
    kinds: tuple[Vehicles, ...] = vehicles.types if by_type else (vehicles,)
    m, apart = len(intersection.paths), intersection.movements.apart
    result = ~np.tile(apart, (len(kinds), len(kinds)))
    pairs = np.argwhere(np.triu(~result))
    near, sure = meeting(intersection, kinds, clearance, pairs)
    for k in np.flatnonzero(~sure).tolist():
        rows = pairs[k].tolist()
        swept = _prepared([corridor(intersection.paths[r % m], kinds[r // m]) for r in rows])
        near[k] = shapely.distance(*swept) <= clearance
    i, j = pairs[near].T
    result[i, j] = result[j, i] = True
    result.setflags(write=False)
    return result


@lru_cache(maxsize=256)
def entry_room(intersection: Intersection, vehicles: Vehicles) -> float:
    """Smallest distance [m] between a vehicle held at its entry and a corridor of another arm.

    0 means that the vehicle does not fit the lanes: when turning into an exit lane, it would touch
    a vehicle waiting beside that lane. A vehicle with a `rear_axle` must not touch those that leave
    beside its own approach lane either: its overhang swings out. How far such a body stands off its
    lane only falls beyond the exit, so farther out it touches none either.
    """
    movements, allowed, arms = intersection.movements, intersection.allowed, intersection.approaches
    firsts = [intersection.paths[movements.rows[arm][1]] for arm in arms]
    held = np.array([
        [path.bodies(intersection.approach_length, it) for path in firsts] for it in vehicles.types
    ]).reshape(-1, 4, 2)  # fmt: skip
    others = allowed[:, None] & (movements.origins[:, None] != np.tile(arms, len(vehicles.types)))
    room = _least_gap(intersection, vehicles, held, others)
    if any(it.rear_axle is not None for it in vehicles.types):
        strips, own = zip(*(_tail(intersection, vehicles, arm) for arm in arms), strict=True)
        room = min(room, _least_gap(intersection, vehicles, np.array(strips), np.array(own).T))
    return room if room > ROUNDING else 0.0


def _least_gap(
    intersection: Intersection, vehicles: Vehicles, shapes: Floats, which: Bools
) -> float:
    """Smallest distance [m] between corridors and convex shapes, of the pairs in `which`."""
    sweeps, others = [sweep(intersection, it) for it in vehicles.types], boxed(shapes)
    return min(least_gap(it.hulls, others, *np.nonzero(which[it.path[it.first]])) for it in sweeps)


def _tail(intersection: Intersection, vehicles: Vehicles, arm: int) -> tuple[Floats, Bools]:
    """Where bodies leave by an arm, as the corners of a strip, and which movements begin there."""
    movements, allowed = intersection.movements, intersection.allowed
    leaving = np.flatnonzero(allowed & (movements.exits == arm))
    path = intersection.paths[leaving[0] if len(leaving) else 0]
    far, wide = (
        2.0 * max(it.length for it in vehicles.types),
        max(it.width for it in vehicles.types),
    )
    across = np.array([-path.heading_out[1], path.heading_out[0]]) * wide / 2.0
    near, end = path.points[-1], path.points[-1] + far * path.heading_out
    own = allowed & (movements.origins == arm) & bool(len(leaving))
    return np.array([near + across, near - across, end - across, end + across]), own


@lru_cache(maxsize=256)
def conflict_zones(
    intersection: Intersection, vehicle: VehicleType, others: Vehicles | None = None
) -> Floats:
    """The conflict zones of all movements, shape (m, m, 2) [m], NaN where two do not conflict.

    `others` are the vehicles on the other paths, by default of the same type. A vehicle on path p
    comes closer than `CLEARANCE` to corridor q only while its front bumper is between `[p, q, 0]`
    and `[p, q, 1]` past the junction entry. Every zone ends when the rear has
    left the junction. Two vehicles can touch only when both are in their zones.

    A zone reaches one tested body beyond the first and the last that are too close. If none is too
    close, but the corridors are in between, the zone is the whole crossing.
    """
    ends = [path.crossing + vehicle.length for path in intersection.paths]
    past = [np.linspace(0.0, end, math.ceil(end / SWEEP_STEP) + 1) for end in ends]
    fronts = [intersection.approach_length + s for s in past]
    others = others or vehicle
    pairs, swept = _rivals(intersection, others), corridors(intersection, others)
    zones = np.full((*pairs.shape, 2), np.nan)
    for p, q, near in _reaching(intersection, vehicle, fronts, swept, pairs, CLEARANCE):
        s = past[p]
        first, last = (near[0] - 1, near[-1] + 1) if len(near) else (0, len(s))
        zones[p, q] = s[max(first, 0)], s[min(last, len(s) - 1)]
    return _fixed(zones)


@lru_cache(maxsize=256)
def clearing_distances(
    intersection: Intersection, vehicle: VehicleType, others: Vehicles | None = None
) -> Floats:
    """How far past the entry a front bumper is when its vehicle has cleared another's way [m].

    The shape is (m, m); `others` are the vehicles on the other paths, by default of the same type.

    `[p, q]`: from here on, the body of a vehicle on movement q keeps `CLEARANCE` from the corridor
    of movement p. Minus infinity if the two do not conflict; infinite if that takes until the
    rear has left the junction, as when both use the same exit lane.
    """
    others = others or vehicle
    ways = _prepared(shapely.buffer(corridors(intersection, others), CLEARANCE))
    ends = [path.crossing + vehicle.length for path in intersection.paths]
    past = [np.append(np.arange(0.0, end, CLEARING_STEP), end) for end in ends]
    fronts = [intersection.approach_length + s for s in past]
    pairs = _rivals(intersection, others)
    distances = np.full(pairs.shape, -math.inf)
    for q, p, near in _reaching(intersection, vehicle, fronts, ways, pairs):
        s = past[q]
        last = near[-1] if len(near) else len(s)
        distances[p, q] = s[last + 1] if last + 2 < len(s) else math.inf
    return _fixed(distances)


@lru_cache(maxsize=256)
def conflict_areas(
    intersection: Intersection, vehicle: VehicleType, others: Vehicles | None = None
) -> Areas:
    """Where on its path a vehicle blocks another movement inside the junction.

    `others` are the vehicles on the other paths, by default of the same type.
    """
    others = others or vehicle
    paths = intersection.paths
    fronts = [np.arange(path.entry, path.exit + vehicle.length, AREA_STEP) for path in paths]
    swept = corridors(intersection, others)
    inside = _prepared([_until_exit(path, swept[p]) for p, path in enumerate(paths)])
    pairs = (separation(intersection, others) <= 0.0) & intersection.movements.apart
    enter, leave = np.full((2, *pairs.shape), np.nan)
    for p, q, near in _reaching(intersection, vehicle, fronts, inside, pairs):
        if len(near):
            enter[p, q], leave[p, q] = fronts[p][near[[0, -1]]]
    both = np.isfinite(enter) & np.isfinite(enter.T)
    return Areas(*(_fixed(np.where(both, table, np.nan)) for table in (enter, leave)))


def _rivals(intersection: Intersection, vehicles: Vehicles) -> Bools:
    """Whether two movements conflict and come from different arms."""
    return conflicts(intersection, vehicles) & intersection.movements.apart


def _reaching(
    intersection: Intersection, vehicle: VehicleType, fronts: Sequence[Floats], areas: Shapes,
    pairs: Bools, room: float = 0.0,
) -> Iterator[tuple[int, int, npt.NDArray[np.intp]]]:  # fmt: skip
    """For each of `pairs` (p, q): indices of the fronts where a body on path p is near area q."""
    for p in np.flatnonzero(pairs.any(axis=1)).tolist():
        shapes = bodies(intersection.paths[p], fronts[p], vehicle)
        for q in np.flatnonzero(pairs[p]).tolist():
            if room > 0.0:
                near = shapely.dwithin(areas[q], shapes, room)
            else:
                near = shapely.intersects(areas[q], shapes)  # several times faster
            yield p, q, np.flatnonzero(near)


def _until_exit(path: Path, swept: shapely.Geometry) -> shapely.Geometry:
    """The part of a corridor before the exit line; beyond it, vehicles follow each other."""
    ahead = 1000.0 * path.heading_out
    across = np.array([-ahead[1], ahead[0]])
    beyond = shapely.Polygon(path.points[-1] + [across, across + ahead, ahead - across, -across])
    return shapely.difference(swept, beyond)


def _prepared(shapes: Sequence[shapely.Geometry] | Shapes) -> Shapes:
    result = np.array(shapes)
    shapely.prepare(result)
    return result


def _fixed(table: Floats) -> Floats:
    table.setflags(write=False)
    return table
