"""The junction as a SUMO network, built by netconvert, with our geometry to the millimetre.

Left to itself, netconvert cuts the roads and bends the turns by its own rules. We give it the shape
of the junction and of every turn, so entries, exits and arcs lie where minisim has them. Lengths
that still differ are read back (`Network`), so positions in SUMO are exact in `s`.

If the ways are netconvert's own (`Intersection.ways`, as in the published runs), it draws the
junction, with its waiting positions and its right of way, and the lengths must match the ways.
Between equal roads, rounding decides which has priority and which vehicles wait inside. So the
coordinates then start at the lower left corner, netconvert's default.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import compress
from pathlib import Path

import numpy as np

from minisim.control import Site
from minisim.errors import FileError, MissingExtraError, SumoError, extra
from minisim.junction.geometry import Intersection
from minisim.results.trajectories import lane_names

NODES, EDGES, CONNECTIONS = "minisim.nod.xml", "minisim.edg.xml", "minisim.con.xml"
NETWORK = "minisim.net.xml"

#: Decimals of the lengths written and read [m].
DIGITS = 6

#: Rounding of netconvert's own lengths [m]: it writes two decimals.
ROUNDED = 0.0151


@dataclass(frozen=True)
class Network:
    """The lengths of SUMO's lanes, in the order of `Intersection.movements` [m]."""

    approach: tuple[float, ...]  #: of the approach lane
    inside: tuple[float, ...]  #: of the way through the junction


def build_network(site: Site, folder: Path, home: Path) -> Network:
    """Write the network of the site's intersection into `folder`.

    With our arcs no vehicle has to give way: the hosted controller alone decides (`pass`, and no
    place to wait inside the junction). Turns have the road's limit: the host slows vehicles down.

    Raises:
        SumoError: netconvert refuses (the message is its own) or draws ways other than those given.
    """
    intersection = site.intersection
    write_xml(folder / NODES, "nodes", _nodes(intersection))
    write_xml(folder / EDGES, "edges", _edges(site))
    command = [
        str(home / "bin" / "netconvert"), "--node-files", NODES, "--edge-files", EDGES,
        "--output-file", NETWORK, "--no-turnarounds", "true",
        "--lefthand", str(intersection.side == "left").lower(),
    ]  # fmt: skip
    if intersection.ways is not None:
        run_tool(command, folder, home)
        return _as_given(intersection, read_network(intersection, folder / NETWORK))
    write_xml(folder / CONNECTIONS, "connections", _connections(site))
    command += ["--connection-files", CONNECTIONS, "--precision", str(DIGITS)]
    command += ["--offset.disable-normalization", "true", "--junctions.limit-turn-speed", "-1"]
    run_tool(command, folder, home)
    return read_network(intersection, folder / NETWORK)


def _as_given(intersection: Intersection, network: Network) -> Network:
    """The intersection's lengths; raises `SumoError` if netconvert's differ by more than rounding.

    One approach lane of the 3-arm junction is 1 cm longer than its siblings, for instance.
    Positions follow from the distance driven since insertion, so errors do not add up.
    """
    paths = intersection.paths
    given = Network(tuple(path.entry for path in paths), tuple(path.crossing for path in paths))
    for name, drawn, wanted in (
        ("approach", network.approach, given.approach),
        ("way", network.inside, given.inside),
    ):
        for path, its, ours in zip(paths, drawn, wanted, strict=True):
            if abs(its - ours) > ROUNDED:
                raise SumoError(
                    f"netconvert draws the {name} of {path.movement} {its:.2f} m long, the "
                    f"intersection has {ours:.2f} m: only ways that are netconvert's own can be "
                    "driven in SUMO"
                )
    return given


def run_tool(command: list[str], folder: Path, home: Path) -> None:
    """Run one of SUMO's programs in `folder`; raises `SumoError` with its error message."""
    name = Path(command[0]).name
    try:
        done = subprocess.run(
            command, cwd=folder, env=sumo_environment(home), check=False,
            capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except OSError as error:
        raise SumoError(f"cannot start {name}: {error.strerror or error}") from error
    if done.returncode:
        said = done.stderr.strip() or done.stdout.strip() or "it said nothing"
        raise SumoError(f"{name} failed (exit code {done.returncode}): {said}")


def sumo_home() -> Path:
    """SUMO's folder; raises `MissingExtraError` with the command that installs SUMO."""
    origin = None
    for package in ("libsumo", "sumo"):
        found = importlib.util.find_spec(package)
        origin = found and found.origin
        if origin is None:
            raise MissingExtraError(f"the host SUMO needs the package {package}: {extra('sumo')}")
    return Path(str(origin)).parent  # importing it would change the environment


def sumo_environment(home: Path) -> dict[str, str]:
    """The environment of SUMO's processes; no other process sees its folder."""
    return {**os.environ, "SUMO_HOME": str(home)}


def read_network(intersection: Intersection, file: Path) -> Network:
    """Read a network's lengths; raises `SumoError` if it lacks a way of `intersection`."""
    root = ET.parse(file).getroot()
    length = {lane.get("id"): float(lane.get("length", "nan")) for lane in root.iter("lane")}
    onward = {(c.get("from"), c.get("to")): c.get("via") for c in root.iter("connection")}
    approach, inside = [], []
    for path, allowed in zip(intersection.paths, intersection.allowed, strict=True):
        if not allowed:
            approach.append(path.entry - path.start)
            inside.append(path.crossing)
            continue
        first, _, last = lane_names(path.movement, path.exit_arm)
        via = onward.get((first[:-2], last[:-2]))
        if first not in length or via is None:
            raise SumoError(f"netconvert made no way for movement {path.movement}")
        way = 0.0
        while via is not None:  # an internal junction would cut the way in two
            way += length[via]
            via = onward.get((via.rpartition("_")[0], last[:-2]))
        approach.append(length[first])
        inside.append(way)
    return Network(tuple(approach), tuple(inside))


def write_xml(file: Path, root: str, lines: Iterable[str]) -> None:
    """Write lines of XML between the tags of `root`; raises `FileError`."""
    text = "\n".join([f"<{root}>", *(f"    {line}" for line in lines), f"</{root}>", ""])
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot write {file}: {error.strerror or error}") from error


def tag(name: str, attributes: Mapping[str, object]) -> str:
    """One element; the values are ours and need no escaping."""
    return " ".join([f"<{name}", *(f'{key}="{value}"' for key, value in attributes.items())]) + "/>"


def _nodes(intersection: Intersection) -> Iterable[str]:
    shape = {"shape": _outline(intersection)} if intersection.ways is None else {}
    yield tag("node", {"id": "C", "x": 0, "y": 0, "type": "priority", **shape})
    for arm, length in zip(intersection.arms, intersection.lengths, strict=True):
        x, y = (length * u for u in arm.outward)
        yield tag("node", {"id": arm.name, "x": f"{x:.9f}", "y": f"{y:.9f}", "type": "dead_end"})


def _edges(site: Site) -> Iterable[str]:
    intersection = site.intersection
    used = {"in": intersection.approaches, "out": intersection.departures}
    for k, (arm, width) in enumerate(zip(intersection.arms, intersection.lane_widths, strict=True)):
        # SUMO puts lanes beside the axis, unless it is told that they are on it.
        beside = {} if intersection.offsets[k] else {"spreadType": "center"}
        for name, origin, target in (("in", arm.name, "C"), ("out", "C", arm.name)):
            if k in used[name]:
                yield tag("edge", {
                    "id": f"{arm.name}_{name}", "from": origin, "to": target, "numLanes": 1,
                    "speed": repr(site.limit(k)), "width": repr(width), **beside,
                })  # fmt: skip


def _connections(site: Site) -> Iterable[str]:
    for path in compress(site.intersection.paths, site.intersection.allowed):
        first, _, last = lane_names(path.movement, path.exit_arm)
        yield tag("connection", {
            "from": first[:-2], "to": last[:-2],
            "fromLane": 0, "toLane": 0, "pass": "true", "keepClear": "false",
            "contPos": 0,  # no internal junction
            "speed": repr(site.limit(path.movement.origin)),
            "shape": _points(path.points),
        })  # fmt: skip


def _outline(intersection: Intersection) -> str:
    """The junction's border: a straight edge across each arm where its lanes begin and end."""
    corners = []
    for arm, half in zip(intersection.arms, intersection.half_widths, strict=True):
        outward = np.array(arm.outward)
        right = np.array([outward[1], -outward[0]]) * half
        middle = outward * intersection.junction_radius
        corners += [middle - right, middle + right]
    return _points(corners)


def _points(points: Iterable[Iterable[float]]) -> str:
    return " ".join(",".join(f"{x:.{DIGITS}f}" for x in point) for point in points)
