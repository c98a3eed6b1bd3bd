"""The junction on paper: arms, their roads, and the path of every movement.

x points east, y north, in metres. An approach lane ends at its entry, `junction_radius` from the
centre. Where all roads are alike, every movement is one circular arc between entry and exit. No
curve fitting is needed: the two lane centre lines mirror each other across the bisector of their
arms, so entry and exit are equally far from where the lines meet, and one arc is tangent to both.
Lanes of different widths, or of one-way roads, take a curve of `minisim.junction.curves`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from minisim.errors import InputError, instance, items, number, numbers, plural
from minisim.fields import Takes
from minisim.junction.movements import ARM_NAMES, Bools, Movement, Movements, movements_of
from minisim.junction.paths import Bundle, Path, Way
from minisim.junction.roads import Road
from minisim.junction.tracing import MIN_PATH_RADIUS, build_paths, tightest
from minisim.parameters import Reals, checked, declared, part, real, word

#: Smallest angle between two arms [deg].
MIN_ANGLE = 30.0
#: Kerb radius between neighbouring arms [m]; netconvert's default `radius` is also 4 m.
KERB_RADIUS = 4.0


@dataclass(frozen=True)
class Arm:
    """A road into the junction: its name and bearing [degrees clockwise from north]."""

    name: str
    bearing: float

    @property
    def outward(self) -> tuple[float, float]:
        """Unit vector from the centre along the arm."""
        angle = math.radians(self.bearing)
        return math.sin(angle), math.cos(angle)


def _bearings(name: str, value: Any) -> tuple[float, ...]:
    bearings = numbers(name.removesuffix(" [deg]"), value)
    n, most = len(bearings), len(ARM_NAMES)
    if not 3 <= n <= most:
        raise InputError(f"an intersection has 3 … {most} arms, got {plural(n, 'bearing')}")
    for i, bearing in enumerate(bearings):
        number(f"bearing {i + 1} [deg]", bearing, low=0, below=360)
    if list(bearings) != sorted(bearings):
        wanted = ", ".join(f"{b:g}" for b in sorted(bearings))
        raise InputError(f"bearings must ascend clockwise from north; did you mean {wanted}?")
    for i, gap in enumerate(_gaps(bearings)):
        if gap < MIN_ANGLE - 1e-9:
            a, b = ARM_NAMES[i], ARM_NAMES[(i + 1) % n]
            raise InputError(
                f"arms {a} and {b} are {gap:g}° apart; at least {MIN_ANGLE:g}° are needed"
            )
    return bearings


def _gaps(bearings: tuple[float, ...]) -> Iterator[float]:
    """Angles between neighbouring arms [deg], starting from the first arm."""
    return (b - a for a, b in pairwise((*bearings, bearings[0] + 360.0)))


def _roads(name: str, value: Any) -> tuple[Road, ...]:
    """One `Road` per arm, each given as such or as a table of its parameters."""
    given = items(name, value, "a Road per arm")
    roads = tuple(Road(**road) if isinstance(road, Mapping) else road for road in given)
    for i, road in enumerate(roads):
        instance(f"{name}[{i}]", road, Road)
    return roads


def _forbidden(name: str, value: Any) -> tuple[str, ...]:
    listed = value.split(",") if isinstance(value, str) else items(name, value, "movements")
    return tuple(it.strip() if isinstance(it, str) else str(it) for it in listed)


@declared
class Intersection:
    """A junction of n ≥ 3 arms, with one lane in and one lane out on each, or one of the two.

    The arms are named a, b, c… in the order of their bearings. `junction_radius` defaults to the
    smallest that leaves a kerb of `KERB_RADIUS` between neighbouring arms: (h + KERB_RADIUS) /
    tan(θ/2), where θ is the angle between them and h half the width of the wider road: 7.2 m at 90°
    with two lanes of 3.2 m, SUMO's width, too.
    """

    bearings: Reals[tuple[float, ...]] = checked(
        "of the arms, clockwise from true north", _bearings,
        f"3 … {len(ARM_NAMES)} numbers in [0, 360), ascending, {MIN_ANGLE:g} or more apart", "deg",
    )  # fmt: skip
    side: Literal["left", "right"] = word(
        "of the road that traffic keeps to", ("left", "right"), default="left"
    )
    lane_width: float = real(
        "width of every lane, unless its road has another", "m", default=3.2, low=2, high=6
    )
    junction_radius: float = real(
        "distance of every entry and exit from the centre; none means the smallest with a kerb of "
        f"{KERB_RADIUS:g} m",
        "m", above=0, optional=True, default=None,
    )  # fmt: skip
    arm_length: float = real(
        "from the centre to the far end of each road, unless it has another length", "m",
        default=500.0, low=20, high=20_000,
    )  # fmt: skip
    ways: tuple[Way, ...] | None = part(
        "another simulator's curves through the junction, one Way per movement, in order; none "
        "means arcs",
        tuple, optional=True, default=None,
    )  # fmt: skip
    roads: Takes[tuple[Road, ...] | None, Iterable[Road | Mapping[str, Any]] | None] = checked(
        "of the arms, where they differ; none if all are alike and two-way", _roads,
        "a Road per arm", optional=True, default=None,
    )  # fmt: skip
    forbidden: Takes[tuple[str, ...], Iterable[str]] = checked(
        "movements that no vehicle may take", _forbidden, "movements such as a2", default=()
    )

    def __post_init__(self) -> None:
        self._check_roads()
        halves = self.half_widths
        smallest = max(
            (max(pair) + KERB_RADIUS) / math.tan(math.radians(gap) / 2.0)
            for pair, gap in zip(pairwise((*halves, halves[0])), _gaps(self.bearings), strict=True)
        )
        if self.junction_radius is None:
            object.__setattr__(self, "junction_radius", smallest)
        number("junction_radius [m]", self.junction_radius, above=0, below=min(self.lengths) - 10)
        radius = tightest(self)
        if radius < MIN_PATH_RADIUS - 1e-9:
            raise InputError(
                f"junction_radius {self.junction_radius:g} m leaves a path of radius "
                f"{max(radius, 0):.2g} m; a car needs {MIN_PATH_RADIUS:g} m "
                f"(the default here is {smallest:.3g} m)"
            )
        self._check_ways()

    def __getstate__(self) -> dict[str, Any]:
        """What makes it: copies in other processes work out the rest themselves."""
        return {it.name: getattr(self, it.name) for it in fields(self)}

    @cached_property
    def arms(self) -> tuple[Arm, ...]:
        """The arms, clockwise from north."""
        return tuple(Arm(ARM_NAMES[i], b) for i, b in enumerate(self.bearings))

    @property
    def n(self) -> int:
        """Number of arms."""
        return len(self.bearings)

    @property
    def movements(self) -> Movements:
        """All n(n−1) movements in the order of the harmony matrix: a1, a2, …, b1, …"""
        return movements_of(self.n)

    @cached_property
    def allowed(self) -> Bools:
        """Whether each movement may be driven, shape (m,).

        It may not if it is forbidden, or if it comes from or leads into a road against its traffic.
        """
        movements, forbidden = self.movements, {self.index(name) for name in self.forbidden}
        entered = np.array([road.traffic != "out" for road in self._each_road])
        left = np.array([road.traffic != "in" for road in self._each_road])
        free = np.array([k not in forbidden for k in range(len(movements))])
        return _fixed(free & entered[movements.origins] & left[movements.exits])

    @cached_property
    def allowed_by_lane(self) -> Bools:
        """The same by lane and manoeuvre, shape (n, n−1)."""
        return self.allowed.reshape(self.n, self.n - 1)

    @cached_property
    def approaches(self) -> tuple[int, ...]:
        """The arms from which some movement is allowed."""
        return tuple(np.unique(self.movements.origins[self.allowed]).tolist())

    @property
    def departures(self) -> tuple[int, ...]:
        """The arms into which some movement is allowed."""
        return tuple(np.unique(self.movements.exits[self.allowed]).tolist())

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Distance from the centre to the far end of each arm's road [m]."""
        return tuple(road.length or self.arm_length for road in self._each_road)

    @property
    def lane_widths(self) -> tuple[float, ...]:
        """Width of the lanes of each arm [m]."""
        return tuple(road.lane_width or self.lane_width for road in self._each_road)

    @cached_property
    def offsets(self) -> tuple[float, ...]:
        """Distance of each arm's lanes from its axis [m]; 0 on one-way roads."""
        each = zip(self.lane_widths, self._each_road, strict=True)
        return tuple(0.0 if road.one_way else width / 2.0 for width, road in each)

    @property
    def half_widths(self) -> tuple[float, ...]:
        """Half the width of each arm's road [m]."""
        each = zip(self.lane_widths, self.offsets, strict=True)
        return tuple(width if offset else width / 2.0 for width, offset in each)

    @cached_property
    def approach_length(self) -> float:
        """Distance from the far end of the longest approach lane to the junction entry [m].

        This is the `s` of the junction entry on all paths.
        """
        return max(self.lengths[arm] for arm in self.approaches) - self.junction_radius

    @cached_property
    def shortest_approach(self) -> float:
        """The same of the shortest approach lane [m]."""
        return min(self.lengths[arm] for arm in self.approaches) - self.junction_radius

    def too_short(self, needed: str) -> str:
        """What messages say of the shortest road with an approach lane: how long it must be."""
        arm = min(self.approaches, key=self.lengths.__getitem__)
        own = self.roads is not None and self.roads[arm].length is not None
        what = f"length [m] of the road of arm {ARM_NAMES[arm]}" if own else "arm_length [m]"
        return f"{what} must be {needed}, got {self.lengths[arm]:g}"

    def refuse_roads(self, what: str) -> None:
        """Raise `InputError` if the approach lanes are not equally long, as `what` needs."""
        if self.shortest_approach < self.approach_length:
            raise InputError(
                f"{what} counts metres from insertion: give all roads one length, got "
                f"{', '.join(f'{it:g}' for it in self.lengths)} m"
            )

    def index(self, movement: Movement | str) -> int:
        """Position of a movement in `movements`; `InputError` if it does not exist."""
        return self.movements.number(movement)

    def parse(self, text: str) -> Movement:
        """Read a movement such as `a1`; `InputError` if it does not exist."""
        return self.movements[self.index(text)]

    def exit_arm(self, movement: Movement) -> int:
        """Index of the arm that a movement leaves by."""
        return int(self.movements.exits[self.index(movement)])

    def path(self, movement: Movement) -> Path:
        """The path of a movement."""
        return self.paths[self.index(movement)]

    @cached_property
    def paths(self) -> tuple[Path, ...]:
        """One path per movement, in the order of `movements`."""
        return build_paths(self)

    @cached_property
    def bundle(self) -> Bundle:
        """The same paths, for places on many of them at once."""
        return Bundle(self.paths)

    def turn_speed(self, movement: Movement, lateral: float) -> float:
        """Speed [m/s] at which the arc needs the lateral acceleration `lateral` [m/s²].

        A given way may have a limit of its own instead.
        """
        if self.ways is not None and (speed := self.ways[self.index(movement)].speed):
            return speed
        return math.sqrt(lateral * self.path(movement).radius)

    @property
    def _each_road(self) -> tuple[Road, ...]:
        return self.roads or (Road(),) * self.n

    def _check_roads(self) -> None:
        if self.roads is not None and len(self.roads) != self.n:
            raise InputError(f"roads must be one Road per arm, {self.n}, got {len(self.roads)}")
        places = sorted({self.index(name) for name in self.forbidden})
        object.__setattr__(self, "forbidden", tuple(str(self.movements[k]) for k in places))
        if self.roads == (Road(),) * self.n:
            object.__setattr__(self, "roads", None)
        if not self.allowed.any():
            raise InputError("no movement is allowed: every one is forbidden or against its road")
        if self.ways is not None and (self.roads is not None or self.forbidden):
            raise InputError(
                "ways are of a junction whose roads are alike; leave out roads and forbidden"
            )

    def _check_ways(self) -> None:
        if self.ways is None:
            return
        m, given = len(self.movements), len(self.ways)
        if given != m:
            raise InputError(f"ways must hold {m} curves, one per movement, got {given}")
        for movement, way in zip(self.movements, self.ways, strict=True):
            if not isinstance(way, Way) or len(way.points) < 2:
                raise InputError(f"ways, {movement}: a Way of two or more points is needed")
            number(f"length of the way of {movement} [m]", way.length, low=1, high=200)
            number(f"waiting position of {movement} [m]", way.wait, low=0, below=way.length)


def _fixed(table: Bools) -> Bools:
    table.setflags(write=False)
    return table
