"""Kinds of turns: to the near side, straight on, to the far side."""

from __future__ import annotations

import math
from enum import IntEnum

from minisim.junction.geometry import Intersection
from minisim.junction.paths import Path

#: Less than this off straight ahead is no turn, and needs no indicator [°].
STRAIGHT = 30.0

#: Two ways whose bearings are this close to each other are equally straight [°].
SAME_ANGLE = 1e-6


class Turn(IntEnum):
    """Kind of a manoeuvre, alike on both sides of the road: near is left in left-hand traffic."""

    NEAR = 0
    THROUGH = 1
    FAR = 2


def indicator(path: Path, straight: float = STRAIGHT) -> int:
    """The side that a path turns to: −1 left, 1 right, 0 for less than `straight` [°]."""
    turn = math.degrees(path.turn)
    return 0 if abs(turn) < straight else -1 if turn > 0.0 else 1


def turns(intersection: Intersection, straight: float = STRAIGHT) -> tuple[Turn, ...]:
    """The kind of every movement, by its angle, in the order of `Intersection.movements`."""
    far = 1 if intersection.side == "left" else -1
    return tuple(Turn(1 + far * indicator(path, straight)) for path in intersection.paths)


def lane_turns(intersection: Intersection, lane: int) -> tuple[Turn, ...]:
    """The kinds of a lane's manoeuvres 1, 2, …, by their order.

    The straightest is straight on here, whatever its angle: every lane has one way that needs no
    indicator.
    """
    straight = straightest(intersection, lane)
    left, right = Turn.NEAR, Turn.FAR
    if intersection.side == "right":
        left, right = right, left
    return tuple(
        Turn.THROUGH if m == straight else left if m < straight else right
        for m in range(1, intersection.n)
    )


def straightest(intersection: Intersection, lane: int) -> int:
    """The manoeuvre of a lane that leaves straightest.

    Where two are equally straight, as on three arms 120° apart, it is the one on the left.
    """
    bearings, movements = intersection.bearings, intersection.movements

    def bend(manoeuvre: int) -> float:
        there = bearings[int(movements.exits[movements.rows[lane][manoeuvre]])]
        return abs((there - bearings[lane]) % 360.0 - 180.0)

    return min(range(1, intersection.n), key=lambda m: (round(bend(m) / SAME_ANGLE), m))
