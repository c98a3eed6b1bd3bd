"""What can be seen from where: bodies near the junction, and lines of sight between them.

Plain floats, since every vehicle asks about every other one ten times a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from minisim.control import Observed, Site
from minisim.junction.paths import dragged, locate, trail_of

Point = tuple[float, float]


class Body(NamedTuple):
    """Where a vehicle is: centre [m] and unit heading; and half its length and width [m]."""

    x: float
    y: float
    ux: float
    uy: float
    half_length: float
    half_width: float


class Bodies:
    """Where observed vehicles are. Bodies are seen correctly even when the intent is misread."""

    def __init__(self, site: Site) -> None:
        self._rows = site.intersection.movements.rows
        self._ways = [
            (path.points.tolist(), (*path.heading_in.tolist(), *path.heading_out.tolist()),
             path.crossing)
            for path in site.intersection.paths
        ]  # fmt: skip
        self._types = site.types
        self._trails = [
            [trail_of(path, it.rear_axle).halves.tolist() for path in site.intersection.paths]
            if it.rear_axle else []
            for it in site.types
        ]  # fmt: skip

    def body(self, vehicle: Observed) -> Body:
        """A vehicle's body, as `Path.pose` has it."""
        index, it = self._rows[vehicle.lane][vehicle.manoeuvre], self._types[vehicle.type]
        way, half = self._ways[index], it.length / 2.0
        x, y = locate(*way, -vehicle.distance)
        if it.rear_axle is not None:
            halves = self._trails[vehicle.type][index]
            ux, uy = dragged(*way, -vehicle.distance, halves, it.rear_axle)
        else:
            rear_x, rear_y = locate(*way, -vehicle.distance - it.length)
            norm = math.hypot(x - rear_x, y - rear_y)
            ux, uy = (x - rear_x) / norm, (y - rear_y) / norm
        return Body(x - ux * half, y - uy * half, ux, uy, half, it.width / 2.0)

    def hidden(self, eye: Body, target: Body, others: Iterable[Body]) -> bool:
        """Whether bodies block all lines from the eye's centre to a body's centre and corners."""
        blocking = tuple(others)
        start = (eye.x, eye.y)
        ends = self._outline(target)
        return all(any(self._crosses(start, end, body) for body in blocking) for end in ends)

    def _outline(self, body: Body) -> tuple[Point, ...]:
        x, y, ux, uy, half, wide = body
        ax, ay = ux * half, uy * half
        bx, by = -uy * wide, ux * wide
        return (
            (x, y),
            (x + ax + bx, y + ay + by), (x + ax - bx, y + ay - by),
            (x - ax + bx, y - ay + by), (x - ax - bx, y - ay - by),
        )  # fmt: skip

    def _crosses(self, start: Point, end: Point, body: Body) -> bool:
        """Whether a line from one point to another meets a body's rectangle (Liang & Barsky)."""
        x, y, ux, uy, long, wide = body
        sx, sy, dx, dy = start[0] - x, start[1] - y, end[0] - start[0], end[1] - start[1]
        first, last = 0.0, 1.0
        for at, step, half in (
            (sx * ux + sy * uy, dx * ux + dy * uy, long),
            (sy * ux - sx * uy, dy * ux - dx * uy, wide),
        ):
            if step == 0.0:
                if abs(at) > half:
                    return False
                continue
            enter, leave = sorted(((-half - at) / step, (half - at) / step))
            first, last = max(first, enter), min(last, leave)
        return first <= last
