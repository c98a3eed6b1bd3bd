"""How near the ways of vehicles come, from bounds; exact shapes only where these do not decide.

A corridor (`minisim.junction.conflicts`) is the union of the hulls of each body on a path and the
next. Each hull holds the line between the middles of its bumpers and lies close around the path. So
most corridors conflict because these lines cross, or do not because the paths are far apart. Of the
few others the hulls that are near each other are compared. In shapes, m is the number of movements,
and so of paths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from minisim.fleet import Vehicles
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools, Ints
from minisim.junction.paths import Floats, Path
from minisim.vehicle import VehicleType

#: Spacing of the bodies that make up a corridor, and of those tested for zones [m].
SWEEP_STEP = 0.5

#: How far the coarse lines of paths may be off [m].
COARSE = 0.05

#: How many hulls in a row are compared at once.
BLOCK = 4

#: Distances are right to this [m], far more than rounding takes.
ROUNDING = 1e-9


class Hulls(NamedTuple):
    """Convex shapes, and an oriented box around each."""

    corners: Floats  #: shape (k, corners, 2) [m]
    centre: Floats  #: of the box, shape (k, 2) [m]
    heading: Floats  #: of the box, shape (k, 2), unit vectors
    half: Floats  #: half its length and half its width, shape (k, 2) [m]

    def of(self, which: Ints | Bools) -> Hulls:
        """The hulls at some indices, or where a mask is true."""
        return Hulls(*(column[which] for column in self))


def boxed(corners: Floats) -> Hulls:
    """The hulls of corners, shape (k, corners, 2) [m].

    A box lies along the line from the third corner to the second, which must differ.
    """
    heading = corners[:, 1] - corners[:, 2]
    heading = heading / np.hypot(*heading.T)[:, None]
    (x, y), (u, v) = np.moveaxis(corners, -1, 0), heading.T[..., None]
    low, high = np.empty((2, len(corners), 2))
    for k, at in enumerate((x * u + y * v, y * u - x * v)):
        low[:, k], high[:, k] = at.min(axis=1), at.max(axis=1)
    return _box(corners, heading, low, high)


def _box(corners: Floats, heading: Floats, low: Floats, high: Floats) -> Hulls:
    """Shapes with their boxes; `low` and `high` are their ends along and across the heading."""
    (a, b), (u, v) = (low + high).T / 2.0, heading.T
    return Hulls(corners, np.stack([a * u - b * v, a * v + b * u], -1), heading, (high - low) / 2.0)


class Sweep(NamedTuple):
    """The bodies of one type on all paths, path by path."""

    path: Ints  #: index of the path of each body, shape (k,)
    front: Floats  #: the middle of its front bumper, shape (k, 2) [m]
    rear: Floats  #: where the path is a length behind, shape (k, 2) [m]
    first: Ints  #: the bodies with a next one on their path, shape (h,)
    hulls: Hulls  #: of each of these and its next


def fronts(path: Path, vehicle: VehicleType) -> Floats:
    """`s` of the front bumpers of a corridor's bodies [m], shape (k,), `SWEEP_STEP` apart or less.

    They lead from the entry to where the rear bumper has left.
    """
    first, last = path.entry, path.exit + vehicle.length
    return np.linspace(first, last, math.ceil((last - first) / SWEEP_STEP) + 1)


@lru_cache(maxsize=16)
def sweep(intersection: Intersection, vehicle: VehicleType) -> Sweep:
    """The bodies of a type on all paths, at the `fronts` of each path."""
    each = [fronts(path, vehicle) for path in intersection.paths]
    path, s = np.repeat(np.arange(len(each)), list(map(len, each))), np.concatenate(each)
    bundle, first = intersection.bundle, np.flatnonzero(path[1:] == path[:-1])
    corners = bundle.bodies(path, s, vehicle)
    return Sweep(
        path, bundle.position(path, s), bundle.position(path, s - vehicle.length), first,
        boxed(np.concatenate([corners[first], corners[first + 1]], axis=1)),
    )  # fmt: skip


def meeting(
    intersection: Intersection, kinds: Sequence[Vehicles], clearance: float, pairs: Ints
) -> tuple[Bools, Bools]:
    """Whether two corridors are at most `clearance` [m] apart, and whether that is certain.

    Both have the shape (k,). Rows of `pairs`, shape (k, 2), are two indices of corridors: 0 … m−1
    for the first of `kinds`, m … 2m−1 for the second, and so on. Not certain are distances that
    differ from `clearance` by rounding alone (`ROUNDING`).
    """
    lines, rooms = zip(*(_trace(intersection, kind) for kind in kinds), strict=True)
    line, room, far = np.concatenate(lines), np.concatenate(rooms), clearance - 2.0 * COARSE
    coarse = shapely.simplify(line, COARSE, preserve_topology=False)  # a line has none
    crossing = coarse if far >= 0.0 else line
    for its in (coarse, crossing):
        shapely.prepare(its)
    i, j = pairs.T
    near = shapely.intersects(crossing[i], crossing[j])
    sure, open_ = np.ones(len(pairs), bool), np.flatnonzero(~near)
    i, j = pairs[open_].T
    reach = clearance + room[i] + room[j] + 2.0 * COARSE + ROUNDING
    open_ = open_[shapely.dwithin(coarse[i], coarse[j], reach)]
    if far > 0.0:
        i, j = pairs[open_].T
        near[open_] = shapely.dwithin(coarse[i], coarse[j], far)
        open_ = open_[~near[open_]]
    gaps = _gaps(intersection, kinds, clearance, pairs[open_])
    near[open_], sure[open_] = gaps <= clearance, np.abs(gaps - clearance) > ROUNDING
    return near, sure


def _gaps(
    intersection: Intersection, kinds: Sequence[Vehicles], enough: float, pairs: Ints
) -> Floats:
    """Distances of pairs of corridors [m], as `meeting`; infinite if certainly above `enough`."""
    gaps = np.full(len(pairs), math.inf)
    sweeps = [[sweep(intersection, it) for it in kind.types] for kind in kinds]
    m = len(intersection.paths)
    for one, other in ((a, b) for a in range(len(kinds)) for b in range(len(kinds))):
        mine = np.flatnonzero((pairs[:, 0] // m == one) & (pairs[:, 1] // m == other))
        for a, b in ((a, b) for a in sweeps[one] for b in sweeps[other] if len(mine)):
            i, j, of = _near(a, b, pairs[mine] % m, enough + ROUNDING)
            np.minimum.at(gaps, mine[of], _distance(a.hulls, b.hulls, i, j))
    return gaps


def _near(a: Sweep, b: Sweep, pairs: Ints, enough: float) -> tuple[Ints, Ints, Ints]:
    """Hulls that may be `enough` [m] or less apart, two indices, and of which pair of paths."""
    (one, mine), (other, its) = (_blocks(it) for it in (a, b))
    i, j, of = _all_of(*(
        np.searchsorted(it.path[it.first[ends[0]]], [which, which + 1])
        for it, ends, which in ((a, mine, pairs[:, 0]), (b, its, pairs[:, 1]))
    ))  # fmt: skip
    close = _apart(one, other, i, j, enough) <= enough
    i, j, at = _all_of(mine[:, i[close]], its[:, j[close]])
    of = of[close][at]
    close = _apart(a.hulls, b.hulls, i, j, enough) <= enough
    return i[close], j[close], of[close]


def _all_of(one: Ints, other: Ints) -> tuple[Ints, Ints, Ints]:
    """Every index in each range of one and every one in that of the other, and of which range.

    Ranges are their beginnings and ends, shape (2, ranges).
    """
    (i, p), (j, q) = one, other
    wide = q - j
    count = (p - i) * wide
    of = np.repeat(np.arange(len(i)), count)
    row, column = np.divmod(np.arange(count.sum()) - (count.cumsum() - count)[of], wide[of])
    return i[of] + row, j[of] + column, of


def _blocks(swept: Sweep) -> tuple[Hulls, Ints]:
    """Boxes around up to `BLOCK` hulls in a row; the first of each, and the first behind it."""
    path, hulls = swept.path[swept.first], swept.hulls
    begins = np.flatnonzero((np.arange(len(path)) - np.searchsorted(path, path)) % BLOCK == 0)
    ends = np.array([begins, np.append(begins[1:], len(path))])
    middle, count = ends.sum(axis=0) // 2, np.diff(ends, axis=0)[0]
    (x, y), (u, v), (w, z), (a, b) = (
        hulls.centre.T, np.repeat(hulls.heading[middle], count, axis=0).T, hulls.heading.T,
        hulls.half.T,
    )  # fmt: skip
    cos, sin = np.abs(u * w + v * z), np.abs(u * z - v * w)
    at = np.stack([x * u + y * v, y * u - x * v], axis=-1)
    wide = np.stack([a * cos + b * sin, a * sin + b * cos], axis=-1)
    low, high = np.minimum.reduceat(at - wide, begins), np.maximum.reduceat(at + wide, begins)
    return _box(hulls.corners[middle], hulls.heading[middle], low, high), ends


def least_gap(one: Hulls, other: Hulls, i: Ints, j: Ints) -> float:
    """Smallest distance [m] between the hulls `one[i]` and `other[j]`, for indices of shape (k,).

    Infinite without any.
    """
    inside, within = one.corners.mean(axis=1), other.corners.mean(axis=1)
    enough, best = float(np.hypot(*(inside[i] - within[j]).T).min(initial=math.inf)), math.inf
    apart = _apart(one, other, i, j, enough)
    order, count = np.argsort(apart), 16
    while len(order := order[apart[order] < min(best - ROUNDING, enough + ROUNDING)]):
        now, order = order[:count], order[count:]
        best, count = min(best, float(_distance(one, other, i[now], j[now]).min())), 4 * count
    return best


def _apart(one: Hulls, other: Hulls, i: Ints, j: Ints, enough: float) -> Floats:
    """Lower bounds of the distances between hulls [m], by their boxes; infinite above `enough`."""
    apart = np.full(len(i), math.inf)
    x, y = (one.centre[i] - other.centre[j]).T
    reach = np.hypot(*one.half.T)[i] + np.hypot(*other.half.T)[j] + enough
    near = np.flatnonzero(x * x + y * y <= reach * reach)
    (i, j), x, y = (i[near], j[near]), x[near], y[near]
    apart[near] = boxes_apart(
        np.stack([x, y], -1), one.heading[i], other.heading[j], one.half[i], other.half[j]
    )
    apart[apart > enough] = math.inf
    return apart


def boxes_apart(
    between: Floats, heading: Floats, others: Floats, half: Floats, its: Floats
) -> Floats:
    """A lower bound of the distance between two boxes [m], shape (...); ≤ 0 only if they overlap.

    They are given by the vector between their centres, their headings and half their lengths and
    widths, shapes (..., 2). They are as far apart as along each of their axes (the separating-axis
    test; Gottschalk, Lin, Manocha, SIGGRAPH 1996).
    """
    (x, y), (u, v), (w, z) = (np.moveaxis(it, -1, 0) for it in (between, heading, others))
    (a, b), (c, d) = np.moveaxis(half, -1, 0), np.moveaxis(its, -1, 0)
    cos, sin = np.abs(u * w + v * z), np.abs(u * z - v * w)
    most: Floats = np.abs(x * u + y * v) - a - c * cos - d * sin
    for apart in (
        np.abs(x * v - y * u) - b - c * sin - d * cos,
        np.abs(x * w + y * z) - c - a * cos - b * sin,
        np.abs(x * z - y * w) - d - a * sin - b * cos,
    ):
        np.maximum(most, apart, out=most)
    return most


def _distance(one: Hulls, other: Hulls, i: Ints, j: Ints) -> Floats:
    """Distances between hulls [m]."""
    shapes = []
    for hulls, which in ((one, i), (other, j)):
        some, back = np.unique(which, return_inverse=True)
        drawn = shapely.convex_hull(shapely.multipoints(hulls.corners[some]))
        shapes.append(np.asarray(drawn)[back])
    return np.asarray(shapely.distance(*shapes))


def _trace(
    intersection: Intersection, vehicles: Vehicles
) -> tuple[npt.NDArray[np.object_], Floats]:
    """A line within each corridor, and the largest distance from it within the corridor [m].

    It leads through the middles of the bumpers of the longest type; both have the shape (m,).
    """
    swept = sweep(intersection, max(vehicles.types, key=lambda it: it.length))
    path = swept.path
    starts = np.flatnonzero(np.diff(path, prepend=-1))
    lines = shapely.linestrings(
        np.insert(swept.front, starts, swept.rear[starts], axis=0),
        indices=np.insert(path, starts, path[starts]),
    )
    longer = stretch(intersection)
    off = _off(swept, swept.front, swept.front, SWEEP_STEP * longer)
    return np.asarray(lines), off + np.max(
        [_around(intersection, it, longer) for it in vehicles.types], axis=0
    )


def stretch(intersection: Intersection) -> Floats:
    """How far a path leads per metre of `s` at most [m/m], shape (m,).

    That is 1, except where lengths are given and rounded.
    """
    points = np.array([path.points for path in intersection.paths])
    steps = np.linalg.norm(np.diff(points, axis=1), axis=-1).max(axis=1)
    each = [path.crossing / (len(path.points) - 1) for path in intersection.paths]
    return np.asarray(np.maximum(steps / np.array(each), 1.0))


def _around(intersection: Intersection, vehicle: VehicleType, longer: Floats) -> Floats:
    """How far from its path a hull of the type reaches at most, shape (m,) [m].

    A hull lies around the line from where the path is a length behind the first body's front to the
    front of the second, at most as far off as its farthest corner, since both are convex.
    """
    swept = sweep(intersection, vehicle)
    begin, end = swept.rear[swept.first], swept.front[swept.first + 1]
    (x, y), (u, v) = np.moveaxis(swept.hulls.corners - begin[:, None], -1, 0), (end - begin).T
    u, v = u[:, None], v[:, None]
    share = np.minimum(np.maximum((x * u + y * v) / (u * u + v * v), 0.0), 1.0)
    x, y = x - share * u, y - share * v
    farthest = np.sqrt((x * x + y * y).max(axis=1))
    most = _most(swept, farthest, len(longer))
    return most + _off(swept, swept.rear, swept.front, (vehicle.length + SWEEP_STEP) * longer)


def _off(swept: Sweep, begin: Floats, end: Floats, length: Floats) -> Floats:
    """How far a path is at most from the line between the ends of a piece of it, shape (m,) [m].

    A piece leads from `begin` of a body to `end` of the next. If it is no longer than `length`,
    shape (m,), it stays in the ellipse around its ends. Nor is it farther from where one would be
    that moved evenly from end to end.
    """
    x, y = (end[swept.first + 1] - begin[swept.first]).T
    spare = length[swept.path[swept.first]] ** 2 - x * x - y * y
    return _most(swept, np.sqrt(np.maximum(spare, 0.0)) / 2.0, len(length))


def _most(swept: Sweep, values: Floats, paths: int) -> Floats:
    """The largest of the values of each path's hulls."""
    starts = np.searchsorted(swept.path[swept.first], np.arange(paths))
    return np.maximum.reduceat(values, starts)


def swing(intersection: Intersection, vehicle: VehicleType) -> Floats:
    """How far a point of a body moves at most per metre of its front bumper [m/m], shape (m,).

    The ends of its chord c are on the path. So it turns by 2/c at most, and no point is farther
    from the chord than half the width and what the body is longer than c. With a rear axle it
    turns about its front bumper, by 1/axle at most.
    """
    longer, swept = stretch(intersection), sweep(intersection, vehicle)
    if vehicle.rear_axle is not None:
        return longer * (1.0 + (vehicle.length + vehicle.width / 2.0) / vehicle.rear_axle)
    # Between two bodies, the chord is nearly a mean of theirs, which differ by two steps at most.
    step = SWEEP_STEP * longer
    least = -_most(swept, -np.hypot(*(swept.front - swept.rear)[swept.first].T), len(longer))
    chord = np.sqrt(np.maximum(least**2 - step**2, 0.0))
    for ends in (swept.front, swept.rear):
        chord = chord - _off(swept, ends, ends, step)
    chord = chord.clip(1e-3)
    return longer * (1.0 + (vehicle.width + 2.0 * np.maximum(vehicle.length - chord, 0.0)) / chord)
