"""Where two vehicles on their paths come too close: the coordination space of two movements.

Two vehicles on given paths are a point in the plane of their positions, in which a region is
forbidden (O'Donnell and Lozano-Pérez, ICRA 1989). Intervals on the paths would only give the box
around that region. The region also shows which vehicle has passed the other.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely

from minisim.junction.conflicts import CLEARANCE, Shapes, bodies
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools
from minisim.junction.paths import Floats, Path
from minisim.vehicle import VehicleType

#: Grid of positions [m].
STEP = 0.25

#: Room between two bodies if one stands or crawls [m]: one buffer (see `CLEARANCE`).
CLOSE = 0.25

#: Least room if two vehicles would otherwise stand for ever, and the step of its measurement [m].
TIGHT = 0.1


class Region(NamedTuple):
    """The forbidden region of two movements, on a grid of `STEP` from the junction entry onwards.

    Rows are positions of the first vehicle's front past the entry; columns, of the second's. Before
    the entry counts as at the entry, and beyond the grid as outside the region.
    """

    close: Bools  #: whether bodies come closer than `CLOSE` within one step of the grid point
    ever: Bools  #: likewise for `CLEARANCE`, at this or any later position of the second

    def room(self, first: float, second: float) -> float:
        """How far the first may go on, wherever the second goes [m]; may be infinite."""
        return _free(self.ever, first, second)

    def way(self, first: float, second: float) -> float:
        """How far the first may go on while the second stays where it is [m]."""
        return _free(self.close, first, second)

    def touches(self, first: Floats, second: Floats) -> bool:
        """Whether the bodies come close at any of these moments (positions past the entry [m])."""
        rows, columns = (np.maximum(s // STEP, 0.0).astype(int) for s in (first, second))
        inside = (rows < len(self.close)) & (columns < self.close.shape[1])
        return bool(self.close[rows[inside], columns[inside]].any())

    def ends(self, second: float) -> float:
        """Where the first leaves the region for good if the second is here or further on [m]."""
        column = max(int(second / STEP), 0)
        rows = np.flatnonzero(self.ever[:, column : column + 1])
        return float(rows[-1] + 1) * STEP if len(rows) else 0.0


@lru_cache(maxsize=4096)
def region(
    intersection: Intersection,
    vehicle: VehicleType,
    first: int,
    second: int,
    other: VehicleType | None = None,
) -> Region | None:
    """The forbidden region of two movements, by index; None if the bodies never come close.

    `other` is the type of the second vehicle, by default the same.
    """
    types = (vehicle, other or vehicle)[:: 1 if first < second else -1]
    near, close = _grids(intersection, *types, min(first, second), max(first, second))
    if not near.any():
        return None
    if first > second:
        near, close = near.T, close.T
    return Region(close, np.logical_or.accumulate(near[:, ::-1], axis=1)[:, ::-1])


def passes(
    intersection: Intersection, vehicle: VehicleType, first: int, x: float, second: int, y: float,
    other: VehicleType | None = None,
) -> bool:  # fmt: skip
    """Whether a vehicle on a path can pass a vehicle that stands on another path.

    The moving one needs `CLOSE` of room all the way by the grid, or more than `TIGHT` if measured.
    Movements are indices; `x` and `y` are how far past the entry the fronts are [m]. `other` is the
    type of the standing vehicle, by default the same.
    """
    other = other or vehicle
    shared = region(intersection, vehicle, first, second, other)
    if shared is None or shared.way(x, y) == math.inf:
        return True
    return _squeezes(intersection, vehicle, first, round(x, 2), second, round(y, 2), other)


def _free(blocked: Bools, first: float, second: float) -> float:
    row, column = max(int(first / STEP), 0), max(int(second / STEP), 0)
    if row >= blocked.shape[0] or column >= blocked.shape[1]:
        return math.inf
    ahead = np.flatnonzero(blocked[row:, column])
    return max(int(row + ahead[0]) * STEP - first, 0.0) if len(ahead) else math.inf


@lru_cache(maxsize=4096)
def _squeezes(
    intersection: Intersection, vehicle: VehicleType, first: int, x: float, second: int, y: float,
    other: VehicleType,
) -> bool:  # fmt: skip
    """`passes`, by measurement; the grid is too coarse for the last few decimetres."""
    one, its = intersection.paths[first], intersection.paths[second]
    stands = bodies(its, np.array([its.entry + y]), other)
    past = np.arange(x, one.crossing + vehicle.length, TIGHT)
    moves = bodies(one, one.entry + past, vehicle)
    return bool((shapely.distance(moves, stands) > TIGHT).all())


@lru_cache(maxsize=4096)
def _grids(
    intersection: Intersection, vehicle: VehicleType, other: VehicleType, first: int, second: int
) -> tuple[Bools, Bools]:
    """Whether, near each grid point, bodies come closer than `CLEARANCE`, and than `CLOSE`."""

    def until_clear(path: Path, it: VehicleType) -> Shapes:
        past = np.arange(0.0, path.crossing + it.length + STEP, STEP)
        return bodies(path, path.entry + past, it)

    one = until_clear(intersection.paths[first], vehicle)
    two = until_clear(intersection.paths[second], other)
    distance = shapely.distance(one[:, None], two[None, :])
    return _widened(distance <= CLEARANCE), _widened(distance <= CLOSE)


def _widened(near: Bools) -> Bools:
    """Widened by a step on each side, since bodies move between grid points."""
    wide = np.pad(near, 1)
    rows = wide[:-2] | wide[1:-1] | wide[2:]
    return np.asarray(rows[:, :-2] | rows[:, 1:-1] | rows[:, 2:])
