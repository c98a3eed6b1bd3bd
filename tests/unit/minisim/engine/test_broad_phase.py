"""The quick look finds every touch that pymunk does, with chords and with dragged rear axles."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from minisim.arrivals import Arrivals
from minisim.control import Plan, Site
from minisim.engine.broad_phase import may_touch
from minisim.engine.collision import near_bodies, touching
from minisim.engine.state import DRIVING, build_lanes, build_road, build_vehicles
from minisim.fleet import TYPES, Fleet
from minisim.junction.geometry import Intersection
from minisim.laws import build_law
from scenarios.strategies import floats
from tests.builders import share

FLEET = Fleet(
    tuple(TYPES[name] for name in ("car", "bus", "bus-offtracking", "car-offtracking")),
    ((0.25,),) * 4,
)
SITES = [
    Site(
        Intersection(arms, side=side, lane_width=4.5, junction_radius=16.0),
        FLEET, 14.0, (1.0,) * len(arms),
    )
    for arms, side in (((0.0, 90.0, 180.0, 270.0), "left"), ((0.0, 110.0, 250.0), "right"))
]  # fmt: skip


@share(0.5)
@given(st.sampled_from(SITES), st.data())
def test_it_misses_no_touch_and_asks_for_no_others(site: Site, data: st.DataObject) -> None:
    n = site.intersection.n
    draw = data.draw
    manoeuvres = draw(st.lists(st.integers(1, n - 1), min_size=n, max_size=n))
    kinds = draw(st.lists(st.sampled_from(FLEET.names), min_size=n, max_size=n))
    arrivals = Arrivals(np.zeros(n), np.arange(n), np.array(manoeuvres), type=np.array(kinds))
    vehicles = build_vehicles(site, arrivals)
    lanes = build_lanes(site, vehicles, lanes_open=True)
    lanes["next"] = lanes["end"]
    vehicles["status"] = DRIVING
    entry = site.intersection.approach_length
    vehicles["s"] = entry + np.array(draw(st.lists(floats(-5.0, 45.0), min_size=n, max_size=n)))
    assume((vehicles["s"] >= entry).any())
    near = near_bodies(vehicles, site)[1]
    larger = [it._replace(length=it.length + 0.1, width=it.width + 0.1) for it in near]
    road, law = build_road(site, Plan()), build_law(site, Plan())
    said = may_touch(vehicles, lanes, road, law, np.zeros((16 * n, 6)))
    assert said or not touching(near)
    assert not said or touching(larger), "and says no more than that"
