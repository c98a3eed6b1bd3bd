"""A SUMO network as plain data: its nodes, edges and connections for cars.

The format: https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html. A file may be hostile, so it
is limited in size and may not declare a document type; without one, XML has no entities.
"""

from __future__ import annotations

import gzip
import io
import math
import zlib
from collections.abc import Callable, Mapping
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from minisim.errors import FileError
from minisim.files import AnyPath, read_file
from minisim.junction.paths import Floats

#: The largest file read [bytes]; SUMO's network of Berlin has 0.4 GB.
LARGEST = 2**29

#: The first bytes of a file packed by gzip.
PACKED = b"\x1f\x8b"

#: SUMO's default width of a lane [m] (`SUMO_const_laneWidth`).
LANE_WIDTH = 3.2

#: SUMO's class of a car.
CAR = "passenger"

#: Edges that are not roads: inside junctions, and for pedestrians.
NO_ROADS = ("internal", "crossing", "walkingarea", "connector")

#: Called with the name of an element and its attributes.
Element = Callable[[str, dict[str, str]], None]


#: The earth's mean radius by UTM's scale at the meridian of a zone [m].
UTM_RADIUS = 0.9996 * 6_371_009.0

#: What UTM adds to distances from the meridian and, south of the equator, from the equator [m].
FALSE_EASTING, FALSE_NORTHING = 500_000.0, 10_000_000.0


class Edge(NamedTuple):
    """A road in one direction, with its lanes for cars."""

    id: str
    origin: str  #: id of the node where it begins
    target: str  #: and where it ends
    street: str  #: name of the street, or empty
    lanes: int  #: number of lanes for cars
    shape: Floats  #: polyline of the first of them [m], shape (k, 2)
    length: float  #: [m]
    speed: float  #: limit [m/s]
    width: float  #: of the lane [m]


class Node(NamedTuple):
    """Where edges meet."""

    id: str
    kind: str  #: SUMO's type, such as "priority" or "traffic_light"
    x: float  #: [m]
    y: float  #: [m]


class Town(NamedTuple):
    """A network's roads for cars; y points to true north if the network has a projection by UTM."""

    left: bool  #: whether traffic keeps to the left
    nodes: Mapping[str, Node]
    into: Mapping[str, list[Edge]]  #: node -> edges that end there
    out_of: Mapping[str, list[Edge]]  #: node -> edges that begin there
    turns: frozenset[tuple[str, str]]  #: edges that a connection for cars joins


def read_town(path: AnyPath) -> Town | None:
    """Read a network (.net.xml, perhaps packed by gzip); None for an extract of OpenStreetMap.

    Raises `FileError` if it is unreadable, too large, broken or hostile XML, or neither of the two.
    """
    made = _Maker(str(path))
    parse(path, made.element)
    if made.root == "osm":
        return None
    if made.root != "net":
        raise FileError(
            f"{path} is neither a network of SUMO (<net>) nor an extract of OpenStreetMap (<osm>): "
            f"it begins with <{made.root}>"
        )
    return made.town()


def parse(path: AnyPath, element: Element) -> None:
    """Call `element` for every element of an XML file; raises `FileError` as `read_town`."""
    content = read_file("network", path, LARGEST)
    parser = expat.ParserCreate()
    parser.StartElementHandler = element

    def refuse(*_: object) -> None:
        raise FileError(
            f"{path} declares a document type, which may hide entities; a network has none"
        )

    parser.StartDoctypeDeclHandler = refuse
    try:
        source: io.IOBase = io.BytesIO(content)
        if content.startswith(PACKED):
            source = gzip.GzipFile(fileobj=io.BytesIO(content))
        size = 0
        while block := source.read(1 << 20):
            size += len(block)
            if size > LARGEST:
                raise FileError(f"{path} is larger than {LARGEST >> 20} MiB when unpacked")
            parser.Parse(block, False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        raise FileError(f"{path} is not a network: the XML is broken: {error}") from error
    except (OSError, EOFError, zlib.error) as error:
        raise FileError(f"{path} cannot be unpacked: {error}") from error


class _Maker:
    """Collects what the elements say."""

    def __init__(self, name: str) -> None:
        self._name, self.root, self._left = name, "", False
        self._nodes: dict[str, Node] = {}
        self._edges: dict[str, Edge] = {}
        self._turns: set[tuple[str, str]] = set()
        self._cars: dict[str, list[bool]] = {}  # edge: whether each of its lanes is for cars
        self._edge: dict[str, str] | None = None
        self._turned = np.eye(2)  # from the network's axes to east and true north

    def element(self, name: str, has: dict[str, str]) -> None:
        """Take note of one element."""
        if not self.root:
            self.root, self._left = name, has.get("lefthand") in ("true", "1")
        try:
            if name == "edge":
                self._edge = has if has.get("function") not in NO_ROADS else None
                self._cars[has["id"]] = []
            elif name == "lane" and self._edge is not None:
                self._lane(self._edge, has)
            elif name == "location":
                self._turned = _to_true_north(has)
            elif name == "junction" and has.get("type") != "internal":
                x, y = (self._turned @ [_number(has[key]) for key in "xy"]).tolist()
                self._nodes[has["id"]] = Node(has["id"], has.get("type", ""), x, y)
            elif name == "connection":
                self._connection(has)
        except (KeyError, ValueError, OverflowError) as error:
            why = f"no {error}" if isinstance(error, KeyError) else str(error)
            which = has.get("id", has.get("from", ""))
            raise FileError(f"{self._name}: <{name}> {which!r}: {why}") from error

    def _lane(self, edge: dict[str, str], has: dict[str, str]) -> None:
        cars = _for_cars(has)
        self._cars[edge["id"]].append(cars)
        if not cars:
            return
        if known := self._edges.get(edge["id"]):
            self._edges[known.id] = known._replace(lanes=known.lanes + 1)
            return
        shape = [[_number(x) for x in point.split(",")[:2]] for point in has["shape"].split()]
        if len(shape) < 2 or any(len(point) != 2 for point in shape):
            raise ValueError("its shape needs two points or more, such as 0,0 50,0")
        self._edges[edge["id"]] = Edge(
            edge["id"], edge["from"], edge["to"], edge.get("name", ""), 1,
            np.array(shape) @ self._turned.T,
            _number(has["length"]), _number(has["speed"]), _number(has.get("width", LANE_WIDTH)),
        )  # fmt: skip

    def _connection(self, has: dict[str, str]) -> None:
        """Note a connection between two lanes for cars; edges come before connections."""
        ends = (has["from"], has["fromLane"]), (has["to"], has["toLane"])
        lanes = [self._cars.get(edge, [])[int(lane) :][:1] for edge, lane in ends]
        if all(lane == [True] for lane in lanes) and _for_cars(has):
            self._turns.add((has["from"], has["to"]))

    def town(self) -> Town:
        """What was collected; roads without an end in the network are left out."""
        into: dict[str, list[Edge]] = {node: [] for node in self._nodes}
        out_of: dict[str, list[Edge]] = {node: [] for node in self._nodes}
        for edge in self._edges.values():
            if edge.origin in self._nodes and edge.target in self._nodes:
                into[edge.target].append(edge)
                out_of[edge.origin].append(edge)
        turns = frozenset(self._turns)
        return Town(self._left, self._nodes, into, out_of, turns)


def _to_true_north(location: Mapping[str, str]) -> Floats:
    """The matrix (2, 2) that turns a network's coordinates so that y points to true north.

    UTM is a transverse Mercator projection: x from its meridian and y from the equator, the grid's
    north is atan(tanh(x/k₀R) tan(y/k₀R)) east of true north (J. P. Snyder, Map Projections, USGS
    Professional Paper 1395, 1987, chapter 8, for the sphere; the ellipsoid changes it by about
    0.01°). The middle of the network stands for all of it.
    """
    projection = location.get("projParameter", "")
    if "+proj=utm" not in projection:
        return np.eye(2)
    offset = [_number(it) for it in location["netOffset"].split(",")]
    left, bottom, right, top = (_number(it) for it in location["convBoundary"].split(","))
    x = (left + right) / 2.0 - offset[0] - FALSE_EASTING
    y = (bottom + top) / 2.0 - offset[1] - FALSE_NORTHING * ("+south" in projection)
    turn = math.atan(math.tanh(x / UTM_RADIUS) * math.tan(y / UTM_RADIUS))
    return np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])


def _for_cars(has: Mapping[str, str]) -> bool:
    """Whether the permissions of a lane or connection let cars in."""
    if "allow" in has:
        return bool({CAR, "all"} & set(has["allow"].split()))
    return not {CAR, "all"} & set(has.get("disallow", "").split())


def _number(text: str | float) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text} is not a finite number")
    return value
