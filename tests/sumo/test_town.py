"""Towns that netconvert has built: their junctions, read, run in both hosts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import minisim
from baselines import AllWayStop, Reservation
from dim import Dim
from minisim.demand import Demand
from minisim.junction.roads import Road
from minisim.sumo import simulate
from minisim.sumo.network import run_tool, sumo_home
from minisim.town import read_junction, survey
from scenarios import from_bearings
from scenarios.profiles import FAIR
from scenarios.scenario import Scenario
from tests.sumo.conftest import both

#: Places of a small town [m]: a crossing, a skew one, a T, a one-way street and a bend.
NODES = {
    "a": (0, 200), "b": (210, 215), "c": (-180, 10), "d": (0, 0), "e": (190, -20), "f": (380, 30),
    "g": (-10, -210), "h": (230, -190), "i": (400, -150),
}  # fmt: skip
#: Streets, with lanes, speed and whether there is a way back.
STREETS = [
    ("a", "d", 1, 13.89, True), ("c", "d", 1, 8.33, True), ("d", "e", 1, 13.89, True),
    ("d", "g", 1, 13.89, True), ("b", "e", 1, 8.33, False), ("e", "h", 1, 8.33, False),
    ("e", "f", 1, 13.89, True), ("f", "i", 1, 13.89, True), ("g", "h", 1, 8.33, True),
    ("h", "i", 1, 8.33, True), ("a", "b", 2, 13.89, True), ("b", "f", 2, 13.89, True),
]  # fmt: skip


def town(folder: Path, *, left: bool = False) -> Path:
    """The town as netconvert draws it."""
    nodes = "".join(f'<node id="{k}" x="{x}" y="{y}"/>' for k, (x, y) in NODES.items())
    edges = ""
    for a, b, lanes, speed, back in STREETS:
        for start, end in ((a, b), (b, a))[: 1 + back]:
            edges += (
                f'<edge id="{start}{end}" from="{start}" to="{end}" numLanes="{lanes}" '
                f'speed="{speed}"/>'
            )
    (folder / "n.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "e.edg.xml").write_text(f"<edges>{edges}</edges>")
    run_tool(
        [str(sumo_home() / "bin" / "netconvert"), "--node-files", "n.nod.xml", "--edge-files",
         "e.edg.xml", "--output-file", "town.net.xml", "--lefthand", str(left).lower()],
        folder, sumo_home(),
    )  # fmt: skip
    return folder / "town.net.xml"


@pytest.mark.parametrize("left", [False, True])
def test_every_junction_of_single_lanes_is_read(tmp_path: Path, left: bool) -> None:
    every = {it.node.id: it for it in survey(town(tmp_path, left=left))}
    single = {name for name, it in every.items() if it.single}
    assert single == {"d", "e", "h"}
    assert {name for name, it in every.items() if it.intersection is not None} == single
    assert "several lanes" in every["b"].verdict
    assert all(every[name].misfit < 0.6 for name in single)
    crossing = every["d"].intersection
    assert crossing is not None
    assert crossing.side == ("left" if left else "right")
    assert crossing.bearings == pytest.approx((0.0, 96.0, 182.7, 273.2), abs=0.3)
    one_way = read_junction(tmp_path / "town.net.xml", "e")
    assert [road.traffic for road in one_way.roads or ()] == ["in", "both", "out", "both"]


OSM = """<osm version="0.6">
<bounds minlat="52.10" minlon="11.60" maxlat="52.11" maxlon="11.62"/>
<node id="1" lat="52.1050" lon="11.6100" version="1"/>
<node id="2" lat="52.1070" lon="11.6100" version="1"/>
<node id="3" lat="52.1050" lon="11.6130" version="1"/>
<node id="4" lat="52.1030" lon="11.6101" version="1"/>
<way id="7" version="1"><nd ref="2"/><nd ref="1"/><nd ref="4"/>
<tag k="highway" v="residential"/><tag k="maxspeed" v="30"/></way>
<way id="8" version="1"><nd ref="1"/><nd ref="3"/><tag k="highway" v="residential"/></way>
</osm>"""


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_extract_of_openstreetmap_is_read(tmp_path: Path, side: str) -> None:
    path = tmp_path / "town.osm"
    path.write_text(OSM)
    made = read_junction(path, "1", side)
    assert made.side == side
    # From true north, which is 2.06° off the grid's at 2.61° east of the zone's meridian. The road
    # to node 4 goes 6.8 m east over 222.6 m.
    assert made.bearings == pytest.approx((0.0, 90.0, 178.2), abs=0.1)
    assert (made.roads or ())[0].speed_limit == 8.33


def test_hosts_agree_on_roads_that_differ() -> None:
    """Lengths, limits, widths and one-way roads are the same in both."""
    roads = {
        "a": Road(length=120.0, speed_limit=8.0), "b": Road(traffic="in", lane_width=3.5),
        "c": Road(length=80.0), "d": Road(traffic="out", lane_width=2.8, speed_limit=6.0),
    }  # fmt: skip
    options: dict[str, Any] = {"profile": "fair", "horizon": 400.0, "forbidden": ("a2",)}
    for side in ("left", "right"):
        scenario = from_bearings((0, 80, 185, 270), 200.0, side=side, roads=roads, **options)
        ours, theirs = both(scenario, AllWayStop(), 1)
        done = ours.columns.arrived & theirs.columns.arrived
        assert done.sum() > 20
        for column in ("depart", "arrival", "waiting_time", "time_loss"):
            apart = getattr(ours.columns, column) - getattr(theirs.columns, column)
            assert np.abs(apart[done]).max() < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("controller", [Dim(), AllWayStop(), Reservation()], ids=lambda c: c.name)
def test_no_vehicle_collides_in_town_and_each_is_served(tmp_path: Path, controller: Any) -> None:
    """A quarter of an hour at 150 veh/h/lane, in both hosts."""
    for found in survey(town(tmp_path)):
        if found.intersection is None:
            continue
        demanded = Scenario(
            name=found.node.id, intersection=found.intersection, demand=Demand(density=150.0),
            profile=FAIR, horizon=900.0,
        )  # fmt: skip
        scenario = replace(demanded, recorded=demanded.arrivals(1), horizon=3600.0)
        for host in (minisim.simulate, simulate):
            run = host(scenario, controller, 1)  # a collision raises
            assert run.columns.arrived.all()
