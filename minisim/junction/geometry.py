"""The junction on paper: arms, and the path of every movement.

x points east, y north, in metres. An approach lane ends at its entry, `junction_radius` from the
centre. Between entry and exit every movement is one circular arc. No curve fitting is needed: the
two lane centre lines mirror each other across the bisector of their arms, so entry and exit are
equally far from where the lines meet, and one arc is tangent to both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from minisim.errors import InputError, number, numbers
from minisim.junction.movements import ARM_NAMES, Movement, Movements, movements_of
from minisim.junction.paths import ARC_SEGMENTS, Path, Way
from minisim.parameters import Reals, checked, declared, part, real, word

#: Smallest angle between two arms [deg].
MIN_ANGLE = 30.0
#: Kerb radius between neighbouring arms [m]; netconvert's default `radius` is also 4 m.
KERB_RADIUS = 4.0
#: Smallest radius of a path that a car can follow [m]: passenger cars turn within 5–6 m (AASHTO
#: Green Book, design vehicle P: centre-line radius 6.4 m); the authors' 5-arm network has 4.5 m.
MIN_PATH_RADIUS = 4.0


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
        raise InputError(f"an intersection has 3 … {most} arms, got {n} bearings")
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


@declared
class Intersection:
    """A junction of n ≥ 3 arms, with one lane in and one lane out on each.

    The arms are named a, b, c… in the order of their bearings. `junction_radius` defaults to the
    smallest that leaves a kerb of `KERB_RADIUS` between neighbouring arms: (lane_width +
    KERB_RADIUS) / tan(θ/2) for the smallest angle θ, 7.2 m at 90°. SUMO's lanes are 3.2 m wide too.
    """

    bearings: Reals[tuple[float, ...]] = checked(
        "of the arms, clockwise from true north", _bearings,
        f"3 … {len(ARM_NAMES)} numbers in [0, 360), ascending, {MIN_ANGLE:g} or more apart", "deg",
    )  # fmt: skip
    side: Literal["left", "right"] = word(
        "of the road that traffic keeps to", ("left", "right"), default="left"
    )
    lane_width: float = real("width of every lane", "m", default=3.2, low=2, high=6)
    junction_radius: float = real(
        "distance of every entry and exit from the centre; none means the smallest with a kerb of "
        f"{KERB_RADIUS:g} m",
        "m", above=0, optional=True, default=None,
    )  # fmt: skip
    arm_length: float = real(
        "from the centre to the far end of each road", "m", default=500.0, low=20, high=20_000
    )
    ways: tuple[Way, ...] | None = part(
        "another simulator's curves through the junction, one Way per movement, in order; none "
        "means arcs",
        tuple, optional=True, default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        sharpest = math.radians(min(_gaps(self.bearings)))
        smallest = (self.lane_width + KERB_RADIUS) / math.tan(sharpest / 2.0)
        if self.junction_radius is None:
            object.__setattr__(self, "junction_radius", smallest)
        number("junction_radius [m]", self.junction_radius, above=0, below=self.arm_length - 10)
        tightest = min(map(self._arc_radius, self.movements))
        if tightest < MIN_PATH_RADIUS - 1e-9:
            raise InputError(
                f"junction_radius {self.junction_radius:g} m leaves a path of radius "
                f"{max(tightest, 0):.2g} m; a car needs {MIN_PATH_RADIUS:g} m "
                f"(the default here is {smallest:.3g} m)"
            )
        self._check_ways()

    @property
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

    @property
    def approach_length(self) -> float:
        """Distance from the road entry to the junction entry [m], the same on every arm."""
        return self.arm_length - self.junction_radius

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
        return tuple(self._build_path(m) for m in self.movements)

    def turn_speed(self, movement: Movement, lateral: float) -> float:
        """Speed [m/s] at which the arc needs the lateral acceleration `lateral` [m/s²].

        A given way may have a limit of its own instead.
        """
        if self.ways is not None and (speed := self.ways[self.index(movement)].speed):
            return speed
        return math.sqrt(lateral * self.path(movement).radius)

    def _half_angle(self, movement: Movement) -> float:
        """Half the clockwise angle from the arm of origin to the arm of exit [rad]."""
        to = self.bearings[self.exit_arm(movement)]
        return math.radians((to - self.bearings[movement.origin]) % 360.0) / 2.0

    def _arc_radius(self, movement: Movement) -> float:
        slope = math.tan(self._half_angle(movement))
        offset = self.lane_width / 2.0 / slope
        # From the entry to where the two lane centre lines meet.
        tangent = self.junction_radius + (-offset if self.side == "left" else offset)
        return tangent * min(abs(slope), 1e6)

    def _build_path(self, movement: Movement) -> Path:
        exit_arm, entry = self.exit_arm(movement), self.approach_length
        heading_in = -np.array(self.arms[movement.origin].outward)
        heading_out = np.array(self.arms[exit_arm].outward)
        left_in, left_out = (np.array([-y, x]) for x, y in (heading_in, heading_out))
        offset = self.lane_width / 2.0 if self.side == "left" else -self.lane_width / 2.0
        start = -heading_in * self.junction_radius + left_in * offset
        end = heading_out * self.junction_radius + left_out * offset

        # Clockwise turn: 0 for straight on, positive to the right.
        turn = 2.0 * self._half_angle(movement) - math.pi
        straight = abs(turn) < 1e-4
        radius = math.inf if straight else self._arc_radius(movement)
        t = np.linspace(0.0, 1.0, ARC_SEGMENTS + 1)[:, None]
        if self.ways is not None:
            way = self.ways[self.index(movement)]
            length, points = way.length, way.resampled(ARC_SEGMENTS + 1)
        elif straight:
            length, points = float(np.linalg.norm(end - start)), start + (end - start) * t
        else:
            length, angle = radius * abs(turn), t * abs(turn)
            inward = math.copysign(1.0, turn) * (1.0 - np.cos(angle))
            points = start + radius * (np.sin(angle) * heading_in - inward * left_in)
            points[-1] = end
        return Path(
            movement, exit_arm, entry=entry, exit=entry + length,
            length=entry + length + entry, radius=radius, points=points,
            heading_in=heading_in, heading_out=heading_out,
        )  # fmt: skip

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
