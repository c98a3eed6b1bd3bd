"""Where two ways through a junction meet, as SUMO sees it.

SUMO's vehicles follow not only who is ahead of them, but also who is about to cross or join their
way inside the junction. This is the table of those places: for every two movements, how far before
the end of its own way each of them is when it meets the other, and how wide the other is there.
Source: `MSLink::setRequestInformation`, `MSLink::computeDistToDivergence` (SUMO 1.28).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from minisim.geometry import Intersection, Path

Floats = npt.NDArray[np.float64]

#: Lanes this far apart no longer touch each other [m] (`DIVERGENCE_MIN_WIDTH`).
DIVERGED = 2.5


class Meeting(IntEnum):
    """How two ways meet."""

    NOWHERE = 0
    CROSS = 1
    JOIN = 2  # they end in one exit lane
    PART = 3  # they begin on one approach lane


def meetings(intersection: Intersection) -> Floats:
    """How, where and how wide every two movements meet, shape (m, m, 3).

    `[p, q]` holds the kind (`Meeting`), the distance on way p from where it meets way q to the
    junction exit [m], and the width of the crossing on way p [m] (0 for `JOIN` and `PART`).
    """
    ways = [_Curve.of(path, intersection) for path in intersection.paths]
    table = np.zeros((len(ways), len(ways), 3))
    for p, way in enumerate(ways):
        for q, other in enumerate(ways):
            if p != q:
                table[p, q] = _meeting(way, other, intersection.lane_width)
    return table


class _Curve(NamedTuple):
    """One way: its polyline, length, waiting position, origin and exit arm."""

    points: Floats
    length: float
    wait: float
    origin: int
    exit_arm: int

    @classmethod
    def of(cls, path: Path, intersection: Intersection) -> _Curve:
        """The given curve where there is one, else the arc."""
        points, wait = path.points, 0.0
        if intersection.ways is not None:
            way = intersection.ways[intersection.index(path.movement)]
            points, wait = np.asarray(way.points, dtype=float), way.wait
        length = path.exit - path.entry
        return cls(points, length, wait, path.movement.origin, path.exit_arm)


def _meeting(way: _Curve, other: _Curve, lane_width: float) -> tuple[int, float, float]:
    if way.origin == other.origin:
        apart = _parted(way.points, other.points)
        return Meeting.PART, max(way.length - apart, 0.0), 0.0
    if way.exit_arm == other.exit_arm:
        return Meeting.JOIN, _parted(way.points[::-1], other.points[::-1]), 0.0
    place = _crossing(way, other)
    if place is None:
        return Meeting.NOWHERE, 0.0, 0.0
    at, behind, angle = place
    if at < way.wait or behind < other.wait:  # on a first part, which nobody meets
        return Meeting.NOWHERE, 0.0, 0.0
    width = lane_width * (2.0 / max(math.sin(angle), 0.2) - 1.0)
    width = min(width, way.length - way.wait)
    return Meeting.CROSS, way.length - max(at - width / 2.0, way.wait), width


def _crossing(way: _Curve, other: _Curve) -> tuple[float, float, float] | None:
    """Distance from both entries to the last crossing [m], and its angle [rad]."""
    line, across = shapely.LineString(way.points), shapely.LineString(other.points)
    points = shapely.get_coordinates(shapely.intersection(line, across))
    if not len(points):
        return None
    at = max(float(line.project(shapely.Point(point))) for point in points)
    behind = max(float(across.project(shapely.Point(point))) for point in points)
    angle = abs(_bearing(way.points, at) - _bearing(other.points, behind)) % (2.0 * math.pi)
    return at, behind, min(angle, 2.0 * math.pi - angle)


def _bearing(points: Floats, at: float) -> float:
    """Direction of the polyline's segment at a distance along it [rad]."""
    steps = np.diff(points, axis=0)
    ends = np.cumsum(np.linalg.norm(steps, axis=1))
    k = min(int(np.searchsorted(ends, at)), len(steps) - 1)
    return math.atan2(steps[k, 1], steps[k, 0])


def _parted(points: Floats, others: Floats) -> float:
    """Distance along two polylines with one beginning to where both are `DIVERGED` [m]."""
    one, two = shapely.LineString(points), shapely.LineString(others)
    first, second = _until_apart(points, two), _until_apart(others, one)
    return min(max(first, second), one.length, two.length)


def _until_apart(points: Floats, other: shapely.LineString) -> float:
    """Distance along the points to where they stay `DIVERGED` from the other line [m]."""
    gaps = np.asarray(shapely.distance(shapely.points(points), other))
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    near = np.flatnonzero(gaps <= DIVERGED)
    k = int(near[-1])
    if k == len(points) - 1:
        return float(at[-1])
    share = (DIVERGED - gaps[k]) / (gaps[k + 1] - gaps[k])
    return float(at[k] + share * (at[k + 1] - at[k]))


def sagittas(intersection: Intersection, length: float) -> Floats:
    """Room that SUMO adds behind a leader on a curve to the far side, shape (m,) [m].

    The height of the arc over a chord of the vehicle's length and 2 m; 0 for straight and near
    turns.
    """
    chord = length + 2.0
    result = np.zeros(len(intersection.paths))
    for p, path in enumerate(intersection.paths):
        (ix, iy), (ox, oy) = path.heading_in.tolist(), path.heading_out.tolist()
        turn = math.atan2(ix * oy - iy * ox, ix * ox + iy * oy)
        far = turn < -1e-4 if intersection.side == "left" else turn > 1e-4
        if far:
            radius = (path.exit - path.entry) / abs(turn)
            result[p] = radius - math.sqrt(max(radius * radius - chord * chord / 4.0, 0.0))
    return result
