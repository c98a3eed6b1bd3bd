"""The path of a movement, from the geometry of its junction.

If the two lanes mirror each other, as on equal roads, the way through is one arc, or straight.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from minisim.junction.curves import Curve, join
from minisim.junction.movements import Movement
from minisim.junction.paths import ARC_SEGMENTS, Floats, Path

if TYPE_CHECKING:
    from minisim.junction.geometry import Intersection

#: Smallest radius of a path that a car can follow [m]: passenger cars turn within 5–6 m (AASHTO
#: Green Book, design vehicle P: centre-line radius 6.4 m); the authors' 5-arm network has 4.5 m.
MIN_PATH_RADIUS = 4.0

#: Turns smaller than this are straight [rad].
STRAIGHT = 1e-4


def smallest_radius(intersection: Intersection, movement: Movement) -> float:
    """Smallest radius of a path [m]; at most 0 if it should be one arc, and none is possible."""
    if not _mirrored(intersection, movement):
        return _curve(intersection, movement).radius
    half = _half_angle(intersection, movement)
    slope = math.tan(half)
    offset = intersection.offsets[movement.origin] / slope
    # From the entry to where the two lane centre lines meet.
    tangent = intersection.junction_radius + (-offset if intersection.side == "left" else offset)
    return tangent * min(abs(slope), 1e6)


def build_path(intersection: Intersection, movement: Movement) -> Path:
    """The path of a movement."""
    exit_arm, entry = intersection.exit_arm(movement), intersection.approach_length
    start, heading_in, end, heading_out = _ends(intersection, movement)

    # Clockwise turn: 0 for straight on, positive to the right.
    turn = 2.0 * _half_angle(intersection, movement) - math.pi
    mirrored = _mirrored(intersection, movement)
    straight = mirrored and abs(turn) < STRAIGHT
    radius = math.inf if straight else smallest_radius(intersection, movement)
    t = np.linspace(0.0, 1.0, ARC_SEGMENTS + 1)[:, None]
    if intersection.ways is not None:
        way = intersection.ways[intersection.index(movement)]
        length, points = way.length, way.resampled(ARC_SEGMENTS + 1)
    elif straight:
        length, points = float(np.linalg.norm(end - start)), start + (end - start) * t
    elif not mirrored or radius < MIN_PATH_RADIUS - 1e-9:  # too tight only if it is not allowed
        points, length, radius = _curve(intersection, movement)
    else:
        length, angle = radius * abs(turn), t * abs(turn)
        inward = math.copysign(1.0, turn) * (1.0 - np.cos(angle))
        left_in = np.array([-heading_in[1], heading_in[0]])
        points = start + radius * (np.sin(angle) * heading_in - inward * left_in)
        points[-1] = end
    roads = [length - intersection.junction_radius for length in intersection.lengths]
    return Path(
        movement, exit_arm, entry=entry, exit=entry + length,
        length=entry + length + roads[exit_arm], radius=radius, points=points,
        heading_in=heading_in, heading_out=heading_out, start=entry - roads[movement.origin],
    )  # fmt: skip


def _half_angle(intersection: Intersection, movement: Movement) -> float:
    """Half the clockwise angle from the arm of origin to the arm of exit [rad]."""
    bearings = intersection.bearings
    to = bearings[intersection.exit_arm(movement)]
    return math.radians((to - bearings[movement.origin]) % 360.0) / 2.0


def _mirrored(intersection: Intersection, movement: Movement) -> bool:
    """Whether the lanes mirror each other, so that one arc joins them."""
    offsets = intersection.offsets
    return offsets[movement.origin] == offsets[intersection.exit_arm(movement)]


def _ends(intersection: Intersection, movement: Movement) -> tuple[Floats, Floats, Floats, Floats]:
    """Position and unit heading at the entry, and at the exit."""
    exit_arm, arms = intersection.exit_arm(movement), intersection.arms
    heading_in = -np.array(arms[movement.origin].outward)
    heading_out = np.array(arms[exit_arm].outward)
    left_in, left_out = (np.array([-y, x]) for x, y in (heading_in, heading_out))
    keep = 1.0 if intersection.side == "left" else -1.0
    offset, offset_out = (keep * intersection.offsets[k] for k in (movement.origin, exit_arm))
    start = -heading_in * intersection.junction_radius + left_in * offset
    end = heading_out * intersection.junction_radius + left_out * offset_out
    return start, heading_in, end, heading_out


def _curve(intersection: Intersection, movement: Movement) -> Curve:
    return join(*_ends(intersection, movement), ARC_SEGMENTS + 1)
