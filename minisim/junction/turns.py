"""Kinds of turns: to the near side, straight on, or to the far side."""

from __future__ import annotations

import math
from enum import IntEnum

from minisim.junction.geometry import Intersection
from minisim.junction.paths import Path

#: A smaller angle is not a turn and needs no indicator [°].
STRAIGHT = 30.0

#: Ways whose bearings differ by less than this are equally straight [°].
SAME_ANGLE = 1e-6


class Turn(IntEnum):
    """Kind of a manoeuvre; the near side is the left in left-hand traffic."""

    NEAR = 0
    THROUGH = 1
    FAR = 2


def indicator(path: Path, straight: float = STRAIGHT) -> int:
    """The side to which a path turns: −1 left, 1 right, 0 for less than `straight` [°]."""
    turn = math.degrees(path.turn)
    return 0 if abs(turn) < straight else -1 if turn > 0.0 else 1


def turns(intersection: Intersection, straight: float = STRAIGHT) -> tuple[Turn, ...]:
    """The kind of every movement, by its angle, in the order of `Intersection.movements`."""
    far = 1 if intersection.side == "left" else -1
    return tuple(Turn(1 + far * indicator(path, straight)) for path in intersection.paths)


def lane_turns(intersection: Intersection, lane: int) -> tuple[Turn, ...]:
    """The kinds of a lane's manoeuvres 1, 2, …, by their order.

    The straightest counts as straight on, whatever its angle, so every lane has one that needs no
    indicator.
    """
    straight = straightest(intersection, lane)
    kinds = tuple(Turn)[:: 1 if intersection.side == "left" else -1]  # from left to right
    return tuple(kinds[1 + (m > straight) - (m < straight)] for m in range(1, intersection.n))


def straightest(intersection: Intersection, lane: int) -> int:
    """The straightest manoeuvre of a lane; if two are equal, as at 120°, the left one."""
    bearings, movements = intersection.bearings, intersection.movements

    def bend(manoeuvre: int) -> int:
        there = bearings[int(movements.exits[movements.rows[lane][manoeuvre]])]
        return round(abs((there - bearings[lane]) % 360.0 - 180.0) / SAME_ANGLE)

    return min(range(1, intersection.n), key=bend)
