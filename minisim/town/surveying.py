"""What the simulator makes of a node: an intersection, or the reason why it cannot make one."""

from __future__ import annotations

import difflib
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from minisim.control import Site
from minisim.errors import FileError, InputError, instance, plural, show
from minisim.files import AnyPath
from minisim.fleet import Fleet
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES, movements_of
from minisim.junction.paths import Floats
from minisim.junction.roads import Road
from minisim.town.arms import Arm, arms_of, bearing_of, centre_of, length_of, off_lane
from minisim.town.reading import Node, Town, read_town
from minisim.vehicle import VehicleType

#: The longest road [m], which is also the usual arm_length.
LONGEST = 500.0
#: The shortest approach lane [m], even if the next junction is nearer: DIM's zones take 38 m, and a
#: bus of 12 m has to fit before them.
SHORTEST = 60.0
#: Lane widths that `Road` allows [m].
WIDTHS = (2.0, 6.0)
#: By how much the junction's radius is raised at a time until cars can turn [m].
WIDENING = 0.5
#: What must be able to turn and pass: the usual car.
CAR = Fleet((VehicleType(),))


class Survey(NamedTuple):
    """A node, and what the simulator makes of it."""

    node: Node
    arms: tuple[Arm, ...]  #: clockwise from north: a, b, c, …
    intersection: Intersection | None  #: None if it cannot be simulated
    problem: str = ""  #: why not
    notes: tuple[str, ...] = ()  #: what is different from the network
    misfit: float = 0.0  #: largest distance of a lane near the junction from its modelled lane [m]

    @property
    def single(self) -> bool:
        """Whether it has 3 or more arms, and one lane for cars per direction on each."""
        return len(self.arms) >= 3 and all(it.lanes == 1 for arm in self.arms for it in arm.edges)

    @property
    def verdict(self) -> str:
        """The outcome in one line."""
        if self.intersection is None:
            return self.problem
        return "; ".join([f"lanes at most {self.misfit:.1f} m from the network's", *self.notes])


def read_junction(path: AnyPath, node: str | None = None, side: str | None = None) -> Intersection:
    """The intersection at a node of a network or of an extract of OpenStreetMap.

    Arguments and errors are those of `survey_of`.
    """
    made = survey_of(path, node, side).intersection
    assert made is not None
    return made


def survey_of(path: AnyPath, node: str | None = None, side: str | None = None) -> Survey:
    """What the simulator makes of one node.

    Args:
        path: SUMO's network (.net.xml, perhaps packed by gzip), or an extract (.osm).
        node: the node's id; None if the file has only one that can be read.
        side: on which an extract's traffic drives, "left" or "right" (the default); a network
            says so itself.

    Raises:
        FileError: unreadable, too large, broken or hostile XML, or neither network nor extract.
        MissingExtraError: an extract, and netconvert is not installed.
        SumoError: netconvert refuses the extract.
        InputError: no such node (with similar ids), or one that cannot be simulated, and why.
    """
    town = town_of(path, side)
    if node is not None:
        instance("node", node, str)
        if node not in town.nodes:
            close = difflib.get_close_matches(node, town.nodes, n=3)
            near = f"; did you mean {' or '.join(map(repr, close))}?" if close else ""
            raise InputError(
                f"no node {show(node)} among the {len(town.nodes)} of {path}{near} "
                f"(minisim junction --list names them)"
            )
        found = survey_node(town, node)
    else:
        every = list(_surveys(town))
        possible = [it for it in every if it.intersection is not None]
        if len(possible) != 1:
            count, whole = len(possible), plural(len(every), "node")
            told = f"{count} of its {whole} can be read; name one with node"
            told = told if possible else f"none of its {whole} can be read"
            raise InputError(f"{path}: {told} (minisim junction --list names them and says why)")
        found = possible[0]
    if found.intersection is None:
        raise InputError(f"node {found.node.id} of {path} cannot be read: {found.problem}")
    return found


def survey(path: AnyPath, side: str | None = None) -> tuple[Survey, ...]:
    """What the simulator makes of every node; raises as `survey_of`, but for single nodes."""
    return tuple(_surveys(town_of(path, side)))


def _surveys(town: Town) -> Iterator[Survey]:
    return (survey_node(town, node) for node in town.nodes)


def town_of(path: AnyPath, side: str | None = None) -> Town:
    """A network as it is, or an extract as netconvert makes it one; raises as `survey_of`."""
    town = read_town(path)
    if town is not None:
        if not town.nodes:
            raise FileError(f"{path} has no nodes")
        if side is not None:
            raise InputError("side is for an extract of OpenStreetMap: a network knows its own")
        return town
    from minisim.sumo.network import run_tool, sumo_home

    home = sumo_home()
    with tempfile.TemporaryDirectory(prefix="minisim-town-") as folder:
        run_tool([
            str(home / "bin" / "netconvert"), "--osm-files", str(Path(path).absolute()),
            "--output-file", "town.net.xml", "--lefthand", str(side == "left").lower(),
            "--geometry.remove", "true", "--junctions.join", "true", "--no-turnarounds", "true",
            "--keep-edges.by-vclass", "passenger",
        ], Path(folder), home)  # fmt: skip
        town = read_town(Path(folder) / "town.net.xml")
        assert town is not None
        return town


def survey_node(town: Town, node: str) -> Survey:
    """What the simulator makes of one node, which is one of `town.nodes`."""
    place, arms = town.nodes[node], arms_of(town, node)
    if len(arms) < 3:
        problem = f"{plural(len(arms), 'arm') if arms else 'no arms'} for cars; 3 are needed"
        return Survey(place, tuple(arms), None, problem)
    if len(arms) > len(ARM_NAMES):
        return Survey(place, tuple(arms), None, f"{len(arms)} arms; at most {len(ARM_NAMES)}")
    centre = centre_of(place, arms)
    arms.sort(key=lambda arm: bearing_of(arm, centre))
    many = [f"{it.id} has {it.lanes}" for arm in arms for it in arm.edges if it.lanes > 1]
    if many:
        problem = f"several lanes for cars on an edge: {', '.join(many)}"
        return Survey(place, tuple(arms), None, problem)
    try:
        intersection, notes = _modelled(town, node, arms, centre)
    except InputError as error:
        return Survey(place, tuple(arms), None, str(error))
    misfit = _misfit(intersection, arms, centre)
    return Survey(place, tuple(arms), intersection, notes=tuple(notes), misfit=misfit)


def _modelled(
    town: Town, node: str, arms: list[Arm], centre: Floats
) -> tuple[Intersection, list[str]]:
    """The intersection, and where it differs from the network."""
    notes = list(_notes(town, node, arms))
    ends = [float(np.linalg.norm(arm.axis()[0] - centre)) for arm in arms]  # where lanes begin
    given: dict[str, Any] = {
        "bearings": [bearing_of(arm, centre) for arm in arms],
        "side": "left" if town.left else "right",
        "forbidden": _forbidden(town, arms),
    }
    measured = max(round(sum(ends) / len(ends), 2), WIDENING)
    made = _widened(town, arms, measured, given)
    if made.junction_radius > measured:
        notes.append(
            f"junction radius {made.junction_radius:g} m instead of {measured:g} m, for cars to "
            "turn and pass"
        )
    short = [
        f"{name} ({_reach(town, arm):.0f} m)"
        for name, arm in zip(ARM_NAMES, arms, strict=False)
        if _reach(town, arm) < SHORTEST - 0.5
    ]
    if short:
        notes.append(f"roads lengthened to {SHORTEST:g} m: {', '.join(short)}")
    return made, notes


def _widened(town: Town, arms: list[Arm], measured: float, given: dict[str, Any]) -> Intersection:
    """The intersection with the measured radius, or the smallest larger one at which cars fit."""
    largest = Intersection(given["bearings"], arm_length=20_000.0).junction_radius
    radius = measured
    while True:
        roads = [_road(town, arm, radius) for arm in arms]
        try:
            made = Intersection(junction_radius=radius, roads=roads, **given)
            Site(made, CAR, 1.0, (0.0,) * made.n)
        except InputError:
            if radius > largest:
                raise
            radius = round(radius + WIDENING, 2)
        else:
            return made


def _reach(town: Town, arm: Arm) -> float:
    """Length of an arm's road up to the next junction [m]."""
    return length_of(town, arm.main, into=arm.into is not None, most=LONGEST)


def _road(town: Town, arm: Arm, radius: float) -> Road:
    length = min(max(_reach(town, arm), SHORTEST) + radius, LONGEST)
    low, high = WIDTHS
    return Road(
        length=round(length, 1), speed_limit=round(arm.main.speed, 2),
        lane_width=min(max(arm.main.width, low), high), traffic=arm.traffic,
    )  # fmt: skip


def _forbidden(town: Town, arms: list[Arm]) -> list[str]:
    """The movements whose lanes exist, but without a connection between them."""
    missing, movements = [], movements_of(len(arms))
    for movement, exit_arm in zip(movements, movements.exits.tolist(), strict=True):
        into, out_of = arms[movement.origin].into, arms[exit_arm].out_of
        if into and out_of and (into.id, out_of.id) not in town.turns:
            missing.append(str(movement))
    return missing


def _notes(town: Town, node: str, arms: list[Arm]) -> Iterable[str]:
    """What the model leaves out or changes."""
    if town.nodes[node].kind.startswith("traffic_light"):
        yield "its signal in the network is left out; the controller decides"
    backs = [
        name
        for name, (into, out_of) in zip(ARM_NAMES, arms, strict=False)
        if into and out_of and (into.id, out_of.id) in town.turns
    ]
    if backs:
        yield f"turning back on {', '.join(backs)} is left out"
    for name, (into, out_of) in zip(ARM_NAMES, arms, strict=False):
        if into is None or out_of is None:
            continue
        if into.origin != out_of.target:
            yield f"{into.id} and {out_of.id} are taken as one road, {name}"
        if into.speed != out_of.speed:
            yield f"limit of {name} {into.speed:g} m/s, though {out_of.speed:g} m/s on the way out"
        if into.width != out_of.width:
            yield f"lanes of {name} {into.width:g} m wide, though {out_of.width:g} m on the way out"
    low, high = WIDTHS
    for name, arm in zip(ARM_NAMES, arms, strict=False):
        if not low <= arm.main.width <= high:
            used = min(max(arm.main.width, low), high)
            yield f"lanes of {name} {used:g} m wide instead of {arm.main.width:g} m"


def _misfit(intersection: Intersection, arms: list[Arm], centre: Floats) -> float:
    keep = 1.0 if intersection.side == "left" else -1.0
    worst = 0.0
    for k, (arm, modelled) in enumerate(zip(arms, intersection.arms, strict=True)):
        outward = np.array(modelled.outward)
        clockwise = np.array([outward[1], -outward[0]]) * keep
        for edge, lane in zip(arm.edges, arm.lanes(), strict=True):
            beside = clockwise * intersection.offsets[k] * (1.0 if edge is arm.into else -1.0)
            worst = max(worst, off_lane(lane, centre + beside, outward))
    return worst
