"""Collisions: pymunk decides which bodies overlap, and `Collision` reports it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import pymunk


class Body(NamedTuple):
    """An oriented rectangle: centre [m], unit heading, length and width [m]."""

    x: float
    y: float
    ux: float
    uy: float
    length: float
    width: float


class Collision(NamedTuple):
    """Two vehicles touched.

    Attributes:
        time: [s].
        vehicles: their ids (rows of the trip table), the smaller one first.
        movements: of both, such as ("a2", "c3").
        positions: front bumpers, from the road entry [m].
        speeds: [m/s].
    """

    time: float
    vehicles: tuple[int, int]
    movements: tuple[str, str]
    positions: tuple[float, float]
    speeds: tuple[float, float]

    def __str__(self) -> str:
        both = " and ".join(
            f"vehicle {v} ({m}, at {s:.1f} m, {speed:.1f} m/s)"
            for v, m, s, speed in zip(
                self.vehicles, self.movements, self.positions, self.speeds, strict=True
            )
        )
        return f"at {self.time:.1f} s {both} touched"


def touching(bodies: Sequence[Body]) -> list[tuple[int, int]]:
    """Index pairs (i < j) of the bodies that overlap or touch."""
    space = pymunk.Space()
    index: dict[pymunk.Shape, int] = {}
    pairs = set()
    for j, body in enumerate(bodies):
        carrier, shape = _rectangle(body)
        # The query comes before the body is added, so it finds earlier bodies only.
        pairs |= {(index[hit.shape], j) for hit in space.shape_query(shape) if hit.shape}
        space.add(carrier, shape)
        index[shape] = j
    return sorted(pairs)


def _rectangle(body: Body) -> tuple[pymunk.Body, pymunk.Poly]:
    carrier = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    carrier.position = body.x, body.y
    carrier.angle = math.atan2(body.uy, body.ux)
    return carrier, pymunk.Poly.create_box(carrier, (body.length, body.width))
