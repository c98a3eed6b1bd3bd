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


#: How far along an arc its points are, from 0 to 1.
SHARES = np.linspace(0.0, 1.0, ARC_SEGMENTS + 1)[:, None]

#: A point of a path [m] and the unit vector along it there, shape (2,) each.
End = tuple[Floats, Floats]


def tightest(intersection: Intersection) -> float:
    """Smallest radius of the allowed paths [m]; at most 0 if one should be an arc and cannot."""
    movements, allowed = intersection.movements, intersection.allowed
    between = zip(
        movements.origins[allowed].tolist(), movements.exits[allowed].tolist(), strict=True
    )
    return min(_smallest_radius(intersection, *arms) for arms in between)


def build_paths(intersection: Intersection) -> tuple[Path, ...]:
    """One path per movement, in the order of `Intersection.movements`."""
    movements, arms = intersection.movements, range(intersection.n)
    entries, exits = ([of(intersection, arm) for arm in arms] for of in (_entry, _exit))
    return tuple(
        _build_path(intersection, movement, arm, entries[movement.origin], exits[arm])
        for movement, arm in zip(movements, movements.exits.tolist(), strict=True)
    )


def _smallest_radius(intersection: Intersection, origin: int, exit_arm: int) -> float:
    """Smallest radius of a path [m]; at most 0 if it should be one arc, and none is possible."""
    if not _mirrored(intersection, origin, exit_arm):
        return _curve(_entry(intersection, origin), _exit(intersection, exit_arm)).radius
    slope = math.tan(_half_angle(intersection, origin, exit_arm))
    offset = intersection.offsets[origin] / slope
    # From the entry to where the two lane centre lines meet.
    tangent = intersection.junction_radius + (-offset if intersection.side == "left" else offset)
    return tangent * min(abs(slope), 1e6)


def _build_path(
    intersection: Intersection, movement: Movement, exit_arm: int, enters: End, leaves: End
) -> Path:
    (start, heading_in), (end, heading_out) = enters, leaves
    entry, origin = intersection.approach_length, movement.origin

    # Clockwise turn: 0 for straight on, positive to the right.
    turn = 2.0 * _half_angle(intersection, origin, exit_arm) - math.pi
    mirrored = _mirrored(intersection, origin, exit_arm)
    straight = mirrored and abs(turn) < STRAIGHT
    radius = math.inf if straight else _smallest_radius(intersection, origin, exit_arm)
    if intersection.ways is not None:
        way = intersection.ways[intersection.index(movement)]
        length, points = way.length, way.resampled(ARC_SEGMENTS + 1)
    elif straight:
        length, points = float(np.linalg.norm(end - start)), start + (end - start) * SHARES
    elif not mirrored or radius < MIN_PATH_RADIUS - 1e-9:  # too tight only if it is not allowed
        points, length, radius = _curve(enters, leaves)
    else:
        length, angle = radius * abs(turn), SHARES * abs(turn)
        inward = math.copysign(1.0, turn) * (1.0 - np.cos(angle))
        left_in = np.array([-heading_in[1], heading_in[0]])
        points = start + radius * (np.sin(angle) * heading_in - inward * left_in)
        points[-1] = end
    before, behind = (intersection.lengths[arm] - intersection.junction_radius
                      for arm in (origin, exit_arm))  # fmt: skip
    return Path(
        movement, exit_arm, entry=entry, exit=entry + length, length=entry + length + behind,
        radius=radius, points=points, heading_in=heading_in, heading_out=heading_out,
        start=entry - before,
    )  # fmt: skip


def _half_angle(intersection: Intersection, origin: int, exit_arm: int) -> float:
    """Half the clockwise angle from the arm of origin to the arm of exit [rad]."""
    bearings = intersection.bearings
    return math.radians((bearings[exit_arm] - bearings[origin]) % 360.0) / 2.0


def _mirrored(intersection: Intersection, origin: int, exit_arm: int) -> bool:
    """Whether the lanes mirror each other, so that one arc joins them."""
    return intersection.offsets[origin] == intersection.offsets[exit_arm]


def _entry(intersection: Intersection, arm: int) -> End:
    """Where the approach lane of an arm ends."""
    heading = -np.array(intersection.arms[arm].outward)
    return _beside(intersection, arm, -heading * intersection.junction_radius, heading), heading


def _exit(intersection: Intersection, arm: int) -> End:
    """Where the exit lane of an arm begins."""
    heading = np.array(intersection.arms[arm].outward)
    return _beside(intersection, arm, heading * intersection.junction_radius, heading), heading


def _beside(intersection: Intersection, arm: int, axis: Floats, heading: Floats) -> Floats:
    """The middle of the lane that leads along `heading`, beside a point of its road's axis."""
    keep = 1.0 if intersection.side == "left" else -1.0
    left = np.array([-heading[1], heading[0]])
    return np.asarray(axis + left * (keep * intersection.offsets[arm]))


def _curve(enters: End, leaves: End) -> Curve:
    return join(*enters, *leaves, ARC_SEGMENTS + 1)
