"""Where movements of a lane part, and what a vehicle's place reveals about its manoeuvre."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import shapely

from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats, Path
from minisim.vehicle import VehicleType

#: Extra lateral room needed before a vehicle turning off no longer obstructs the lane [m].
BRANCH_ROOM = 0.5


@lru_cache(maxsize=256)
def branch(intersection: Intersection, vehicle: VehicleType) -> Floats:
    """Where movements of a lane part, shape (m, m) [m].

    `[p, q]` is the smallest `s` on path p at which a rear bumper no longer obstructs path q.
    It is infinite for the same path, and 0 between lanes.
    """

    def last_near(path: Path, other: Path) -> float:
        s = np.arange(path.entry, path.exit + 60.0, 0.25)
        gaps = shapely.distance(shapely.points(path.position(s)), other.line)
        return float(s[np.flatnonzero(gaps < vehicle.width + BRANCH_ROOM)[-1]]) + 0.25

    return _by_lane(intersection, 0.0, last_near)


@lru_cache(maxsize=64)
def showing(intersection: Intersection, tolerance: float) -> Floats:
    """Where a vehicle is first visibly not taking another manoeuvre of its lane, (m, m) [m].

    `[p, q]`: from this far past the entry, the middle of the front bumper of a vehicle on path p
    is more than `tolerance` [m] off path q. Infinite for the same path, 0 between lanes.
    """

    def first_beside(path: Path, other: Path) -> float:
        s = np.arange(0.0, path.crossing + 10.0, 0.05)
        gaps = shapely.distance(shapely.points(path.position(path.entry + s)), other.line)
        return float(s[np.argmax(gaps > tolerance)])

    return _by_lane(intersection, 0.0, first_beside)


def parting(intersection: Intersection, room: float) -> Floats:
    """How far past the entry two movements of a lane are first `room` apart, shape (m, m) [m].

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
