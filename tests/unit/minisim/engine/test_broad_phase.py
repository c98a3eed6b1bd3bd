"""The quick look finds every touch that pymunk does, with chords and with dragged rear axles."""

from __future__ import annotations

import numpy as np
import pytest

from minisim.arrivals import Arrivals
from minisim.control import Plan, Site
from minisim.engine.broad_phase import may_touch
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
