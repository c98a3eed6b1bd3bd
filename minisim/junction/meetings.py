"""Where two ways through a junction meet, as SUMO sees it.

SUMO's vehicles follow not only the vehicle ahead, but also those inside the junction that are about
to join their way, have just left it, or cross it. This is the table of those places: for every two
ways, how far before its end each of them meets the other.
Source: `MSRightOfWayJunction::postloadInit`, `MSInternalJunction::postloadInit`,
`MSLink::setRequestInformation`, `MSLink::computeDistToDivergence` (SUMO 1.18; 1.28 is the same).
"""

from __future__ import annotations

import math
from enum import IntEnum
from itertools import permutations, product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from minisim.junction.geometry import Intersection
from minisim.junction.paths import Floats, Path, distances_along
from minisim.junction.turns import Turn, turns

Bools = npt.NDArray[np.bool_]

#: Lanes this far apart no longer touch [m] (`DIVERGENCE_MIN_WIDTH`).
DIVERGED = 2.5

#: Ways that cross at a smaller angle count as crossing at one of this sine.
LEAST_SINE = 0.2

#: Ways that bend by less than this are straight [°].
BENT = math.degrees(1e-4)


class Meeting(IntEnum):
    """How two parts of ways meet."""

    NOWHERE = 0
    JOIN = 1  # they end in one exit lane
    PART = 2  # they begin on one approach lane
    CROSS = 3
    WAIT = 4  # the other ends at a waiting position, and has priority


def meetings(intersection: Intersection) -> Floats:
    """How and where every two ways meet, part by part, shape (m, 2, m, 2, 4).

    Part 0 of a way is what lies before its waiting position, if it has one; part 1 is the rest.
    `[p, i, q, k]` is about part i of way p and part k of way q: the kind (`Meeting`), the distance
    from where the parts meet to the end of part i, the same for a vehicle that has to stop at the
    waiting position instead, and the length of way that the crossing takes [m].
    """
    ways = [_Curve.of(path, intersection).parts for path in intersection.paths]
    rights = right_of_way(intersection)
    table = np.zeros((len(ways), 2, len(ways), 2, 4))
    for p, q in permutations(range(len(ways)), 2):
        for (i, part), (k, other) in product(ways[p].items(), ways[q].items()):
            crossing = _crossing(part, other, intersection.lane_width)
            kind = _kind(intersection, ways, rights, (p, i), (q, k), crossing is not None)
            behind, width = crossing or (0.0, 0.0)
            if kind == Meeting.PART:
                behind, width = max(part.length - _parted(part, other) * part.scale, 0.0), 0.0
            elif kind == Meeting.JOIN:
                behind, width = _from_joined(part, other), 0.0
            elif kind == Meeting.WAIT and crossing is None:
                behind, width = _from_joined(part, other), intersection.lane_width
            stops = kind == Meeting.CROSS and i == 1 and 0 in ways[p]
            table[p, i, q, k] = kind, behind, part.length if stops else behind, width
    return table


class RightOfWay(NamedTuple):
    """Which ways meet, and which must give way."""

    foes: Bools  #: whether two ways cross or join, shape (m, m)
    yields: Bools  #: whether the first must give way to the second, shape (m, m)
    major: Bools  #: whether the way comes from a road with priority, shape (m,)


def right_of_way(intersection: Intersection) -> RightOfWay:
    """By the given ways; on arcs, none has to give way, and all that cross or join meet."""
    movements, ways = intersection.movements, intersection.ways
    if ways is not None:
        foes = np.array([[name in way.foes for name in movements.names] for way in ways])
        yields = np.array([[name in way.yields for name in movements.names] for way in ways])
        return RightOfWay(foes, yields, np.array([way.major for way in ways]))
    lines = np.array([shapely.LineString(path.points) for path in intersection.paths])
    joins = movements.exits[:, None] == movements.exits
    foes = movements.apart & (joins | shapely.intersects(lines[:, None], lines))
    return RightOfWay(foes, np.zeros_like(foes), np.zeros(len(movements), bool))


def _kind(
    intersection: Intersection,
    ways: list[dict[int, _Curve]],
    rights: RightOfWay,
    one: tuple[int, int],
    two: tuple[int, int],
    crosses: bool,
) -> Meeting:
    (p, i), (q, k) = one, two
    path, rival = intersection.paths[p], intersection.paths[q]
    if path.movement.origin == rival.movement.origin:
        first_parts = i == min(ways[p]) and k == min(ways[q])
        return Meeting.PART if first_parts else Meeting.NOWHERE
    opposite = path.exit_arm != rival.movement.origin and rival.exit_arm != path.movement.origin
    if not rights.foes[p, q] or (0 in ways[p] and 0 in ways[q] and opposite):
        return Meeting.NOWHERE
    joins = path.exit_arm == rival.exit_arm
    if k == 0:
        return Meeting.WAIT if rights.yields[p, q] and (joins or crosses) else Meeting.NOWHERE
    if joins and i == 1:
        return Meeting.JOIN
    return Meeting.CROSS if crosses else Meeting.NOWHERE


class _Curve(NamedTuple):
    """A way or its second part: polyline, driven length and waiting position [m].

    The polyline's own length may differ slightly: SUMO rounds lengths and scales positions.
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
        return distances_along(self.points)

    @property
    def line(self) -> shapely.LineString:
        return shapely.LineString(self.points)

    @property
    def scale(self) -> float:
        """Metres driven per metre of the polyline."""
        return self.length / float(self.distances[-1])

    @property
    def parts(self) -> dict[int, _Curve]:
        """The part before the waiting position, a point of the polyline, and the one behind it."""
        if self.wait == 0.0:
            return {1: self}
        k = int(np.argmin(np.abs(self.distances - self.wait)))
        before, behind = self.points[: k + 1], self.points[k:]
        return {0: _Curve(before, self.wait), 1: _Curve(behind, self.length - self.wait)}

    def direction(self, at: float) -> float:
        """The polyline's, `at` of its own metres on [rad]."""
        k = min(int(np.searchsorted(self.distances, at, side="right")), len(self.points) - 1)
        dx, dy = self.points[k] - self.points[k - 1]
        return math.atan2(dy, dx)


def _crossing(one: _Curve, two: _Curve, lane_width: float) -> tuple[float, float] | None:
    """Distance from where a crossing begins to the end of the first curve, and its width [m].

    The other lane takes more of the way the smaller the angle is; None if they do not cross.
    """
    hits = shapely.get_coordinates(shapely.intersection(one.line, two.line))
    if not len(hits):
        return None
    points = shapely.points(hits)
    at = float(np.max(shapely.line_locate_point(one.line, points)))
    other = float(np.max(shapely.line_locate_point(two.line, points)))
    sine = abs(math.sin(one.direction(at) - two.direction(other)))
    width = min(lane_width * (2.0 / max(sine, LEAST_SINE) - 1.0), one.length)
    return one.length - max(at - width / 2.0, 0.0) * one.scale, width


def _from_joined(one: _Curve, two: _Curve) -> float:
    if math.dist(one.points[-1], two.points[-1]) >= DIVERGED:
        return 0.0
    ends = (curve._replace(points=curve.points[::-1]) for curve in (one, two))
    return _parted(*ends) * one.scale


def _parted(one: _Curve, two: _Curve) -> float:
    """Distance along two curves that begin together to where both are `DIVERGED` [m]."""
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

    The height of the arc over a chord as long as the vehicle plus 2 m; 0 for straight and near
    turns.
    """
    chord = length + 2.0
    result = np.zeros(len(intersection.paths))
    for p, turn in enumerate(turns(intersection, BENT)):
        if turn is Turn.FAR:
            path = intersection.paths[p]
            radius = float(_Curve.of(path, intersection).distances[-1]) / abs(path.turn)
            result[p] = radius - math.sqrt(max(radius * radius - chord * chord / 4.0, 0.0))
    return result
