"""The junction on paper: arms, movements, their paths and the corridors that bodies sweep.

x east, y north, metres. An approach lane ends at its entry, `junction_radius` from the centre;
between entry and exit every movement is one circular arc. That needs no curve fitting: the two
lane centre lines are mirror images of each other in the bisector of their arms, so entry and exit
are equally far from where the lines meet and one arc is tangent to both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from numbers import Real
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from minisim.errors import InputError, choice, number, numbers, show
from minisim.vehicle import VehicleType

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

#: Smallest angle between two arms [deg].
MIN_ANGLE = 30.0
#: Kerb radius between neighbouring arms [m]; netconvert's default `radius` is 4 m too.
KERB_RADIUS = 4.0
#: Tightest path a car can follow [m]: passenger cars turn within 5–6 m (AASHTO Green Book,
#: design vehicle P: centre-line radius 6.4 m); the authors' 5-arm network goes down to 4.5 m.
MIN_PATH_RADIUS = 4.0
#: Segments of the polyline of an arc; the chord error at radius 5.6 m is 4 mm.
ARC_SEGMENTS = 32
#: Spacing of the bodies whose hulls make a swept corridor [m].
SWEEP_STEP = 0.5

ARM_NAMES = "abcdefghijkl"


class Movement(NamedTuple):
    """From arm `origin` (0 = a) into the `manoeuvre`-th arm clockwise; written `a1`, `c3`."""

    origin: int
    manoeuvre: int

    def __str__(self) -> str:
        return f"{ARM_NAMES[self.origin]}{self.manoeuvre}"


class Way(NamedTuple):
    """A given curve through the junction.

    Attributes:
        points: x, y of its polyline from entry to exit [m].
        length: what a vehicle drives on it [m]; simulators round.
        wait: from the entry to the waiting position inside the junction that SUMO gives to some
            far turns [m]; 0 where there is none.
        speed: limit on it [m/s]; 0 where it follows from the radius, as on an arc.
        major: whether the road that it comes from has priority.
        yields: movements to which it must give way, such as "b2".
        foes: movements that it crosses or joins, as SUMO has them.
        turns_back: whether the road that it leaves by leads back at its far end.
    """

    points: tuple[tuple[float, float], ...]
    length: float
    wait: float = 0.0
    speed: float = 0.0
    major: bool = False
    yields: tuple[str, ...] = ()
    foes: tuple[str, ...] = ()
    turns_back: bool = False

    def resampled(self, count: int) -> Floats:
        """`count` points at equal distances along it, shape (count, 2)."""
        at = self._distances()
        points = np.asarray(self.points, dtype=float)
        wanted = np.linspace(0.0, at[-1], count)
        return np.stack([np.interp(wanted, at, points[:, k]) for k in (0, 1)], axis=-1)

    def _distances(self) -> Floats:
        steps = np.linalg.norm(np.diff(np.asarray(self.points, dtype=float), axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True)
class Arm:
    """A road that meets the junction: its name and bearing [degrees clockwise from north]."""

    name: str
    bearing: float

    @property
    def outward(self) -> tuple[float, float]:
        """Unit vector from the centre along the arm."""
        angle = math.radians(self.bearing)
        return math.sin(angle), math.cos(angle)


@dataclass(frozen=True, eq=False)
class Path:
    """The whole way of one movement: approach lane, arc, exit lane.

    `s` is the distance of the front bumper from the road entry.

    Attributes:
        movement: what this is the path of.
        exit_arm: index of the arm it leaves by.
        entry, exit: `s` of the junction's entry and exit [m].
        length: `s` at the end of the exit lane [m].
        radius: of the arc [m]; infinite when straight.
        points: (ARC_SEGMENTS + 1, 2) polyline from entry to exit, equally spaced [m].
        heading_in, heading_out: unit vectors on the approach and exit lane, shape (2,).
    """

    movement: Movement
    exit_arm: int
    entry: float
    exit: float
    length: float
    radius: float
    points: Floats
    heading_in: Floats
    heading_out: Floats

    def position(self, s: npt.ArrayLike) -> Floats:
        """x, y [m] at `s`, shape (..., 2); straight on beyond both ends."""
        s = np.asarray(s, dtype=float)
        step = (self.exit - self.entry) / ARC_SEGMENTS
        t = np.clip((s - self.entry) / step, 0.0, ARC_SEGMENTS)
        k = np.minimum(t.astype(int), ARC_SEGMENTS - 1)
        w = (t - k)[..., None]
        inside = self.points[k] * (1.0 - w) + self.points[k + 1] * w
        before = np.minimum(s - self.entry, 0.0)[..., None] * self.heading_in
        after = np.maximum(s - self.exit, 0.0)[..., None] * self.heading_out
        return np.asarray(inside + before + after)

    def pose(self, s: npt.ArrayLike, length: float) -> tuple[Floats, Floats]:
        """Centre (..., 2) [m] and unit heading (..., 2) of a body whose front bumper is at `s`.

        Both bumpers' middles lie on the path, so the body is the chord between them.
        """
        front = self.position(s)
        rear = self.position(np.asarray(s, dtype=float) - length)
        along = front - rear
        heading = along / np.linalg.norm(along, axis=-1, keepdims=True)
        return front - heading * (length / 2.0), heading

    def bodies(self, s: npt.ArrayLike, vehicle: VehicleType) -> Floats:
        """Corners (..., 4, 2) [m] of the vehicle's oriented rectangle with its front at `s`."""
        centre, heading = self.pose(s, vehicle.length)
        along = heading * (vehicle.length / 2.0)
        across = np.stack([-heading[..., 1], heading[..., 0]], axis=-1) * (vehicle.width / 2.0)
        corners = [along + across, along - across, -along - across, -along + across]
        return np.stack([centre + corner for corner in corners], axis=-2)

    @property
    def line(self) -> shapely.LineString:
        """The centre line as a shapely polyline, from road entry to road end."""
        ends = self.position([0.0, self.length])
        return shapely.LineString(np.vstack([ends[:1], self.points, ends[1:]]))

    def corridor(self, vehicle: VehicleType) -> shapely.Geometry:
        """The area that the body sweeps from the front's entry to the rear's exit."""
        first, last = self.entry, self.exit + vehicle.length
        count = math.ceil((last - first) / SWEEP_STEP) + 1
        corners = self.bodies(np.linspace(first, last, count), vehicle)
        pairs = np.concatenate([corners[:-1], corners[1:]], axis=1)
        return shapely.union_all(shapely.convex_hull(shapely.multipoints(pairs)))


@dataclass(frozen=True)
class Intersection:
    """A junction of n ≥ 3 arms, one lane in and one lane out on each.

    Attributes:
        bearings: of the arms, ascending, in [0, 360) degrees clockwise from true north, at
            least 30° apart. The arms are named a, b, c… in this order.
        side: of the road that traffic keeps to.
        lane_width: [m]; 3.2 is SUMO's default.
        junction_radius: distance of every entry and exit from the centre [m]. By default the
            smallest that leaves a kerb of `KERB_RADIUS` between neighbouring arms:
            (lane_width + KERB_RADIUS) / tan(θ/2) for the smallest angle θ, 7.2 m at 90°.
        arm_length: from the centre to the far end of each road [m].
        ways: how each movement crosses the junction, in the order of `movements`, where that is
            given and not an arc (another simulator's curves); None is the arcs.
    """

    bearings: tuple[float, ...]
    side: Literal["left", "right"] = "left"
    lane_width: float = 3.2
    junction_radius: float = field(default=math.nan)
    arm_length: float = 500.0
    ways: tuple[Way, ...] | None = None

    def __post_init__(self) -> None:
        bearings = numbers("bearings", self.bearings)
        object.__setattr__(self, "bearings", bearings)
        if not 3 <= len(bearings) <= len(ARM_NAMES):
            raise InputError(
                f"an intersection has 3 … {len(ARM_NAMES)} arms, got {len(bearings)} bearings"
            )
        for i, bearing in enumerate(bearings):
            number(f"bearing {i + 1} [deg]", bearing, low=0, below=360)
        if list(bearings) != sorted(bearings):
            wanted = ", ".join(f"{b:g}" for b in sorted(bearings))
            raise InputError(f"bearings must ascend clockwise from north; did you mean {wanted}?")
        for i, gap in enumerate(self._gaps):
            if gap < MIN_ANGLE - 1e-9:
                a, b = ARM_NAMES[i], ARM_NAMES[(i + 1) % len(bearings)]
                raise InputError(
                    f"arms {a} and {b} are {gap:g}° apart; at least {MIN_ANGLE:g}° are needed"
                )
        choice("side", self.side, ("left", "right"))
        number("lane_width [m]", self.lane_width, low=2, high=6)
        number("arm_length [m]", self.arm_length, low=20, high=20_000)
        radius = self.junction_radius
        if isinstance(radius, Real) and radius != radius:  # NaN: not given
            object.__setattr__(self, "junction_radius", self._default_radius)
        number("junction_radius [m]", self.junction_radius, above=0, below=self.arm_length - 10)
        tightest = min(self._arc_radius(m, self.junction_radius) for m in self.movements)
        if tightest < MIN_PATH_RADIUS - 1e-9:
            raise InputError(
                f"junction_radius {self.junction_radius:g} m leaves a path of radius "
                f"{max(tightest, 0):.2g} m; a car needs {MIN_PATH_RADIUS:g} m "
                f"(the default here is {self._default_radius:.3g} m)"
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
    def movements(self) -> tuple[Movement, ...]:
        """All n(n−1) movements in the order of the harmony matrix: a1, a2, …, b1, …"""
        return tuple(Movement(i, j) for i in range(self.n) for j in range(1, self.n))

    @property
    def approach_length(self) -> float:
        """From the road entry to the junction entry [m], the same on every arm."""
        return self.arm_length - self.junction_radius

    def index(self, movement: Movement) -> int:
        """Position of a movement in `movements`; raises `InputError` where it does not exist."""
        origin, manoeuvre = movement
        if not (0 <= origin < self.n and 1 <= manoeuvre < self.n):
            raise InputError(self._no_such(f"{origin}, {manoeuvre}"))
        return origin * (self.n - 1) + manoeuvre - 1

    def parse(self, text: str) -> Movement:
        """Read a movement such as `a1`; raises `InputError` with what is allowed."""
        if (
            isinstance(text, str)
            and len(text) == 2
            and text[0] in ARM_NAMES[: self.n]
            and text[1] in "123456789"[: self.n - 1]
        ):
            return Movement(ARM_NAMES.index(text[0]), int(text[1]))
        if isinstance(text, str) and len(text) == 3 and text[0] in ARM_NAMES[: self.n]:
            digits = text[1:]
            if digits.isascii() and digits.isdigit() and 10 <= int(digits) < self.n:
                return Movement(ARM_NAMES.index(text[0]), int(digits))
        raise InputError(self._no_such(show(text)))

    def exit_arm(self, movement: Movement) -> int:
        """Index of the arm by which a movement leaves."""
        return (movement.origin + movement.manoeuvre) % self.n

    def path(self, movement: Movement) -> Path:
        """The path of a movement."""
        return self.paths[self.index(movement)]

    @cached_property
    def paths(self) -> tuple[Path, ...]:
        """One path a movement, in the order of `movements`."""
        return tuple(self._build_path(m) for m in self.movements)

    def separation(self, vehicle: VehicleType) -> Floats:
        """Distance [m] between the swept corridors of every two movements, shape (m, m).

        0 where they overlap, and between movements from the same arm, which share their start.
        """
        return _separation(self, vehicle.length, vehicle.width)

    def conflicts(self, vehicle: VehicleType, clearance: float) -> Bools:
        """Whether two movements come closer than `clearance` [m]; shape (m, m), symmetric."""
        number("clearance [m]", clearance, low=0, high=10)
        return np.asarray(self.separation(vehicle) <= clearance)

    def room(self, vehicle: VehicleType) -> float:
        """Distance [m] between a vehicle held at any entry and the corridors of other arms.

        0 where the vehicle does not fit the lanes: who turns into an exit lane would touch
        whoever waits beside it.
        """
        return _room(self, vehicle.length, vehicle.width)

    def branch(self, vehicle: VehicleType) -> Floats:
        """Where movements from one arm part, shape (m, m) [m].

        `branch[p, q]` is the smallest `s` on path p from which a rear bumper no longer obstructs
        path q; infinite on the same path, 0 between different arms.
        """
        return _branch(self, vehicle.width)

    def turn_speed(self, movement: Movement, lateral: float) -> float:
        """Speed [m/s] at which the arc needs the lateral acceleration `lateral` [m/s²].

        A given way may have a limit of its own instead.
        """
        if self.ways is not None and (speed := self.ways[self.index(movement)].speed):
            return speed
        return math.sqrt(lateral * self.path(movement).radius)

    @property
    def _gaps(self) -> Iterator[float]:
        shifted = (*self.bearings[1:], self.bearings[0] + 360.0)
        return (b - a for a, b in zip(self.bearings, shifted, strict=True))

    @property
    def _default_radius(self) -> float:
        half = math.radians(min(self._gaps)) / 2.0
        return (self.lane_width + KERB_RADIUS) / math.tan(half)

    def _half_angle(self, movement: Movement) -> float:
        """Half the clockwise angle from the arm of origin to the arm of exit [rad]."""
        to = self.bearings[self.exit_arm(movement)]
        return math.radians((to - self.bearings[movement.origin]) % 360.0) / 2.0

    def _tangent(self, movement: Movement, radius: float) -> float:
        """From the entry to where the two lane centre lines meet [m]."""
        half = self._half_angle(movement)
        offset = self.lane_width / 2.0 / math.tan(half)
        return radius - offset if self.side == "left" else radius + offset

    def _arc_radius(self, movement: Movement, radius: float) -> float:
        slope = abs(math.tan(self._half_angle(movement)))
        return self._tangent(movement, radius) * min(slope, 1e6)

    def _build_path(self, movement: Movement) -> Path:
        arm_in = self.arms[movement.origin]
        arm_out = self.arms[self.exit_arm(movement)]
        keep = 1.0 if self.side == "left" else -1.0
        heading_in = -np.array(arm_in.outward)
        heading_out = np.array(arm_out.outward)
        left_in = np.array([-heading_in[1], heading_in[0]])
        left_out = np.array([-heading_out[1], heading_out[0]])
        offset = keep * self.lane_width / 2.0
        start = -heading_in * self.junction_radius + left_in * offset
        end = heading_out * self.junction_radius + left_out * offset

        # Clockwise turn: 0 for straight on, positive to the right.
        turn = 2.0 * self._half_angle(movement) - math.pi
        radius = self._arc_radius(movement, self.junction_radius)
        straight = abs(turn) < 1e-4
        length = float(np.linalg.norm(end - start)) if straight else radius * abs(turn)
        t = np.linspace(0.0, 1.0, ARC_SEGMENTS + 1)[:, None]
        if straight:
            points = start + (end - start) * t
        else:
            sign = math.copysign(1.0, turn)
            angle = t * abs(turn)
            forward, inward = np.sin(angle), 1.0 - np.cos(angle)
            points = start + radius * (forward * heading_in - sign * inward * left_in)
            points[-1] = end
        entry = self.approach_length
        if self.ways is not None:
            way = self.ways[self.index(movement)]
            length, points = way.length, way.resampled(ARC_SEGMENTS + 1)
        return Path(
            movement=movement,
            exit_arm=self.exit_arm(movement),
            entry=entry,
            exit=entry + length,
            length=entry + length + self.approach_length,
            radius=math.inf if straight else radius,
            points=points,
            heading_in=heading_in,
            heading_out=heading_out,
        )

    def _check_ways(self) -> None:
        if self.ways is None:
            return
        if len(self.ways) != len(self.movements):
            raise InputError(
                f"ways must hold {len(self.movements)} curves, one a movement, got {len(self.ways)}"
            )
        for movement, way in zip(self.movements, self.ways, strict=True):
            if not isinstance(way, Way) or len(way.points) < 2:
                raise InputError(f"ways, {movement}: a Way of two or more points is needed")
            number(f"length of the way of {movement} [m]", way.length, low=1, high=200)
            number(f"waiting position of {movement} [m]", way.wait, low=0, below=way.length)

    def _no_such(self, what: str) -> str:
        lanes = f"a … {ARM_NAMES[self.n - 1]}"
        return (
            f"no movement {what} in an intersection of {self.n} arms: "
            f"a lane {lanes} and a manoeuvre 1 … {self.n - 1}, such as a1"
        )


@lru_cache(maxsize=256)
def _corridors(intersection: Intersection, length: float, width: float) -> npt.NDArray[np.object_]:
    vehicle = VehicleType(length=length, width=width)
    corridors = np.array([path.corridor(vehicle) for path in intersection.paths])
    shapely.prepare(corridors)
    return corridors


@lru_cache(maxsize=256)
def _separation(intersection: Intersection, length: float, width: float) -> Floats:
    corridors = _corridors(intersection, length, width)
    i, j = np.triu_indices(len(corridors), 1)
    result = np.zeros((len(corridors), len(corridors)))
    result[i, j] = result[j, i] = shapely.distance(corridors[i], corridors[j])
    origin = np.array([m.origin for m in intersection.movements])
    result[origin[:, None] == origin[None, :]] = 0.0
    result.setflags(write=False)
    return result


@lru_cache(maxsize=256)
def _room(intersection: Intersection, length: float, width: float) -> float:
    vehicle = VehicleType(length=length, width=width)
    entry = intersection.approach_length
    firsts = [intersection.path(Movement(arm, 1)) for arm in range(intersection.n)]
    held = shapely.polygons([path.bodies(entry, vehicle) for path in firsts])
    distance = shapely.distance(
        _corridors(intersection, length, width)[:, None], np.asarray(held)[None, :]
    )
    origin = np.array([m.origin for m in intersection.movements])
    return float(distance[origin[:, None] != np.arange(intersection.n)].min())


#: Extra lateral room before a vehicle that turns off no longer obstructs the lane [m].
BRANCH_ROOM = 0.5


@lru_cache(maxsize=256)
def _branch(intersection: Intersection, width: float) -> Floats:
    paths = intersection.paths
    result = np.zeros((len(paths), len(paths)))
    for p, path in enumerate(paths):
        s = np.arange(path.entry, path.exit + 60.0, 0.25)
        points = shapely.points(path.position(s))
        for q, other in enumerate(paths):
            if path.movement.origin != other.movement.origin:
                continue
            near = shapely.distance(points, other.line) < width + BRANCH_ROOM
            blocked = np.flatnonzero(near)
            result[p, q] = np.inf if p == q else s[blocked[-1]] + 0.25
    result.setflags(write=False)
    return result
