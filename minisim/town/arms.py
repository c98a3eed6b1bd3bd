"""The arms of a node: which edges make up one road, and where its axis leads."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from minisim.junction.geometry import MIN_ANGLE
from minisim.junction.paths import Floats, distances_along
from minisim.town.reading import Edge, Node, Town

#: The length of road next to the junction that gives an arm its direction [m].
SPAN = 20.0
#: Spacing of the points that are looked at there [m].
SPACING = 1.0
#: Weight of the node's own position in the search for the centre; each arm's axis has weight 1. It
#: matters only if the axes leave the centre open, as when all are nearly parallel.
OWN_PLACE = 0.01


class Arm(NamedTuple):
    """A road at a node: an edge into it, one out of it, or both."""

    into: Edge | None
    out_of: Edge | None

    @property
    def edges(self) -> tuple[Edge, ...]:
        """The edges that exist, the one into the junction first."""
        return tuple(edge for edge in self if edge is not None)

    @property
    def traffic(self) -> str:
        """The road's traffic, as in `minisim.junction.roads.Road`: "both", "in" or "out"."""
        return "both" if None not in self else "in" if self.into else "out"

    @property
    def main(self) -> Edge:
        """The edge into the junction, or else the one out of it."""
        return self.edges[0]

    def lanes(self) -> tuple[Floats, ...]:
        """Points along the middle of each lane, from the junction on, shape (k, 2) each [m]."""
        given = [edge.shape[::-1] if edge is self.into else edge.shape for edge in self.edges]
        return tuple(map(_near, given))

    def axis(self) -> Floats:
        """Points in the middle of the road, from the junction outwards, shape (k, 2) [m]."""
        lanes = self.lanes()
        return np.asarray(np.mean([lane[: min(map(len, lanes))] for lane in lanes], axis=0))


def arms_of(town: Town, node: str) -> list[Arm]:
    """The arms of a node, in no order; `node` is one of `town.nodes`.

    An edge into the node and one out of it are one road if they lead to the same node or, as on a
    dual carriageway, leave at nearly the same angle. If several would do, the closest angles win.
    """
    into, out_of = list(town.into[node]), list(town.out_of[node])
    pairs = [(_apart(a, b), a, b) for a in into for b in out_of]
    same = [pair for pair in pairs if pair[1].origin == pair[2].target != node]
    close = [pair for pair in pairs if pair[0] < MIN_ANGLE]
    arms = []
    for chosen in (same, close):
        for _, a, b in sorted(chosen, key=lambda pair: (pair[0], pair[1].id, pair[2].id)):
            if a in into and b in out_of:
                arms.append(Arm(a, b))
                into.remove(a)
                out_of.remove(b)
    return [*arms, *(Arm(a, None) for a in into), *(Arm(None, b) for b in out_of)]


def centre_of(node: Node, arms: list[Arm]) -> Floats:
    """The point nearest to all axes by least squares, shape (2,) [m]."""
    left = OWN_PLACE * np.eye(2)
    right = left @ (node.x, node.y)
    for axis in (arm.axis() for arm in arms):
        along = _direction(axis)
        across = np.eye(2) - np.outer(along, along)
        left, right = left + across, right + across @ axis.mean(axis=0)
    return np.asarray(np.linalg.solve(left, right))


def bearing_of(arm: Arm, centre: Floats) -> float:
    """The bearing of an arm, as seen from the centre [degrees clockwise from north]."""
    x, y = (arm.axis() - centre).sum(axis=0)
    return round(math.degrees(math.atan2(x, y)), 2) % 360.0


def length_of(town: Town, edge: Edge, *, into: bool, most: float) -> float:
    """How far a road leads from the junction, at most `most` [m].

    It ends at the next node that is not just a bend: where more or fewer than two roads meet.
    """
    length, seen = edge.length, {edge.id}
    while length < most:
        node = edge.origin if into else edge.target
        edges = [*town.into[node], *town.out_of[node]]
        ends = {end for it in edges for end in (it.origin, it.target)} - {node}
        near = edge.target if into else edge.origin
        onward = [
            it for it in (town.into[node] if into else town.out_of[node])
            if near not in (it.origin, it.target) and it.id not in seen
        ]  # fmt: skip
        if len(ends) != 2 or len(onward) != 1:
            break
        edge = onward[0]
        seen.add(edge.id)
        length += edge.length
    return min(length, most)


def off_lane(points: Floats, start: Floats, outward: Floats) -> float:
    """The largest distance of points, shape (k, 2), from a straight lane [m].

    The lane leads from `start`, shape (2,) [m], along the unit vector `outward`, shape (2,).
    """
    apart = points - start
    return float(np.abs(apart[:, 0] * outward[1] - apart[:, 1] * outward[0]).max())


def _near(line: Floats) -> Floats:
    """Points on the first `SPAN` of a polyline."""
    at = distances_along(line)
    wanted = np.arange(0.0, min(SPAN, float(at[-1])) + SPACING / 2.0, SPACING)
    wanted = np.minimum(wanted, at[-1])
    return np.stack([np.interp(wanted, at, line[:, k]) for k in (0, 1)], axis=-1)


def _direction(points: Floats) -> Floats:
    """Unit vector along points in a row."""
    along = points[-1] - points[0]
    length = float(np.linalg.norm(along))
    return along / length if length else np.array([0.0, 1.0])


def _apart(into: Edge, out_of: Edge) -> float:
    """Angle between the roads of two edges, as they leave the node [degrees]."""
    first, second = _direction(_near(into.shape[::-1])), _direction(_near(out_of.shape))
    return math.degrees(math.acos(min(max(float(first @ second), -1.0), 1.0)))
