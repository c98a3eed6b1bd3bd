"""The quick look finds every touch that pymunk does, with chords and with dragged rear axles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from minisim.arrivals import Arrivals
from minisim.control import Plan, Site
from minisim.engine.broad_phase import bodies_meet, may_touch
from minisim.engine.collision import near_bodies, touching
from minisim.engine.state import DRIVING, build_lanes, build_layout, build_vehicles
from minisim.fleet import TYPES, Fleet
from minisim.junction.geometry import Intersection
from minisim.laws import build_law
from tests.builders import pack_of

FLEET = Fleet(
    tuple(TYPES[name] for name in ("car", "bus", "bus-offtracking", "car-offtracking")),
    ((0.25,),) * 4,
)


def body(x: float, y: float, angle: float, length: float, width: float) -> Any:
    """Centre, heading, and half of the length and width, as `embody` says."""
    return np.array([x, y, math.cos(angle), math.sin(angle), length / 2.0, width / 2.0])


@pytest.mark.parametrize(("apart", "meet"), [(-1e-3, True), (1e-3, False)])
@pytest.mark.parametrize("shape", [(0.5, 0.5), (5.0, 1.8), (4.0, 4.0)])
def test_corners_meet_whatever_the_shapes(
    shape: tuple[float, float], apart: float, meet: bool
) -> None:
    """The corners of a long truck and a short body touch with their diagonals in one line."""
    truck = 30.0, 2.5
    reach = (math.hypot(*truck) + math.hypot(*shape)) / 2.0 + apart
    angles = (-math.atan2(it[1], it[0]) for it in (truck, shape))
    one, other = body(0.0, 0.0, next(angles), *truck), body(reach, 0.0, next(angles), *shape)
    assert bodies_meet(one, other) == bodies_meet(other, one) == meet


@pytest.mark.parametrize(
    ("arms", "side"), [((0.0, 90.0, 180.0, 270.0), "left"), ((0.0, 110.0, 250.0), "right")]
)
def test_it_misses_no_touch_and_asks_for_no_others(arms: tuple[float, ...], side: str) -> None:
    junction, n = Intersection(arms, side=side, lane_width=4.5, junction_radius=16.0), len(arms)
    site, random = Site(junction, FLEET, 14.0, (1.0,) * n), np.random.default_rng(n)
    layout, law, entry = (
        build_layout(site, Plan()),
        build_law(site, Plan()),
        junction.approach_length,
    )
    touches = 0
    for _ in range(40):
        manoeuvres, kinds = random.integers(1, n, n), random.choice(FLEET.names, n)
        vehicles = build_vehicles(site, Arrivals(np.zeros(n), np.arange(n), manoeuvres, type=kinds))
        lanes = build_lanes(site, vehicles, lanes_open=True)
        lanes["next"], vehicles["status"] = lanes["end"], DRIVING
        for _ in range(25):
            vehicles["s"] = entry + random.uniform(0.0, 40.0, n)
            near = near_bodies(vehicles, site)[1]
            larger = [it._replace(length=it.length + 0.1, width=it.width + 0.1) for it in near]
            pack = pack_of(vehicles, lanes, layout, law)
            said = may_touch(*pack, lanes, layout, law, np.zeros((16 * n, 6)))
            assert said or not touching(near)
            assert not said or touching(larger)
            touches += said
    assert 100 < touches < 900
