"""Where two ways through a junction meet, as SUMO sees it.

SUMO's vehicles follow not only the vehicle ahead, but also those that are about to join their way
inside the junction or have just left it. This is the table of those places: for every two
movements, how far before the end of its own way each of them is when it meets the other.
Source: `MSLink::setRequestInformation`, `MSLink::computeDistToDivergence` (SUMO 1.28).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
import shapely

from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats, Path, distances_along
from minisim.junction.turns import Turn, turns

#: Lanes this far apart no longer touch each other [m] (`DIVERGENCE_MIN_WIDTH`).
DIVERGED = 2.5

#: Ways that bend by less than this are straight [°].
BENT = math.degrees(1e-4)


class Meeting(IntEnum):
    """How two ways meet."""

    NOWHERE = 0
    JOIN = 1  # they end in one exit lane
    PART = 2  # they begin on one approach lane


def meetings(intersection: Intersection) -> Floats:
    """How and where every two movements meet, shape (m, m, 2).

    `[p, q]` holds the kind (`Meeting`) and the distance on way p from where it meets way q to the
    junction exit [m].
    """
    curves = [_Curve.of(path, intersection) for path in intersection.paths]
    table = np.zeros((len(curves), len(curves), 2))
    for p, (path, curve) in enumerate(zip(intersection.paths, curves, strict=True)):
        for q, (rival, other) in enumerate(zip(intersection.paths, curves, strict=True)):
            if p == q:
                continue
            if path.movement.origin == rival.movement.origin:
                table[p, q] = _part(curve, other)
            elif path.exit_arm == rival.exit_arm:
                table[p, q] = _join(curve.behind_wait, other.behind_wait)
    return table


class _Curve(NamedTuple):
    """A way or its second part: polyline, driven length and waiting position [m].

    The polyline's own length may differ a little: SUMO rounds lengths, and scales positions.
    """

    points: Floats
    length: float
    wait: float = 0.0

    @classmethod
    def of(cls, path: Path, intersection: Intersection) -> _Curve:
        """The given curve where there is one, else the arc."""
        if intersection.ways is None:
            return cls(path.points, path.crossing)
        way = intersection.ways[intersection.index(path.movement)]
        return cls(np.asarray(way.points, dtype=float), path.crossing, way.wait)

    @property
    def distances(self) -> Floats:
        """Of the points along the polyline [m]."""
        return distances_along(self.points)

    @property
    def line(self) -> shapely.LineString:
        """The polyline for shapely."""
        return shapely.LineString(self.points)

    @property
    def scale(self) -> float:
        """Driven length over the polyline's."""
        return self.length / float(self.distances[-1])

    @property
    def backwards(self) -> _Curve:
        """The same from its end."""
        return self._replace(points=self.points[::-1])

    @property
    def behind_wait(self) -> _Curve:
        """What lies behind the waiting position, a point of the polyline: what others can meet."""
        if self.wait == 0.0:
            return self
        k = int(np.argmin(np.abs(self.distances - self.wait)))
        return _Curve(self.points[k:], self.length - self.wait)


Place = tuple[int, float]


def _part(way: _Curve, other: _Curve) -> Place:
    apart = _parted(way, other) * way.scale
    return Meeting.PART, max(way.length - apart, 0.0)


def _join(way: _Curve, other: _Curve) -> Place:
    return Meeting.JOIN, _parted(way.backwards, other.backwards) * way.scale


def _parted(one: _Curve, two: _Curve) -> float:
    """Distance along two curves with one beginning to where both are `DIVERGED` [m]."""
    near = max(_until_apart(one, two), _until_apart(two, one))
    return min(near, float(one.distances[-1]), float(two.distances[-1]))


def _until_apart(curve: _Curve, other: _Curve) -> float:
    """Distance along the curve to where it stays `DIVERGED` from the other [m]."""
    gaps = np.asarray(shapely.distance(shapely.points(curve.points), other.line))
    at = curve.distances
    rounding = curve.length - float(at[-1])
    k = int(np.flatnonzero(gaps <= DIVERGED)[-1])
    if k == len(at) - 1:
        return curve.length
    share = (DIVERGED - gaps[k]) / (gaps[k + 1] - gaps[k])
    return float(at[k] + share * (at[k + 1] - at[k])) + rounding


def sagittas(intersection: Intersection, length: float) -> Floats:
    """Room that SUMO adds behind a leader on a curve to the far side, shape (m,) [m].

    The height of the arc over a chord of the vehicle's length and 2 m; 0 for straight and near
    turns.
    """
    chord = length + 2.0
    result = np.zeros(len(intersection.paths))
    for p, turn in enumerate(turns(intersection, BENT)):
        if turn is Turn.FAR:
            path = intersection.paths[p]
            radius = path.crossing / abs(path.turn)
            result[p] = radius - math.sqrt(max(radius * radius - chord * chord / 4.0, 0.0))
    return result
