"""Where vehicles of different arms come too near each other: corridors, and the stretches of paths.

A corridor is what a vehicle's body sweeps on its way through the junction. Two movements conflict
where their corridors come closer than `CLEARANCE`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, wraps
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import numpy as np
import numpy.typing as npt
import shapely

from minisim.errors import number
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools
from minisim.junction.paths import Floats, Path, Size
from minisim.vehicle import VehicleType

Shapes = npt.NDArray[np.object_]

_P = ParamSpec("_P")
_R = TypeVar("_R")

#: Room kept between two corridors that may be driven at once [m]: the static buffer of 0.25 m
#: around each body in Dresner & Stone, JAIR 31 (2008), §3.
CLEARANCE = 0.5

#: Spacing of the bodies whose hulls make a corridor, and of those tested for zones [m].
SWEEP_STEP = 0.5

#: Spacing of the bodies tested for clearing distances [m]: half the clearance misses none.
CLEARING_STEP = CLEARANCE / 2.0

#: Spacing of the bodies tested for areas [m].
AREA_STEP = 0.1


def by_size(
    kept: int,
) -> Callable[
    [Callable[Concatenate[Intersection, Size, _P], _R]],
    Callable[Concatenate[Intersection, VehicleType | Size, _P], _R],
]:
    """Keep that many results of a function of a junction and the size of a vehicle."""

    def decorate(function: Any) -> Any:
        known = lru_cache(maxsize=kept)(function)

        @wraps(function)
        def look_up(intersection: Intersection, vehicle: VehicleType | Size, *more: Any) -> Any:
            return known(intersection, Size(vehicle.length, vehicle.width), *more)

        return look_up

    return decorate


class Areas(NamedTuple):
    """Conflict areas of every two movements, shape (m, m) each [m], NaN where there is none.

    While its front bumper is at `s` in (enter[p, q], leave[p, q]), a body on path p reaches into
    what bodies on path q sweep inside the junction.
    """

    enter: Floats
    leave: Floats


def corridor(path: Path, vehicle: VehicleType | Size) -> shapely.Geometry:
    """The area that the body sweeps from the front's entry to the rear's exit."""
    first, last = path.entry, path.exit + vehicle.length
    count = math.ceil((last - first) / SWEEP_STEP) + 1
    corners = path.bodies(np.linspace(first, last, count), vehicle)
    pairs = np.concatenate([corners[:-1], corners[1:]], axis=1)
    return shapely.union_all(shapely.convex_hull(shapely.multipoints(pairs)))


def bodies(path: Path, fronts: Floats, vehicle: VehicleType | Size) -> Shapes:
    """The bodies on a path whose fronts are at these `s`, shape (fronts,)."""
    return np.asarray(shapely.polygons(path.bodies(fronts, vehicle)))


@by_size(256)
def corridors(intersection: Intersection, vehicle: Size) -> Shapes:
    """The corridors of all movements, prepared for many tests, shape (m,)."""
    return _prepared([corridor(path, vehicle) for path in intersection.paths])


@by_size(256)
def separation(intersection: Intersection, vehicle: Size) -> Floats:
    """Distance [m] between the corridors of every two movements, shape (m, m).

    0 where they overlap, and between movements from the same arm, which share their start.
    """
    swept = corridors(intersection, vehicle)
    i, j = np.triu_indices(len(swept), 1)
    result = np.zeros((len(swept), len(swept)))
    result[i, j] = result[j, i] = shapely.distance(swept[i], swept[j])
    return _fixed(np.where(intersection.movements.apart, result, 0.0))


def conflicts(
    intersection: Intersection, vehicle: VehicleType | Size, clearance: float = CLEARANCE
) -> Bools:
    """Whether two movements come closer than `clearance` [m]; shape (m, m), symmetric."""
    number("clearance [m]", clearance, low=0, high=10)
    return np.asarray(separation(intersection, vehicle) <= clearance)


@by_size(256)
def entry_room(intersection: Intersection, vehicle: Size) -> float:
    """Distance [m] between a vehicle held at any entry and the corridors of other arms.

    0 where the vehicle does not fit the lanes: when it turns into an exit lane, it would touch
    another that waits beside that lane.
    """
    entry, movements = intersection.approach_length, intersection.movements
    firsts = [intersection.paths[movements.rows[arm][1]] for arm in range(intersection.n)]
    held = np.asarray(shapely.polygons([path.bodies(entry, vehicle) for path in firsts]))
    distance = shapely.distance(corridors(intersection, vehicle)[:, None], held[None, :])
    return float(distance[movements.origins[:, None] != np.arange(intersection.n)].min())


@by_size(256)
def conflict_zones(intersection: Intersection, vehicle: Size) -> Floats:
    """The conflict zones of all movements, shape (m, m, 2) [m].

    A vehicle on path p whose front bumper is between `[p, q, 0]` and `[p, q, 1]` past the junction
    entry comes closer than `CLEARANCE` to what vehicles on path q sweep. Elsewhere it does not, at
    least until its rear has left the junction, where every zone ends. Two vehicles do not touch
    unless both are in their zones. Not a number where two movements do not conflict.

    The zone reaches from the body tested before the first near one to that after the last, and is
    the whole crossing where the corridors are near each other between two tested bodies only.
    """
    paths = intersection.paths
    lengths = [path.crossing + vehicle.length for path in paths]
    past = [np.linspace(0.0, end, math.ceil(end / SWEEP_STEP) + 1) for end in lengths]
    pairs = _rivals(intersection, vehicle)
    zones = np.full((*pairs.shape, 2), np.nan)
    fronts = [path.entry + s for path, s in zip(paths, past, strict=True)]
    swept = corridors(intersection, vehicle)
    for p, q, near in _reaching(intersection, vehicle, fronts, swept, pairs, CLEARANCE):
        s = past[p]
        first, last = (near[0] - 1, near[-1] + 1) if len(near) else (0, len(s))
        zones[p, q] = s[max(first, 0)], s[min(last, len(s) - 1)]
    return _fixed(zones)


@by_size(256)
def clearing_distances(intersection: Intersection, vehicle: Size) -> Floats:
    """How far past the junction entry a vehicle's front is when it has left another's way.

    `[p, q]`: from there on the body of a vehicle of movement q keeps `CLEARANCE` from the corridor
    of movement p. Minus infinity where the two do not conflict. Infinite where that takes until
    the rear is out of the junction, as where both leave by one exit lane.

    Returns:
        Shape (m, m) [m], in the order of `Intersection.movements`.
    """
    paths = intersection.paths
    ways = _prepared(shapely.buffer(corridors(intersection, vehicle), CLEARANCE))
    lengths = [path.crossing + vehicle.length for path in paths]
    past = [np.append(np.arange(0.0, end, CLEARING_STEP), end) for end in lengths]
    pairs = _rivals(intersection, vehicle)
    distances = np.full(pairs.shape, -math.inf)
    fronts = [path.entry + s for path, s in zip(paths, past, strict=True)]
    for q, p, near in _reaching(intersection, vehicle, fronts, ways, pairs):
        s = past[q]
        last = near[-1] if len(near) else len(s)
        distances[p, q] = s[last + 1] if last + 2 < len(s) else math.inf
    return _fixed(distances)


@by_size(256)
def conflict_areas(intersection: Intersection, vehicle: Size) -> Areas:
    """Where on its path a vehicle is in the way of another movement, inside the junction."""
    paths = intersection.paths
    fronts = [np.arange(path.entry, path.exit + vehicle.length, AREA_STEP) for path in paths]
    swept = corridors(intersection, vehicle)
    inside = _prepared([_until_exit(path, swept[p]) for p, path in enumerate(paths)])
    pairs = (separation(intersection, vehicle) <= 0.0) & intersection.movements.apart
    enter, leave = (np.full(pairs.shape, np.nan) for _ in range(2))
    for p, q, near in _reaching(intersection, vehicle, fronts, inside, pairs):
        if len(near):
            enter[p, q], leave[p, q] = fronts[p][near[[0, -1]]]
    both = np.isfinite(enter) & np.isfinite(enter.T)
    return Areas(*(_fixed(np.where(both, table, np.nan)) for table in (enter, leave)))


def _rivals(intersection: Intersection, vehicle: Size) -> Bools:
    """Whether two movements of different arms conflict."""
    return conflicts(intersection, vehicle) & intersection.movements.apart


def _reaching(
    intersection: Intersection,
    vehicle: Size,
    fronts: Sequence[Floats],
    areas: Shapes,
    pairs: Bools,
    room: float = 0.0,
) -> Iterator[tuple[int, int, npt.NDArray[np.intp]]]:
    """For each of some pairs (p, q): at which of its fronts on path p is a body near area q."""
    for p in np.flatnonzero(pairs.any(axis=1)).tolist():
        shapes = bodies(intersection.paths[p], fronts[p], vehicle)
        for q in np.flatnonzero(pairs[p]).tolist():
            if room > 0.0:
                near = shapely.dwithin(areas[q], shapes, room)
            else:
                near = shapely.intersects(areas[q], shapes)  # several times faster
            yield p, q, np.flatnonzero(near)


def _until_exit(path: Path, swept: shapely.Geometry) -> shapely.Geometry:
    """A corridor up to the exit line; on the exit lane, vehicles follow each other."""
    heading = path.heading_out
    across = np.array([-heading[1], heading[0]])
    start, far = path.points[-1], 1000.0
    beyond = shapely.polygons(
        [start + far * (i * across + k * heading) for i, k in ((1, 0), (1, 1), (-1, 1), (-1, 0))]
    )
    inside: shapely.Geometry = shapely.difference(swept, beyond)
    return inside


def _prepared(shapes: Sequence[shapely.Geometry] | Shapes) -> Shapes:
    result = np.array(shapes)
    shapely.prepare(result)
    return result


def _fixed(table: Floats) -> Floats:
    table.setflags(write=False)
    return table
