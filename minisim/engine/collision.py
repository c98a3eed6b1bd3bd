"""Collisions: pymunk decides which bodies overlap, and `Collision` reports it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pymunk

from minisim.control import Site
from minisim.engine.state import DRIVING, Records, Road


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


def collisions_now(vehicles: Records, road: Road, site: Site, time: float) -> list[Collision]:
    """All collisions at this moment: near the junction pymunk decides, within a lane the gap."""
    rows, bodies = near_bodies(vehicles, site)
    pairs = [(rows[i], rows[j]) for i, j in touching(bodies)]
    pairs += _overlaps_in_lane(vehicles, road, site.vehicle.length)
    movements = site.intersection.movements
    collisions = []
    for pair in pairs:
        first, second = sorted((vehicles[row] for row in pair), key=lambda it: int(it["id"]))
        collisions.append(
            Collision(
                time=time,
                vehicles=(int(first["id"]), int(second["id"])),
                movements=(str(movements[first["path"]]), str(movements[second["path"]])),
                positions=(float(first["s"]), float(second["s"])),
                speeds=(float(first["v"]), float(second["v"])),
            )
        )
    return collisions


def near_bodies(vehicles: Records, site: Site) -> tuple[list[int], list[Body]]:
    """Rows and bodies of all vehicles in and near the junction."""
    paths, length, width = site.intersection.paths, site.vehicle.length, site.vehicle.width
    rows, bodies = [], []
    for i in np.flatnonzero(vehicles["status"] == DRIVING).tolist():
        path, s = paths[vehicles["path"][i]], float(vehicles["s"][i])
        if path.entry - length <= s <= path.exit + 2 * length:
            centre, heading = path.pose(s, length)
            rows.append(i)
            (x, y), (ux, uy) = centre.tolist(), heading.tolist()
            bodies.append(Body(x, y, ux, uy, length, width))
    return rows, bodies


def _overlaps_in_lane(vehicles: Records, road: Road, length: float) -> list[tuple[int, int]]:
    """Rows of the vehicles whose front has reached the rear of the one ahead."""
    s, path, lane = vehicles["s"], vehicles["path"], vehicles["lane"]
    driving = vehicles["status"] == DRIVING
    exits, branch = road.ends[:, 0], road.branch
    pairs = []
    for i in np.flatnonzero(driving).tolist():
        p = path[i]
        for j in np.flatnonzero(driving[:i] & (lane[:i] == lane[i])).tolist():
            rear = s[j] - length
            if rear <= s[i] and rear < branch[path[j], p]:
                pairs.append((j, i))
        j = int(vehicles["ahead"][i])
        on_exit = j >= 0 and driving[j] and s[i] >= exits[p]
        if on_exit and s[j] - length - exits[path[j]] <= s[i] - exits[p]:
            pairs.append((j, i))
    return pairs


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
