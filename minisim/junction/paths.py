"""Paths through a junction, and bodies on them.

`s` is where a vehicle's front bumper is on its path [m]. The junction's entry has the same `s` on
all paths, and the longest approach lane begins at 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType

Floats = npt.NDArray[np.float64]
Indices = int | npt.NDArray[np.int64]

#: Segments of an arc's polyline; the chord error at radius 5.6 m is 4 mm.
ARC_SEGMENTS = 32


class Way(NamedTuple):
    """Another simulator's curve through the junction."""

    points: tuple[tuple[float, float], ...]  #: x, y of its polyline from entry to exit [m]
    length: float  #: how far a vehicle drives on it [m]; simulators round it
    #: Distance from the entry to the waiting position that SUMO gives some far turns [m], or 0.
    wait: float = 0.0
    speed: float = 0.0  #: limit on it [m/s]; 0 if it follows from the radius, as on an arc
    major: bool = False  #: whether the road that it comes from has priority
    yields: tuple[str, ...] = ()  #: movements to which it must give way, such as "b2"
    foes: tuple[str, ...] = ()  #: movements that it crosses or joins, as SUMO has them
    turns_back: bool = False  #: whether its road of exit leads back at the far end

    def resampled(self, count: int) -> Floats:
        """`count` equally spaced points along it, shape (count, 2)."""
        points = np.asarray(self.points, dtype=float)
        at = distances_along(points)
        wanted = np.linspace(0.0, at[-1], count)
        return np.stack([np.interp(wanted, at, points[:, k]) for k in (0, 1)], axis=-1)


def distances_along(points: Floats) -> Floats:
    """How far along a polyline each of its points is [m], shape (points,)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True, eq=False)
class Path:
    """The path of one movement: approach lane, arc, exit lane."""

    movement: Movement
    exit_arm: int  #: index of the arm by which it leaves
    entry: float  #: `s` of the junction's entry [m]
    exit: float  #: and of its exit [m]
    length: float  #: `s` at the end of the exit lane [m]
    radius: float  #: of the arc [m]; infinite when straight
    points: Floats  #: from entry to exit, equally spaced [m], shape (ARC_SEGMENTS + 1, 2)
    heading_in: Floats  #: unit vector on the approach lane, shape (2,)
    heading_out: Floats  #: and on the exit lane
    start: float = 0.0  #: `s` where its road begins [m]

    @property
    def crossing(self) -> float:
        """Distance from the junction's entry to its exit [m]."""
        return self.exit - self.entry

    @property
    def turn(self) -> float:
        """By how much it turns in the junction [rad], positive to the left, in (−π, π]."""
        (ax, ay), (bx, by) = self.heading_in.tolist(), self.heading_out.tolist()
        return math.atan2(ax * by - ay * bx, ax * bx + ay * by)

    @cached_property
    def _alone(self) -> Bundle:
        return Bundle((self,))

    def position(self, s: npt.ArrayLike) -> Floats:
        """x, y [m] at `s`, shape (..., 2); straight on beyond both ends. See `locate` too."""
        return self._alone.position(0, s)

    def pose(self, s: npt.ArrayLike, vehicle: VehicleType) -> tuple[Floats, Floats]:
        """Centre and heading of a body whose front bumper is at `s`, see `Bundle.pose`."""
        return self._alone.pose(0, s, vehicle)

    def bodies(self, s: npt.ArrayLike, vehicle: VehicleType) -> Floats:
        """Corners (..., 4, 2) [m] of the vehicle's oriented rectangle with its front at `s`."""
        return self._alone.bodies(0, s, vehicle)

    @property
    def line(self) -> shapely.LineString:
        """The centre line as a shapely polyline, from road entry to road end."""
        line: shapely.LineString = self._alone.lines[0]
        return line


@dataclass(frozen=True, eq=False)
class Bundle:
    """Several paths side by side, for places on many of them at once.

    Each method takes the paths by their index, which broadcasts with `s` [m].
    """

    paths: tuple[Path, ...]

    @cached_property
    def _table(self) -> tuple[Floats, ...]:
        """Entry, exit, metres per segment, and headings (x in, y in, x out, y out), by path."""
        rows = [
            (it.entry, it.exit, it.crossing / ARC_SEGMENTS, *it.heading_in, *it.heading_out)
            for it in self.paths
        ]
        return tuple(np.array(rows, float).T.copy())

    @cached_property
    def _points(self) -> tuple[Floats, Floats]:
        """x and y of all points, path by path."""
        x, y = np.concatenate([it.points for it in self.paths]).T.copy()
        return x, y

    @cached_property
    def lines(self) -> npt.NDArray[np.object_]:
        """`Path.line` of each."""
        ends = np.array([[it.start, it.length] for it in self.paths])
        begin, end = np.moveaxis(self.position(np.arange(len(ends))[:, None], ends), 1, 0)
        inside = np.array([it.points for it in self.paths])
        points = np.concatenate([begin[:, None], inside, end[:, None]], axis=1)
        return np.asarray(shapely.linestrings(points))

    def position(self, which: Indices, s: npt.ArrayLike) -> Floats:
        """x, y [m] at `s`, shape (..., 2); straight on beyond both ends."""
        entry, end, step, x_in, y_in, x_out, y_out = (it.take(which) for it in self._table)
        s = np.asarray(s, dtype=float)
        past = s - entry
        t = np.clip(past / step, 0.0, ARC_SEGMENTS)
        k = np.minimum(t.astype(int), ARC_SEGMENTS - 1)
        w = t - k
        k = k + np.multiply(which, ARC_SEGMENTS + 1)
        before, after, rest = np.minimum(past, 0.0), np.maximum(s - end, 0.0), 1.0 - w
        place = np.empty((*w.shape, 2))
        for axis, enters, leaves in ((0, x_in, x_out), (1, y_in, y_out)):
            points = self._points[axis]
            inside = points.take(k) * rest + points.take(k + 1) * w
            place[..., axis] = inside + before * enters + after * leaves
        return place

    def pose(self, which: Indices, s: npt.ArrayLike, vehicle: VehicleType) -> tuple[Floats, Floats]:
        """Centre (..., 2) [m] and unit heading (..., 2) of a body whose front bumper is at `s`.

        The middle of the front bumper lies on the path. Without a `rear_axle`, that of the rear
        bumper does too, so the body is the chord between them; otherwise see `Trail`.
        """
        front = self.position(which, s)
        if vehicle.rear_axle is not None:
            heading = self._dragged(which, s, vehicle.rear_axle)
        else:
            along = front - self.position(which, np.asarray(s, dtype=float) - vehicle.length)
            x, y = along[..., 0], along[..., 1]
            heading = along / np.sqrt(x * x + y * y)[..., None]
        return front - heading * (vehicle.length / 2.0), heading

    def _dragged(self, which: Indices, s: npt.ArrayLike, axle: float) -> Floats:
        """Unit heading (..., 2) of a body that drags a rear axle, with its front bumper at `s`."""
        trails, s = [trail_of(path, axle) for path in self.paths], np.asarray(s, dtype=float)
        along, lengths, halves = map(np.concatenate, zip(*trails, strict=True))
        entry, end = (column[which] for column in self._table[:2])
        t = np.clip((s - entry) / (end - entry) * ARC_SEGMENTS, 0.0, ARC_SEGMENTS)
        k = t.astype(int)
        at = k + np.multiply(which, ARC_SEGMENTS + 1)
        driven = (t - k) * lengths[at] + np.maximum(s - end, 0.0)
        half = halves[at] * np.exp(-driven / axle)
        (x, y), norm = np.moveaxis(along[at], -1, 0), 1.0 + half * half
        cos, sin = (1.0 - half * half) / norm, 2.0 * half / norm
        return np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1)

    def bodies(self, which: Indices, s: npt.ArrayLike, vehicle: VehicleType) -> Floats:
        """Corners (..., 4, 2) [m] of the vehicle's oriented rectangle with its front at `s`."""
        centre, heading = self.pose(which, s, vehicle)
        along = heading * (vehicle.length / 2.0)
        across = np.stack([-heading[..., 1], heading[..., 0]], axis=-1) * (vehicle.width / 2.0)
        corners = [along + across, along - across, -along - across, -along + across]
        return np.stack([centre + corner for corner in corners], axis=-2)


class Trail(NamedTuple):
    """How a body that drags its rear axle stands where its front bumper passes a path's points.

    This is the bicycle model without slip: the rear axle, at the distance ℓ from the front bumper,
    only rolls along the body. So θ' = sin(ψ − θ)/ℓ per metre that the front bumper drives, where θ
    is the heading of the body and ψ that of the path (the tractrix; Sayers 1991, Vehicle System
    Dynamics 20:297). On a straight piece of the path, tan((θ − ψ)/2) falls as exp(−distance/ℓ), so
    the heading is exact between the points, too. Shapes (points, …); the last row is the exit lane.
    """

    along: Floats  #: unit vector from each point to the next, (points, 2)
    lengths: Floats  #: distance to the next [m]; 0 for the last
    halves: Floats  #: tan((θ − ψ)/2) at each point, ψ being the heading of the piece that follows


@lru_cache(maxsize=1024)
def trail_of(path: Path, axle: float) -> Trail:
    """The trail of a body with its rear axle `axle` behind the front bumper [m]."""
    pieces = np.diff(path.points, axis=0)
    lengths = np.linalg.norm(pieces, axis=1)
    along = np.vstack([pieces / lengths[:, None], path.heading_out])
    ways = np.arctan2(along[:, 1], along[:, 0]).tolist()
    theta, halves = math.atan2(path.heading_in[1], path.heading_in[0]), []
    for way, length in zip(ways, [*lengths.tolist(), 0.0], strict=True):
        halves.append(math.tan(math.remainder(theta - way, math.tau) / 2.0))
        theta = way + 2.0 * math.atan(halves[-1] * math.exp(-length / axle))
    return Trail(along, np.append(lengths, 0.0), np.array(halves))


def dragged(
    points: Sequence[Sequence[float]], headings: Sequence[float], crossing: float, past: float,
    halves: Sequence[float], axle: float,
) -> tuple[float, float]:  # fmt: skip
    """Unit heading of `Path.pose` with a rear axle, as `locate` gives the position.

    `halves` are those of the `Trail`, and `axle` is where the rear axle is [m].
    """
    last = len(points) - 1
    if past >= crossing:
        k, driven, x, y = last, past - crossing, headings[2], headings[3]
    else:
        t = max(past, 0.0) / crossing * last
        k = min(int(t), last - 1)
        x, y = points[k + 1][0] - points[k][0], points[k + 1][1] - points[k][1]
        length = math.hypot(x, y)
        driven, x, y = (t - k) * length, x / length, y / length
    half = halves[k] * math.exp(-driven / axle)
    norm = 1.0 + half * half
    cos, sin = (1.0 - half * half) / norm, 2.0 * half / norm
    return x * cos - y * sin, x * sin + y * cos


def locate(
    points: Sequence[Sequence[float]], headings: Sequence[float], crossing: float, past: float
) -> tuple[float, float]:
    """`Path.position` of one point, `past` the junction entry [m], in plain floats.

    `headings` are the four numbers of `Path.heading_in` and `Path.heading_out`. It takes both
    lists and arrays: the kernel compiles it, and plain Python calls it millions of times.
    """
    last = len(points) - 1
    if past <= 0.0:
        return points[0][0] + past * headings[0], points[0][1] + past * headings[1]
    if past >= crossing:
        over = past - crossing
        return points[last][0] + over * headings[2], points[last][1] + over * headings[3]
    t = past / crossing * last
    k = min(int(t), last - 1)
    w = t - k
    x, y = points[k][0], points[k][1]
    return x + w * (points[k + 1][0] - x), y + w * (points[k + 1][1] - y)
