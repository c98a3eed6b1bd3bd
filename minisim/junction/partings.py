"""Where movements of a lane part, and what a vehicle's place reveals about its manoeuvre."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import shapely

from minisim.fleet import Fleet, Vehicles
from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats, Path
from minisim.vehicle import VehicleType

#: Extra lateral room needed before a vehicle turning off no longer obstructs the lane [m].
BRANCH_ROOM = 0.5


@lru_cache(maxsize=256)
def branch(intersection: Intersection, vehicles: Vehicles) -> Floats:
    """Where movements of a lane part, shape (m, m) [m].

    `[p, q]` is the smallest `s` on path p at which a rear bumper no longer obstructs path q.
    It is infinite for the same path, and 0 between lanes.
    """
    room = max(it.width for it in vehicles.types) + BRANCH_ROOM
    dragging = [it for it in vehicles.types if it.rear_axle is not None]

    def last_near(path: Path, other: Path) -> float:
        s = np.arange(path.entry, path.exit + 60.0, 0.25)
        rears = [path.position(s)]  # on the path, or beside it where the rear axle is dragged
        for it in dragging:
            centre, heading = path.pose(s + it.length, it)
            rears.append(centre - heading * (it.length / 2.0))
        gaps = shapely.distance(shapely.points(np.array(rears)), other.line).min(axis=0)
        return float(s[np.flatnonzero(gaps < room)[-1]]) + 0.25

    return _by_lane(intersection, 0.0, last_near)


@lru_cache(maxsize=256)
def turning_room(intersection: Intersection, fleet: Fleet) -> float:
    """The largest gap at which the worst vehicle still touches one ahead of it like itself [m].

    On a straight road that is 0. In a turn the two bodies stand at an angle, and their corners
    touch while the middles of the bumpers are apart: chords of one arc of radius r by up to
    w·tan(arcsin(l/2r)).
    """
    vehicle, reach = fleet.worst, branch(intersection, fleet)
    gaps = np.arange(0.0, 3.0, 0.1) * vehicle.width
    paths, least = intersection.paths, 0.0
    allowed = intersection.allowed
    for p, q in np.argwhere((reach > 0.0) & allowed & allowed[:, None]).tolist():
        path = paths[p]
        rear = np.arange(path.entry, min(float(reach[p, q]), path.exit + vehicle.length), 0.3)
        first = path.pose(rear + vehicle.length, vehicle)
        second = paths[q].pose(np.subtract.outer(gaps, rear) * -1.0, vehicle)
        touching = gaps[_overlap(first, second, vehicle).any(axis=-1)]
        least = max(least, *touching) if len(touching) else least
    return float(least) + 0.1 * vehicle.width


def _overlap(
    first: tuple[Floats, Floats], second: tuple[Floats, Floats], vehicle: VehicleType
) -> npt.NDArray[np.bool_]:
    """Whether bodies overlap, given by centres and headings (..., 2): separating-axis test."""
    apart, (u, w) = first[0] - second[0], np.broadcast_arrays(first[1], second[1])
    cos = np.abs((u * w).sum(axis=-1))
    sin = np.abs(u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0])
    long, wide = vehicle.length / 2.0, vehicle.width / 2.0
    meet = np.ones(cos.shape, bool)
    for axis in (u, w):
        along = np.abs((apart * axis).sum(axis=-1))
        across = np.abs(apart[..., 0] * axis[..., 1] - apart[..., 1] * axis[..., 0])
        meet &= (along <= long + long * cos + wide * sin) & (
            across <= wide + long * sin + wide * cos
        )
    return meet


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
