"""Where two vehicles on their paths come too near: the conflict area of every two movements.

Two vehicles on given paths are one point in the plane of their positions, and what must not be
is a region of it (the coordination space of O'Donnell and Lozano-Pérez, ICRA 1989). Two intervals,
one on each path, would be the box around that region; the region also tells who has passed whom.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from minisim.control import CLEARANCE, Site
from minisim.junction.geometry import Bools, Floats, Intersection, Path
from minisim.vehicle import VehicleType

#: Grid of positions [m].
STEP = 0.25

#: Room between a body and another that passes it at a crawl, or is seen to stand [m]: the buffer
#: of 0.25 m around one of the two (see `minisim.control.CLEARANCE`).
CLOSE = 0.25

#: Room that has to do where two would stand for ever otherwise, and the step in which it is
#: measured [m].
TIGHT = 0.1


class Area(NamedTuple):
    """The conflict area of two movements, on a grid of `STEP` from the junction entry on.

    Rows are positions of the first vehicle's front past the entry, columns of the second's; a
    position before the entry counts as the entry, one past the grid is out of the area.

    Attributes:
        close: whether the bodies come closer than `CLOSE`, anywhere within one step of the grid
            point.
        ever: whether they come closer than `CLEARANCE` at this or a later position of the second.
    """

    close: Bools
    ever: Bools

    def room(self, first: float, second: float) -> float:
        """How far the first may still go, however far the second goes [m]; may be infinite."""
        return _free(self.ever, first, second)

    def way(self, first: float, second: float) -> float:
        """How far the first may still go while the second stands where it is [m]."""
        return _free(self.close, first, second)

    def touches(self, first: Floats, second: Floats) -> bool:
        """Whether the bodies come close at any of these moments (positions past the entry)."""
        rows, columns = _index(first), _index(second)
        inside = (rows < len(self.close)) & (columns < self.close.shape[1])
        return bool(self.close[rows[inside], columns[inside]].any())

    def ends(self, second: float) -> float:
        """From where on the first is out of the area for a second as far as this or further [m]."""
        column = max(int(second / STEP), 0)
        if column >= self.ever.shape[1]:
            return 0.0
        rows = np.flatnonzero(self.ever[:, column])
        return float(rows[-1] + 1) * STEP if len(rows) else 0.0


def area(site: Site, first: int, second: int) -> Area | None:
    """The conflict area of two movements by index, or None where bodies never come near."""
    vehicle = site.vehicle
    return _area(site.intersection, vehicle.length, vehicle.width, first, second)


def passes(site: Site, first: int, x: float, second: int, y: float) -> bool:
    """Whether a vehicle on one path gets past another that stands on another.

    With `CLOSE` between the bodies by the grid or, measured, more than `TIGHT` all the way.

    Args:
        site: where.
        first, second: movements by index.
        x, y: how far past the entry their fronts are [m].
    """
    shared = area(site, first, second)
    if shared is None or shared.way(x, y) == math.inf:
        return True
    return _squeezes(site.intersection, site.vehicle, first, round(x, 2), second, round(y, 2))


def showing(site: Site, tolerance: float) -> Floats:
    """From where on a vehicle is seen not to take another manoeuvre of its lane, shape (m, m) [m].

    `[p, q]`: the middle of the front bumper of a vehicle on path p is more than `tolerance` [m]
    beside path q from so far past the entry on. Infinite on the path itself, 0 between lanes.
    """
    return _showing(site.intersection, tolerance)


def _index(position: Floats) -> np.typing.NDArray[np.intp]:
    return np.maximum(np.floor(position / STEP), 0.0).astype(np.intp)


def _free(blocked: Bools, first: float, second: float) -> float:
    row, column = max(int(first / STEP), 0), max(int(second / STEP), 0)
    if row >= blocked.shape[0] or column >= blocked.shape[1]:
        return math.inf
    ahead = np.flatnonzero(blocked[row:, column])
    if len(ahead) == 0:
        return math.inf
    return max(int(row + ahead[0]) * STEP - first, 0.0)


@lru_cache(maxsize=4096)
def _area(
    intersection: Intersection, length: float, width: float, first: int, second: int
) -> Area | None:
    near, close = _grids(intersection, length, width, min(first, second), max(first, second))
    if not near.any():
        return None
    if first > second:
        near, close = near.T, close.T
    return Area(close, np.logical_or.accumulate(near[:, ::-1], axis=1)[:, ::-1])


@lru_cache(maxsize=4096)
def _squeezes(
    intersection: Intersection, vehicle: VehicleType, first: int, x: float, second: int, y: float
) -> bool:
    """`passes`, measured: the grid is too coarse to tell the last decimetres."""
    one, other = intersection.paths[first], intersection.paths[second]
    stands = shapely.polygons(other.bodies(np.array([other.entry + y]), vehicle))
    s = np.arange(x, one.exit - one.entry + vehicle.length, TIGHT)
    moves = shapely.polygons(one.bodies(one.entry + s, vehicle))
    return bool((shapely.distance(moves, stands) > TIGHT).all())


@lru_cache(maxsize=4096)
def _grids(
    intersection: Intersection, length: float, width: float, first: int, second: int
) -> tuple[Bools, Bools]:
    """Whether the bodies come closer than `CLEARANCE`, and than `CLOSE`, near each grid point."""
    vehicle = VehicleType(length=length, width=width)
    one, other = (_bodies(intersection.paths[k], vehicle) for k in (first, second))
    distance = shapely.distance(one[:, None], other[None, :])
    return _widened(distance <= CLEARANCE), _widened(distance <= CLOSE)


def _bodies(path: Path, vehicle: VehicleType) -> np.typing.NDArray[np.object_]:
    """The body with its front at each grid point, until its rear has left the junction."""
    last = path.exit - path.entry + vehicle.length
    s = np.arange(0.0, last + STEP, STEP)
    return np.asarray(shapely.polygons(path.bodies(path.entry + s, vehicle)))


def _widened(near: Bools) -> Bools:
    """With a step more on either side in both directions: bodies move between grid points."""
    wide = np.pad(near, 1)
    rows = wide[:-2] | wide[1:-1] | wide[2:]
    return np.asarray(rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:])


@lru_cache(maxsize=64)
def _showing(intersection: Intersection, tolerance: float) -> Floats:
    paths = intersection.paths
    result = np.zeros((len(paths), len(paths)))
    for p, path in enumerate(paths):
        s = np.arange(0.0, path.exit - path.entry + 10.0, 0.05)
        points = shapely.points(path.position(path.entry + s))
        for q, other in enumerate(paths):
            if path.movement.origin == other.movement.origin:
                beside = np.flatnonzero(shapely.distance(points, other.line) > tolerance)
                result[p, q] = np.inf if p == q else s[beside[0]]
    result.setflags(write=False)
    return result
