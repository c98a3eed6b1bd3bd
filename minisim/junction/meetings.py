"""Where two ways through a junction meet, as SUMO sees it.

SUMO's vehicles follow not only the vehicle ahead, but also vehicles that are about to join their
way inside the junction or have just left it. This module gives, for each pair of movements, the
distance from the place where their ways meet to the end of each way.
Source: `MSLink::setRequestInformation`, `MSLink::computeDistToDivergence` (SUMO 1.28).
"""

from __future__ import annotations

import itertools
import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
import shapely

from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats, distances_along
from minisim.junction.turns import Turn, turns

#: Lanes this far apart no longer touch each other [m] (`DIVERGENCE_MIN_WIDTH`).
DIVERGED = 2.5

#: Ways that bend by less than this count as straight [°].
BENT = math.degrees(1e-4)


class Meeting(IntEnum):
    """How two ways meet."""

    NOWHERE = 0
    JOIN = 1  # they end in the same exit lane
    PART = 2  # they begin on the same approach lane


def meetings(intersection: Intersection) -> Floats:
    """How and where each pair of movements meets, shape (m, m, 2).

    `[p, q]` holds the kind (`Meeting`) and the distance along way p from where it meets way q to
    the junction exit [m].
    """
    curves, paths = _curves(intersection), intersection.paths
    table = np.zeros((len(paths), len(paths), 2))
    for p, q in itertools.permutations(range(len(paths)), 2):
        (way, end), (other, other_end) = curves[p], curves[q]
        if paths[p].movement.origin == paths[q].movement.origin:
            table[p, q] = Meeting.PART, max(way.length - _parted(way, other) * way.scale, 0.0)
        elif paths[p].exit_arm == paths[q].exit_arm:
            backwards = [_Curve(curve.points[::-1], curve.length) for curve in (end, other_end)]
            table[p, q] = Meeting.JOIN, _parted(*backwards) * end.scale
    return table


class _Curve(NamedTuple):
    """A way or part of one: its polyline and the length that a vehicle drives on it [m].

    The polyline's own length may differ slightly: SUMO rounds lengths and scales positions.
    """

    points: Floats
    length: float

    @property
    def scale(self) -> float:
        """Driven length divided by the polyline's."""
        return self.length / float(distances_along(self.points)[-1])


def _curves(intersection: Intersection) -> list[tuple[_Curve, _Curve]]:
    """Each way, and the part of it past the waiting position, which is a point of the polyline.

    Only that part can meet a way that joins.
    """
    if intersection.ways is None:
        return [(_Curve(path.points, path.crossing),) * 2 for path in intersection.paths]
    curves = []
    for path, way in zip(intersection.paths, intersection.ways, strict=True):
        points = np.asarray(way.points, dtype=float)
        k = int(np.argmin(np.abs(distances_along(points) - way.wait)))
        length = path.crossing
        curves.append((_Curve(points, length), _Curve(points[k:], length - way.wait)))
    return curves


def _parted(one: _Curve, two: _Curve) -> float:
    """Distance along two curves from their common start to where they part [m]."""
    ends = [float(distances_along(curve.points)[-1]) for curve in (one, two)]
    return min(max(_until_apart(one, two), _until_apart(two, one)), *ends)


def _until_apart(curve: _Curve, other: _Curve) -> float:
    """Distance along a curve beyond which it stays `DIVERGED` from the other [m]."""
    line = shapely.LineString(other.points)
    gaps = np.asarray(shapely.distance(shapely.points(curve.points), line))
    at = distances_along(curve.points)
    k = int(np.flatnonzero(gaps <= DIVERGED)[-1])
    if k == len(at) - 1:
        return curve.length
    share = (DIVERGED - gaps[k]) / (gaps[k + 1] - gaps[k])
    return float(at[k] + share * (at[k + 1] - at[k])) + (curve.length - float(at[-1]))


def sagittas(intersection: Intersection, length: float) -> Floats:
    """Room that SUMO adds behind a leader on a curve to the far side, shape (m,) [m].

    The height of the arc over a chord as long as the vehicle plus 2 m; 0 for straight and near
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
