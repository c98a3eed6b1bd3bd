"""Collisions: pymunk decides which bodies overlap, and `Collision` reports it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pymunk

from minisim.control import Site
from minisim.engine.state import DRIVING, Layout, Records


class Body(NamedTuple):
    """An oriented rectangle: centre [m], unit heading, length and width [m]."""

    x: float
    y: float
    ux: float
    uy: float
    length: float
    width: float


class Collision(NamedTuple):
    """Two vehicles touched."""

    time: float  #: [s]
    vehicles: tuple[int, int]  #: their ids (rows of the trip table), the smaller one first
    movements: tuple[str, str]  #: of both, such as ("a2", "c3")
    positions: tuple[float, float]  #: `s` of both front bumpers [m], see `minisim.junction.paths`
    speeds: tuple[float, float]  #: [m/s]

    def __str__(self) -> str:
        one, other = (
            f"vehicle {vehicle} ({movement}, at {s:.1f} m, {v:.1f} m/s)"
            for vehicle, movement, s, v in zip(*self[1:], strict=True)
        )
        return f"at {self.time:.1f} s {one} and {other} touched"


def collisions_now(vehicles: Records, layout: Layout, site: Site, time: float) -> list[Collision]:
    """All collisions at this moment: pymunk decides near the junction, the gap within a lane."""
    rows, bodies = near_bodies(vehicles, site)
    pairs = [(rows[i], rows[j]) for i, j in touching(bodies)]
    pairs += _overlaps_in_lane(vehicles, layout)
    names = site.intersection.movements.names
    collisions = []
    for pair in pairs:
        both = sorted(vehicles[["id", "path", "s", "v"]][list(pair)].tolist())
        columns = ((id, names[path], s, v) for id, path, s, v in both)
        collisions.append(Collision(time, *zip(*columns, strict=True)))
    return collisions


def near_bodies(vehicles: Records, site: Site) -> tuple[list[int], list[Body]]:
    """Rows and bodies of all vehicles in and near the junction."""
    paths, longest = site.intersection.paths, site.vehicle.length
    rows, bodies = [], []
    for i in np.flatnonzero(vehicles["status"] == DRIVING).tolist():
        path, s = paths[vehicles["path"][i]], float(vehicles["s"][i])
        it = site.types[vehicles["type"][i]]
        if path.entry - longest <= s <= path.exit + 2 * it.length:
            centre, heading = path.pose(s, it)
            rows.append(i)
            (x, y), (ux, uy) = centre.tolist(), heading.tolist()
            bodies.append(Body(x, y, ux, uy, it.length, it.width))
    return rows, bodies


def _overlaps_in_lane(vehicles: Records, layout: Layout) -> list[tuple[int, int]]:
    """Row pairs (j, i) in which the front of vehicle i has reached the rear of j ahead of it."""
    s, path, lane = vehicles["s"], vehicles["path"], vehicles["lane"]
    rears = s - vehicles["length"]
    driving = vehicles["status"] == DRIVING
    exits, branch = layout.ends[:, 0], layout.branch
    pairs = []
    for i in np.flatnonzero(driving).tolist():
        p = path[i]
        for j in np.flatnonzero(driving[:i] & (lane[:i] == lane[i])).tolist():
            rear = rears[j]
            if rear <= s[i] and rear < branch[path[j], p]:
                pairs.append((j, i))
        j = int(vehicles["ahead"][i])
        on_exit = j >= 0 and driving[j] and s[i] >= exits[p]
        if on_exit and rears[j] - exits[path[j]] <= s[i] - exits[p]:
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
