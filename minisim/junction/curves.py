"""A curve between two lanes that do not mirror each other, for instance of different widths."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from minisim.junction.paths import Floats, distances_along

#: Points by which a curve is measured: its length is right to a part in 10⁵.
FINE = 257


class Curve(NamedTuple):
    """A smooth curve."""

    points: Floats  #: equally spaced along it [m], shape (count, 2)
    length: float  #: [m]
    radius: float  #: the smallest [m]; infinite if it is straight


def join(start: Floats, heading_in: Floats, end: Floats, heading_out: Floats, count: int) -> Curve:
    """The curve from `start` to `end`, shape (2,) each [m], with these unit headings there.

    It is the one of two whose smallest radius is larger. The first is an arc with a straight piece
    before or behind it, possible if the lines of the lanes meet between their ends. The second is a
    cubic Bézier curve, an S if the lanes are nearly opposite. The curve has `count` points.
    """
    across, turn = _cross(heading_in, heading_out), _angle(heading_in, heading_out)
    chord = end - start
    if abs(turn) < 1e-9 and abs(_cross(heading_in, chord)) < 1e-9:
        return Curve(np.linspace(start, end, count), float(np.linalg.norm(chord)), math.inf)
    points, radius = _bezier(start, heading_in, end, heading_out, turn)
    if abs(across) > 1e-6:
        before, behind = _cross(chord, heading_out) / across, _cross(heading_in, chord) / across
        tangent = min(before, behind)
        if tangent / math.tan(abs(turn) / 2.0) > radius:
            radius = tangent / math.tan(abs(turn) / 2.0)
            first = start + heading_in * (before - tangent)
            left = np.array([-heading_in[1], heading_in[0]])
            t = np.linspace(0.0, turn, FINE)[:, None]
            inward = math.copysign(1.0, turn) * (1.0 - np.cos(t)) * left
            arc = first + radius * (np.sin(np.abs(t)) * heading_in + inward)
            points = np.vstack([start, arc, end])
    at = distances_along(points)
    wanted = np.linspace(0.0, at[-1], count)
    even = np.stack([np.interp(wanted, at, points[:, k]) for k in (0, 1)], axis=-1)
    return Curve(even, float(at[-1]), radius)


def _bezier(
    start: Floats, heading_in: Floats, end: Floats, heading_out: Floats, turn: float
) -> tuple[Floats, float]:
    """`FINE` points of a cubic Bézier curve, and its smallest radius [m].

    Its handles are as long as those that make nearly a circle of lanes that mirror each other.
    """
    reach = float(np.linalg.norm(end - start)) / (3.0 * math.cos(turn / 4.0) ** 2)
    p, q, r, s = start, start + reach * heading_in, end - reach * heading_out, end
    t = np.linspace(0.0, 1.0, FINE)[:, None]
    u = 1.0 - t
    points = u**3 * p + 3 * u**2 * t * q + 3 * u * t**2 * r + t**3 * s
    first = 3 * u**2 * (q - p) + 6 * u * t * (r - q) + 3 * t**2 * (s - r)
    second = 6 * u * (r - 2 * q + p) + 6 * t * (s - 2 * r + q)
    bend = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    speed = np.linalg.norm(first, axis=1)
    with np.errstate(divide="ignore"):
        return points, float((speed**3 / bend).min())


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _angle(a: Floats, b: Floats) -> float:
    """By how much b is turned to the left of a [rad]."""
    return math.atan2(_cross(a, b), float(a @ b))
