"""Where movements of a lane part, and what a vehicle's place reveals about its manoeuvre.

In shapes, m is the number of movements, and so of paths.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import shapely

from minisim.fleet import Fleet, Vehicles
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Ints
from minisim.junction.paths import Bundle, Floats, Path
from minisim.junction.sweeps import ROUNDING, boxes_apart, stretch, swing
from minisim.vehicle import VehicleType

#: Rear bumpers are tried at this spacing, up to this far beyond the exit [m].
BRANCH_STEP, BEYOND = 0.25, 60.0

#: Extra lateral room needed before a vehicle turning off no longer obstructs the lane [m].
BRANCH_ROOM = 0.5


@lru_cache(maxsize=256)
def branch(intersection: Intersection, vehicles: Vehicles) -> Floats:
    """Where movements of a lane part, shape (m, m) [m].

    `[p, q]` is the smallest `s` on path p at which a rear bumper no longer obstructs path q.
    It is infinite for the same path, and 0 between lanes.
    """
    room = max(it.width for it in vehicles.types) + BRANCH_ROOM
    rears = [None, *(it for it in vehicles.types if it.rear_axle is not None)]
    paths, apart = intersection.paths, intersection.movements.apart
    lines = intersection.bundle.lines
    pairs = np.argwhere(~apart & ~np.eye(len(apart), dtype=bool))
    stops = [path.exit + BEYOND for path in paths]
    places, counts = _places(intersection, stops, BRANCH_STEP)
    drift = BRANCH_STEP * _pace(intersection, rears)
    last, open_ = counts[pairs[:, 0]] - 1, np.arange(len(pairs))
    while len(open_):
        p, q = pairs[open_].T
        s = places[last[open_]]
        gaps = np.min([
            shapely.distance(lines[q], shapely.points(_rears(intersection, p, s, it)))
            for it in rears
        ], axis=0)  # fmt: skip
        open_, far = open_[gaps >= room], gaps[gaps >= room]
        free = (far - room - ROUNDING) / drift[pairs[open_, 0]]
        last[open_] -= np.maximum(free.astype(int), 1)
    result = np.where(apart, 0.0, math.inf)
    result[tuple(pairs.T)] = places[last] + BRANCH_STEP
    result.setflags(write=False)
    return result


def _places(intersection: Intersection, stops: npt.ArrayLike, step: float) -> tuple[Floats, Ints]:
    """Places from the entry up to the farthest of `stops` [m], and how many are before each."""
    counts = np.ceil(np.subtract(stops, intersection.approach_length) / step).astype(int)
    return np.arange(intersection.approach_length, np.max(stops), step), counts


def _rears(
    intersection: Intersection, which: Ints, s: Floats, dragging: VehicleType | None
) -> Floats:
    """Rear bumpers of bodies that have driven to `s` (…, 2) [m]: on the path, or dragged off it."""
    if dragging is None:
        return intersection.bundle.position(which, s)
    centre, heading = intersection.bundle.pose(which, s + dragging.length, dragging)
    return np.asarray(centre - heading * (dragging.length / 2.0))


def _pace(intersection: Intersection, dragging: Sequence[VehicleType | None]) -> Floats:
    """How far a rear bumper moves per metre of `s`, at most, shape (m,).

    Where the front bumper moves at an angle φ to the body, the rear one moves by cos φ along it and
    by (1 − length/axle)·sin φ across it, see `minisim.junction.paths.Trail`.
    """
    across = [1.0 - it.length / it.rear_axle for it in dragging if it and it.rear_axle]
    return stretch(intersection) * max(1.0, *map(abs, across), 1.0)


@lru_cache(maxsize=256)
def turning_room(intersection: Intersection, fleet: Fleet) -> float:
    """The largest gap at which the worst vehicle still touches one ahead of it like itself [m].

    On a straight road that is 0. In a turn the two bodies stand at an angle, and their corners
    touch while the middles of the bumpers are apart: chords of one arc of radius r by up to
    w·tan(arcsin(l/2r)).
    """
    vehicle, reach = fleet.worst, branch(intersection, fleet)
    gaps = np.arange(0.0, 3.0, 0.1) * vehicle.width
    allowed, bundle = intersection.allowed, intersection.bundle
    p, q = np.nonzero((reach > 0.0) & allowed & allowed[:, None])
    ends = np.array([path.exit for path in intersection.paths]) + vehicle.length
    places, counts = _places(intersection, np.minimum(reach[p, q], ends[p]), 0.3)
    pair = np.repeat(np.arange(len(p)), counts)
    p, q, at = p[pair], q[pair], np.arange(len(pair)) - (counts.cumsum() - counts)[pair]
    leading = bundle.pose(np.arange(len(ends))[:, None], places + vehicle.length, vehicle)
    rows = q, places[at], *(it[p, at] for it in leading)
    pace, most = swing(intersection, vehicle) * gaps[1], 0
    for some in (slice(None, None, 8), slice(None)):  # some tell much of it, which spares the rest
        most = _touching(bundle, vehicle, gaps, pace, most, *(it[some] for it in rows))
    return float(gaps[most]) + 0.1 * vehicle.width


def _touching(
    bundle: Bundle, vehicle: VehicleType, gaps: Floats, pace: Floats, least: int,
    which: Ints, rear: Floats, centre: Floats, heading: Floats,
) -> int:  # fmt: skip
    """Index of the largest of `gaps` at which a body touches one ahead, or `least` if that is more.

    The bodies ahead are given by rear bumper, centre and heading; `which` are the paths of those
    behind. No point of these moves more than `pace` [m] on each path from one gap to the next.
    """
    half, k = np.array([vehicle.length, vehicle.width]) / 2.0, np.full(len(which), len(gaps) - 1)
    while len(k):  # from the largest gap down: bodies that are far apart stay apart for a while
        other, its = bundle.pose(which, rear - gaps[k], vehicle)
        room = boxes_apart(centre - other, heading, its, half, half)
        least = max(least, int(k[room <= 0.0].max(initial=0)))
        k = k - np.maximum(((room - ROUNDING) / pace[which]).astype(int), 1)
        left = k > least
        k, which, rear, centre, heading = (it[left] for it in (k, which, rear, centre, heading))
    return least


@lru_cache(maxsize=64)
def showing(intersection: Intersection, tolerance: float) -> Floats:
    """Where a vehicle is first visibly not taking another manoeuvre of its lane, shape (m, m) [m].

    `[p, q]`: from this far past the entry, the middle of the front bumper of a vehicle on path p
    is more than `tolerance` [m] off path q. Infinite for the same path, 0 between lanes.
    """

    def first_beside(path: Path, other: Path) -> float:
        s = np.arange(0.0, path.crossing + 10.0, 0.05)
        gaps = shapely.distance(shapely.points(path.position(path.entry + s)), other.line)
        return float(s[np.argmax(gaps > tolerance)])

    return _by_lane(intersection, 0.0, first_beside)


def parting(intersection: Intersection, room: float) -> Floats:
    """How far past the entry two movements of a lane are first `room` [m] apart, shape (m, m) [m].

    The two vehicles compared have driven equally far. Infinite for a movement with itself, and for
    two that never get that far apart; minus infinity for movements of different lanes.
    """

    def first_apart(path: Path, other: Path) -> float:
        s = np.arange(0.0, path.crossing + 10.0, 0.1)
        between = path.position(path.entry + s) - other.position(other.entry + s)
        far = np.flatnonzero(np.linalg.norm(between, axis=-1) > room)
        return float(s[far[0]]) if len(far) else math.inf

    return _by_lane(intersection, -math.inf, first_apart)


def _by_lane(
    intersection: Intersection, different: float, measure: Callable[[Path, Path], float]
) -> Floats:
    """`measure` of each pair of movements of a lane; `different` between lanes."""
    paths, apart = intersection.paths, intersection.movements.apart
    result = np.full(apart.shape, different)
    for p, q in np.argwhere(~apart).tolist():
        result[p, q] = math.inf if p == q else measure(paths[p], paths[q])
    result.setflags(write=False)
    return result
