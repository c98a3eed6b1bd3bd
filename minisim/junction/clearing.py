"""When a vehicle that crosses the junction no longer stands in another's way."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import shapely

from minisim.control import CLEARANCE, Site
from minisim.junction.geometry import Intersection
from minisim.vehicle import VehicleType

Floats = npt.NDArray[np.float64]

#: Spacing of the bodies that are looked at [m]: half the clearance, so that none is missed.
STEP = CLEARANCE / 2.0


def clearing_distances(site: Site) -> Floats:
    """How far past the junction entry a vehicle's front is when it has left another's way.

    `[p, q]`: from there on the body of a vehicle of movement q keeps `CLEARANCE` from the corridor
    of movement p. Minus infinity where the two do not conflict. Infinity where that takes until
    the rear is out of the junction, as where both leave by one exit lane.

    Returns:
        Shape (m, m) [m], in the order of `Intersection.movements`.
    """
    return _clearing_distances(site.intersection, site.vehicle, site.conflicts.tobytes())


@lru_cache(maxsize=64)
def _clearing_distances(
    intersection: Intersection, vehicle: VehicleType, conflicts: bytes
) -> Floats:
    paths = intersection.paths
    conflict = np.frombuffer(conflicts, dtype=bool).reshape(len(paths), len(paths))
    ways = shapely.buffer([path.corridor(vehicle) for path in paths], CLEARANCE)
    shapely.prepare(ways)
    distances = np.full(conflict.shape, -math.inf)
    for q, path in enumerate(paths):
        length = path.exit + vehicle.length - path.entry
        driven = np.append(np.arange(0.0, length, STEP), length)
        bodies = shapely.polygons(path.bodies(path.entry + driven, vehicle))
        for p in np.flatnonzero(conflict[:, q]).tolist():
            near = np.flatnonzero(shapely.intersects(ways[p], bodies))
            last = near[-1] if len(near) else len(driven)
            distances[p, q] = driven[last + 1] if last + 2 < len(driven) else math.inf
    distances.setflags(write=False)
    return distances
