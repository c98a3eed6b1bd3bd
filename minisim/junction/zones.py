"""Where paths conflict: for every two movements, the stretch of each on which they could touch."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import shapely

from minisim.control import CLEARANCE, Site
from minisim.junction.geometry import SWEEP_STEP, Floats, Intersection, Path
from minisim.vehicle import VehicleType


def conflict_zones(site: Site) -> Floats:
    """The conflict zones of all movements, shape (m, m, 2) [m].

    A vehicle on path p whose front bumper is between `[p, q, 0]` and `[p, q, 1]` past the junction
    entry comes closer than `CLEARANCE` to what vehicles on path q sweep; elsewhere it does not, at
    least until its rear has left the junction, where every zone ends. Two vehicles of which not
    both are in their zones do not touch. Not a number where two movements do not conflict.
    """
    vehicle = site.vehicle
    return _zones(site.intersection, vehicle.length, vehicle.width)


@lru_cache(maxsize=64)
def _zones(intersection: Intersection, length: float, width: float) -> Floats:
    vehicle = VehicleType(length=length, width=width)
    paths = intersection.paths
    conflicts = intersection.conflicts(vehicle, CLEARANCE)
    corridors = np.array([path.corridor(vehicle) for path in paths])
    shapely.prepare(corridors)
    zones = np.full((len(paths), len(paths), 2), np.nan)
    for p, path in enumerate(paths):
        s = _samples(path, vehicle)
        bodies = np.asarray(shapely.polygons(path.bodies(path.entry + s, vehicle)))
        for q, other in enumerate(paths):
            if conflicts[p, q] and path.movement.origin != other.movement.origin:
                near = np.flatnonzero(shapely.dwithin(corridors[q], bodies, CLEARANCE))
                zones[p, q] = _stretch(s, near)
    zones.setflags(write=False)
    return zones


def _samples(path: Path, vehicle: VehicleType) -> Floats:
    """Front positions from the entry until the rear has left, past the entry [m]."""
    last = path.exit - path.entry + vehicle.length
    return np.linspace(0.0, last, math.ceil(last / SWEEP_STEP) + 1)


def _stretch(s: Floats, near: np.typing.NDArray[np.intp]) -> tuple[float, float]:
    """From the sample before the first near one to the one after the last.

    The whole crossing where corridors come near each other between two samples only.
    """
    if len(near) == 0:
        return float(s[0]), float(s[-1])
    return float(s[max(near[0] - 1, 0)]), float(s[min(near[-1] + 1, len(s) - 1)])
