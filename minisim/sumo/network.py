"""The junction as a SUMO network, built by netconvert, with our geometry to the millimetre.

By itself netconvert cuts the roads and bends the turns by its own rules. We give it the shape of
the junction and of every turn, so entries, exits and arcs lie where minisim has them. Lengths that
still differ are read back (`Network`), so positions in SUMO are exact in `s`.

If the ways are netconvert's own (`Intersection.ways`: those of the published runs), netconvert
draws the junction, with its waiting positions and its right of way. The lengths must come out as
the ways have them. Between equal roads, rounding decides which has priority and which vehicles wait
inside. So coordinates begin at the lower left corner there, which is netconvert's default.
"""

from __future__ import annotations

import os
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from minisim.errors import FileError, SumoError
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES
from minisim.results.trajectories import lane_names

NODES, EDGES, CONNECTIONS = "minisim.nod.xml", "minisim.edg.xml", "minisim.con.xml"
NETWORK = "minisim.net.xml"

#: Decimals of what is written and read [m].
DIGITS = 6

#: Rounding of netconvert's own lengths [m]: it writes two decimals.
ROUNDED = 0.0151


@dataclass(frozen=True)
class Network:
    """The lengths that SUMO's lanes got, in the order of `Intersection.movements` [m].

    Attributes:
        approach: of each movement's approach lane.
        inside: of its way through the junction.
    """

    approach: tuple[float, ...]
    inside: tuple[float, ...]


def build_network(
    intersection: Intersection, speed_limit: float, folder: Path, home: Path
) -> Network:
    """Write the network into `folder`.

    With our arcs no vehicle has to give way: a hosted controller is the only rule (`pass`, and no
    place to wait inside the junction). Turns have the road's speed limit, since the host slows
    vehicles for them.

    Raises:
        SumoError: netconvert refuses, in its own words, or draws other ways than the given ones.
    """
    ours = intersection.ways is None
    write_xml(folder / NODES, "nodes", _nodes(intersection))
    write_xml(folder / EDGES, "edges", _edges(intersection, speed_limit))
    command = [str(home / "bin" / "netconvert")]
    command += ["--node-files", NODES, "--edge-files", EDGES]
    command += ["--output-file", NETWORK, "--no-turnarounds", "true"]
    command += ["--lefthand", str(intersection.side == "left").lower()]
    if ours:
        command += ["--offset.disable-normalization", "true"]
        write_xml(folder / CONNECTIONS, "connections", _connections(intersection))
        command += ["--connection-files", CONNECTIONS, "--precision", str(DIGITS)]
        command += ["--junctions.limit-turn-speed", "-1"]
    run_tool(command, folder, home)
    network = read_network(intersection, folder / NETWORK)
    return network if ours else _as_given(intersection, network)


def _as_given(intersection: Intersection, network: Network) -> Network:
    """The lengths of the intersection; netconvert's may differ only by rounding.

    One approach lane of the 3-arm junction is 1 cm longer than its siblings, for instance.
    Positions follow from what vehicles have driven since their insertion, so errors do not add up.

    Raises:
        SumoError: netconvert draws other lengths.
    """
    paths = intersection.paths
    for path, approach, inside in zip(paths, network.approach, network.inside, strict=True):
        for name, drawn, wanted in (
            ("approach", approach, path.entry),
            ("way", inside, path.exit - path.entry),
        ):
            if abs(drawn - wanted) > ROUNDED:
                raise SumoError(
                    f"netconvert draws the {name} of {path.movement} {drawn:.2f} m long, the "
                    f"intersection has {wanted:.2f} m: only ways that are netconvert's own can be "
                    "driven in SUMO"
                )
    return Network(
        tuple(path.entry for path in paths), tuple(path.exit - path.entry for path in paths)
    )


def run_tool(command: list[str], folder: Path, home: Path) -> None:
    """Run one of SUMO's programs in `folder`; raises `SumoError` with what it says."""
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


def sumo_environment(home: Path) -> dict[str, str]:
    """The environment of SUMO's processes; no other process sees its folder."""
    return {**os.environ, "SUMO_HOME": str(home)}


def read_network(intersection: Intersection, file: Path) -> Network:
    """Read the lengths of a network; raises `SumoError` where it is not that of `intersection`."""
    root = ET.parse(file).getroot()
    length = {lane.get("id"): float(lane.get("length", "nan")) for lane in root.iter("lane")}
    onward = {(c.get("from"), c.get("to")): c.get("via") for c in root.iter("connection")}
    approach, inside = [], []
    for path in intersection.paths:
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
    for arm in intersection.arms:
        x, y = (intersection.arm_length * u for u in arm.outward)
        yield tag("node", {"id": arm.name, "x": f"{x:.9f}", "y": f"{y:.9f}", "type": "dead_end"})


def _edges(intersection: Intersection, speed_limit: float) -> Iterable[str]:
    for arm in intersection.arms:
        for name, origin, target in (("in", arm.name, "C"), ("out", "C", arm.name)):
            yield tag(
                "edge",
                {
                    "id": f"{arm.name}_{name}", "from": origin, "to": target, "numLanes": 1,
                    "speed": repr(speed_limit), "width": repr(intersection.lane_width),
                },
            )  # fmt: skip


def _connections(intersection: Intersection) -> Iterable[str]:
    for path in intersection.paths:
        yield tag(
            "connection",
            {
                "from": f"{ARM_NAMES[path.movement.origin]}_in",
                "to": f"{ARM_NAMES[path.exit_arm]}_out",
                "fromLane": 0, "toLane": 0, "pass": "true", "keepClear": "false",
                "contPos": 0,  # no internal junction
                "shape": _points(path.points),
            },
        )  # fmt: skip


def _outline(intersection: Intersection) -> str:
    """The junction's border: a straight edge across each arm where its lanes begin and end."""
    corners = []
    for arm in intersection.arms:
        outward = np.array(arm.outward)
        right = np.array([outward[1], -outward[0]]) * intersection.lane_width
        middle = outward * intersection.junction_radius
        corners += [middle - right, middle + right]
    return _points(corners)


def _points(points: Iterable[Iterable[float]]) -> str:
    return " ".join(",".join(f"{x:.{DIGITS}f}" for x in point) for point in points)
