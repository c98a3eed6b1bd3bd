"""SUMO's junction foes as an oracle for the harmony matrix.

netconvert marks two ways through a junction as foes when they cross or merge, by the order of the
roads around it and by the lines it draws. Ours says conflict when the corridors that bodies sweep
come within a clearance. Both are asked about every two movements of different arms, on random
junctions of 3 … 6 arms, on both sides of the road, drawn twice: as the host draws them (the same
arcs as ours), and as netconvert would draw them itself.

Every disagreement must fall into a class whose rule is computed from the geometry.
"""

from __future__ import annotations

import itertools
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import shapely
from hypothesis import given, settings

from dim import HarmonyMatrix
from minisim.control import Site
from minisim.junction.conflicts import CLEARANCE, separation
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES, Movement
from minisim.sumo import network
from minisim.vehicle import VehicleType
from scenarios.strategies import intersections

#: The classes of pairs on which the two agree, and on which they do not.
FREE = "agree: harmony, no foes"
CROSS = "agree: conflict, foes that cross"
MERGE = "agree: conflict, foes that merge"
NEAR = "ours is stricter: corridors apart, but within the clearance"
BENT = "SUMO is stricter: it draws the ways closer than a lane is wide"


@dataclass(frozen=True)
class Oracle:
    """A junction in SUMO: its foes, and the lines of the ways through it."""

    links: dict[Movement, int]
    foes: dict[int, str]
    lines: dict[Movement, shapely.LineString]

    def are_foes(self, first: Movement, second: Movement) -> bool:
        """Whether at least one of them has to mind the other: bits are counted from the right."""
        i, j = self.links[first], self.links[second]
        return "1" in (self.foes[i][-1 - j], self.foes[j][-1 - i])


def read_oracle(intersection: Intersection, file: Path) -> Oracle:
    """Read foes; sumolib, which has its own reader, must count links and foes alike."""
    sumolib = pytest.importorskip("sumolib")
    root = ET.parse(file).getroot()
    shapes = {lane.get("id"): lane.get("shape", "") for lane in root.iter("lane")}
    vias = {(c.get("from"), c.get("to")): c.get("via") for c in root.iter("connection")}
    net = sumolib.net.readNet(str(file))
    node = net.getNode("C")
    links, lines = {}, {}
    for path in intersection.paths:
        first, last = f"{ARM_NAMES[path.movement.origin]}_in", f"{ARM_NAMES[path.exit_arm]}_out"
        (connection,) = net.getEdge(first).getConnections(net.getEdge(last))
        links[path.movement] = node.getLinkIndex(connection)
        points, via = [], vias[first, last]
        while via is not None:  # an internal junction cuts the way in two
            points += [tuple(map(float, p.split(",")[:2])) for p in shapes[via].split()]
            via = vias.get((via.rpartition("_")[0], last))
        lines[path.movement] = shapely.LineString(points)
    foes = {int(r.attrib["index"]): r.attrib["foes"] for r in root.iter("request")}
    assert sorted(links.values()) == sorted(foes)
    for i, j in itertools.combinations(foes, 2):
        assert node.areFoes(i, j) == (foes[i][-1 - j] == "1")
    return Oracle(links, foes, lines)


def site_of(intersection: Intersection) -> Site:
    return Site(intersection, VehicleType(), 14.0, (0.0,) * intersection.n)


def as_hosted(intersection: Intersection, folder: Path) -> None:
    """The network that SUMO as a host drives on."""
    network.build_network(site_of(intersection), folder, network.sumo_home())


def as_netconvert_draws_it(intersection: Intersection, folder: Path) -> None:
    """The same roads, but entries and ways through the junction are netconvert's."""
    nodes = (line.split(" shape=")[0].rstrip("/>") + "/>" for line in network._nodes(intersection))
    network.write_xml(folder / network.NODES, "nodes", nodes)
    network.write_xml(folder / network.EDGES, "edges", network._edges(site_of(intersection)))
    command = [str(network.sumo_home() / "bin" / "netconvert"), "--no-turnarounds", "true"]
    command += ["--node-files", network.NODES, "--edge-files", network.EDGES]
    command += ["--output-file", network.NETWORK]
    command += ["--lefthand", str(intersection.side == "left").lower()]
    network.run_tool(command, folder, network.sumo_home())


def oracle_of(intersection: Intersection, build: Callable[[Intersection, Path], None]) -> Oracle:
    with tempfile.TemporaryDirectory() as name:
        build(intersection, Path(name))
        return read_oracle(intersection, Path(name) / network.NETWORK)


def classes(intersection: Intersection, oracle: Oracle) -> Iterator[tuple[str, str]]:
    """The class of every two movements of different arms, and the pair."""
    vehicle = VehicleType()
    harmony = HarmonyMatrix.from_geometry(intersection, vehicle)
    apart_by = separation(intersection, vehicle)
    for a, b in itertools.combinations(intersection.movements, 2):
        if a.origin == b.origin:
            continue
        apart = float(apart_by[intersection.index(a), intersection.index(b)])
        ours = [shapely.LineString(intersection.path(m).points) for m in (a, b)]
        merge = intersection.exit_arm(a) == intersection.exit_arm(b)
        match harmony.harmony(a, b), oracle.are_foes(a, b):
            case True, False:
                kind = FREE
            case False, True:
                kind = MERGE if merge else CROSS
            case False, False if 0.0 < apart <= CLEARANCE and not ours[0].intersects(ours[1]):
                kind = NEAR
            case True, True if (
                oracle.lines[a].distance(oracle.lines[b])
                < intersection.lane_width
                < ours[0].distance(ours[1])
            ):
                kind = BENT
            case _:
                kind = "unclassified"
        yield kind, f"{a}–{b} of {intersection}"


def count(
    geometries: int, build: Callable[[Intersection, Path], None]
) -> tuple[Counter[str], list[str]]:
    """How many pairs are in each class, over so many junctions, and what is in none."""
    counts: Counter[str] = Counter()
    unclassified = []

    @settings(max_examples=geometries)
    @given(intersections())
    def ask(intersection: Intersection) -> None:
        counts["junctions"] += 1
        for kind, pair in classes(intersection, oracle_of(intersection, build)):
            counts[kind] += 1
            if kind == "unclassified":
                unclassified.append(pair)

    ask()
    for kind, pairs in counts.most_common():
        print(f"{pairs:>7} {kind}")  # noqa: T201  (shown by pytest -s)
    return counts, unclassified


@pytest.mark.parametrize("geometries", [12, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize("build", [as_hosted, as_netconvert_draws_it])
def test_foes_are_our_conflicts(
    build: Callable[[Intersection, Path], None], geometries: int
) -> None:
    counts, unclassified = count(geometries, build)
    assert unclassified == []
    assert build is not as_hosted or counts[BENT] == 0, "the same lines leave no room for it"
    assert min(counts[FREE], counts[CROSS], counts[MERGE]) > 10 * geometries
    assert counts["junctions"] >= geometries


def test_corridors_that_nearly_touch_are_our_conflict_alone() -> None:
    """On narrow lanes a near turn passes the far turn that comes back at less than that."""
    narrow = Intersection((0.0, 90.0, 180.0, 270.0), lane_width=2.8, junction_radius=5.8)
    found = list(classes(narrow, oracle_of(narrow, as_hosted)))
    near = {pair.split(" ")[0] for kind, pair in found if kind == NEAR}
    assert near == {"a1–b3", "b1–c3", "c1–d3", "a3–d1"}
    assert "unclassified" not in dict(found)


def test_the_far_turns_of_the_paper_are_the_ones_that_the_radius_decides() -> None:
    """The paper's matrix lets a3 and c3, b3 and d3 go together; SUMO's default radius does not."""
    four = Intersection((0.0, 90.0, 180.0, 270.0))
    found = {}
    for build in (as_hosted, as_netconvert_draws_it):
        oracle, paper = oracle_of(four, build), HarmonyMatrix.paper(4)
        found[build] = {
            f"{a}{b}"
            for a, b in itertools.combinations(four.movements, 2)
            if a.origin != b.origin and paper.harmony(a, b) == oracle.are_foes(a, b)
        }
    assert found[as_hosted] == set()
    assert found[as_netconvert_draws_it] == {"a3c3", "b3d3"}
