"""Where movements of one lane part, and what a vehicle's place tells of its manoeuvre."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import shapely

from minisim.junction.conflicts import by_size
from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats, Size

#: Extra lateral room before a vehicle that turns off no longer obstructs the lane [m].
BRANCH_ROOM = 0.5


@by_size(256)
def branch(intersection: Intersection, vehicle: Size) -> Floats:
    """Where movements from one arm part, shape (m, m) [m].

    `[p, q]` is the smallest `s` on path p from which a rear bumper no longer obstructs path q;
    infinite on the same path, 0 between different arms.
    """
    paths, apart = intersection.paths, intersection.movements.apart
    result = np.zeros(apart.shape)
    for p, path in enumerate(paths):
        s = np.arange(path.entry, path.exit + 60.0, 0.25)
        points = shapely.points(path.position(s))
        for q in np.flatnonzero(~apart[p]).tolist():
            near = shapely.distance(points, paths[q].line) < vehicle.width + BRANCH_ROOM
            blocked = np.flatnonzero(near)
            result[p, q] = np.inf if p == q else s[blocked[-1]] + 0.25
    result.setflags(write=False)
    return result


@lru_cache(maxsize=64)
def showing(intersection: Intersection, tolerance: float) -> Floats:
    """From where on a vehicle is seen not to take another manoeuvre of its lane, shape (m, m) [m].

    `[p, q]`: from so far past the entry on, the middle of the front bumper of a vehicle on path p
    is more than `tolerance` [m] beside path q. Infinite on the path itself, 0 between lanes.
    """
    paths, apart = intersection.paths, intersection.movements.apart
    result = np.zeros(apart.shape)
    for p, path in enumerate(paths):
        s = np.arange(0.0, path.crossing + 10.0, 0.05)
        points = shapely.points(path.position(path.entry + s))
        for q in np.flatnonzero(~apart[p]).tolist():
            beside = np.flatnonzero(shapely.distance(points, paths[q].line) > tolerance)
            result[p, q] = np.inf if p == q else s[beside[0]]
    result.setflags(write=False)
    return result


def parting(intersection: Intersection, room: float) -> Floats:
    """How far past the entry two movements of a lane are first `room` apart, shape (m, m) [m].

    Two vehicles are compared that have come equally far. Infinite for a movement and itself, and
    where they never are so far apart; minus infinity for movements of different lanes.
    """
    paths, apart = intersection.paths, intersection.movements.apart
    result = np.full(apart.shape, -math.inf)
    for p, path in enumerate(paths):
        driven = np.arange(0.0, path.crossing + 10.0, 0.1)
        places = path.position(path.entry + driven)
        for q in np.flatnonzero(~apart[p]).tolist():
            gaps = np.linalg.norm(places - paths[q].position(paths[q].entry + driven), axis=-1)
            far = np.flatnonzero(gaps > room)
            result[p, q] = driven[far[0]] if len(far) else math.inf
    return result
