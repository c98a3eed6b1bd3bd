"""How much time must lie between two vehicles, whatever decides: what makes the bound a bound.

Two bodies on paths of different arms must not touch. In the plane of their positions the touching
ones form a region (`minisim.junction.coordination`). If the first vehicle passes first, it is past
s₁ when the second one is at s₂, at each point (s₁, s₂) of the region.

Each movement has a *mark*, a place on its path, and a vehicle counts with the time t at which it
passes its mark. Take a point of the region with s₁ past the mark m₁ of the first and s₂ before the
mark m₂ of the second. The first gets from its mark to s₁ no sooner than alone, and so does the
second from s₂ to its mark. With the least times τ (`baselines.optimum.alone`), it follows that
t₂ − t₁ ≥ (τ₁(s₁) − τ₁(m₁)) + (τ₂(m₂) − τ₂(s₂)). The largest such sum is the separation.

So a vehicle may wait inside the junction, if only it does not clear the way of one vehicle before
its mark, or wait for another past it. Marks are chosen so that few pairs of movements do; these
count as free of conflict, which makes the bound lower, but not wrong.

In a lane, the first vehicle is ahead until its rear has turned off. The gap behind it is at least
that of `baselines.optimum.following`, if the vehicles drive by the IDM, and positive otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from baselines.optimum.alone import Drive, drives
from baselines.optimum.following import Gaps, least_gaps, least_losses
from baselines.optimum.sequencing import WAKE_STEP, Rules
from baselines.prediction import Floats, law_of
from minisim.control import Site
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools, Ints
from minisim.junction.partings import branch
from minisim.junction.sweeps import boxes_apart
from minisim.laws import IDM, traits_of
from minisim.vehicle import VehicleType

#: Spacing of the positions at which bodies are compared, and of possible marks [m].
STEP, MARK_STEP = 0.1, 0.5

#: How many speeds of a follower are tried.
SPEEDS = 40

#: How far past the junction vehicles are compared that follow each other on an exit lane [m].
PAST = 50.0

#: The longest time behind another vehicle that counts there [s].
WAKE = 12.0

#: What it costs to lose the order of two movements of a lane [s]: more than anything else.
LOST = 1e6

#: Vehicles are compared from this far before the entry on [m]: more than a length and a gap.
BEFORE = 60.0


class Edges(NamedTuple):
    """The far edge of the region in which two bodies touch, past the entry [m], shape (k,) each."""

    own: Floats  #: where the vehicle is that passes second
    other: Floats  #: up to where the first one still touches it


@lru_cache(maxsize=4096)
def edges(
    intersection: Intersection, p: int, one: VehicleType, q: int, other: VehicleType
) -> Edges:
    """The edge for a vehicle of movement q after one of movement p, of different arms.

    If the region has several parts, only the largest counts: each can be passed in its own order.
    """
    (s, a, along, half), (t, b, across, its) = (
        _poses(intersection, k, it) for k, it in ((p, one), (q, other))
    )
    apart = boxes_apart((a[:, None] - b), along[:, None], across[None, :], half, its)
    parts, count = ndimage.label(apart < 0.0, np.ones((3, 3)))
    if not count:
        return Edges(np.empty(0), np.empty(0))
    largest = parts == 1 + np.argmax(np.bincount(parts.ravel())[1:])
    column = np.flatnonzero(largest.any(axis=0))
    last = len(s) - 1 - np.argmax(largest[::-1, column], axis=0)
    return Edges(t[column], s[last])


def _poses(intersection: Intersection, k: int, it: VehicleType) -> tuple[Floats, ...]:
    path = intersection.paths[k]
    s = np.arange(0.0, path.crossing + it.length, STEP)
    return s, *path.pose(path.entry + s, it), np.array([it.length, it.width]) / 2.0


class Needs(NamedTuple):
    """What every controller keeps whose vehicles do not collide; k kinds of vehicles."""

    rules: Rules
    until: Floats  #: least time from insertion to the mark [s], (k,)
    marks: Floats  #: places past the entry, (k,) [m]
    at_limit: Floats  #: what the whole way takes at the limits of its roads [s], (k,)


def necessary(site: Site, depart_speed: float | None = None) -> Needs:
    """The needs of a site's vehicles, by kind: the movements of each type in turn."""
    return _necessary(alike(site), depart_speed)


def alike(site: Site) -> Site:
    """The same site with no demand and no seed, on which nothing here depends."""
    return replace(site, seed=0, demand=(0.0,) * site.intersection.n, inflow=None)


@lru_cache(maxsize=64)
def _necessary(site: Site, depart_speed: float | None) -> Needs:
    ways = drives(site, depart_speed)
    marks = _places(site)
    tables, same = _tables(site, ways, marks)
    chosen = _marks(tables, same)
    each = np.arange(len(ways))
    between = tables[each[:, None], each, chosen[:, None], chosen]
    # If there is none in one order, vehicles may take turns past their marks in the other, too.
    between = np.where((between > 0.0) & (between.T > 0.0), between, -math.inf)
    at_mark = np.array([float(it.until(marks[k])) for it, k in zip(ways, chosen, strict=True)])
    exits = np.tile(site.intersection.movements.exits, len(site.types))
    past, wake = zip(*(_wake(site, k, way) for k, way in enumerate(ways)), strict=True)
    rules = Rules(
        between, (between > -math.inf) & (exits[:, None] == exits), np.array(past) - at_mark,
        np.array([it.time[-1] for it in ways]) - at_mark, np.array(wake),
    )  # fmt: skip
    return Needs(
        rules, np.array([it.before for it in ways]) + at_mark,
        marks[chosen],
        np.array([it.at_limit for it in ways]),
    )  # fmt: skip


def _wake(site: Site, kind: int, way: Drive) -> tuple[float, Floats]:
    """Least time from the entry to where vehicles on the exit lane are compared; losses there."""
    junction, m = site.intersection, len(site.intersection.movements)
    path, it = junction.paths[kind % m], site.types[kind // m]
    begin = int(way.s.searchsorted(path.crossing + min(PAST, (way.s[-1] - path.crossing) / 2.0)))
    length = min(one.length for one in site.types)
    gone, limit = float(way.s[-1] - way.s[begin]), site.limit(path.exit_arm)
    if law_of(site).model != IDM:
        return float(way.time[begin]), np.zeros(round(WAKE / WAKE_STEP) + 1)
    alone = float(way.time[-1] - way.time[begin])
    lost = least_losses(
        traits_of(it), limit, site.dt, length, gone, gone, float(way.v[begin]), alone, WAKE_STEP,
        round(WAKE / WAKE_STEP) + 1,
    )  # fmt: skip
    return float(way.time[begin]), np.maximum(lost - lost[-1], 0.0)


def _places(site: Site) -> Floats:
    """Possible marks, past the entry [m]: until the longest vehicle has left the longest path."""
    longest = max(path.crossing for path in site.intersection.paths)
    return np.arange(0.0, longest + max(it.length for it in site.types), MARK_STEP)


def _tables(site: Site, ways: Sequence[Drive], marks: Floats) -> tuple[Floats, Bools]:
    """The separations for each choice of marks, shape (kinds, kinds, marks, marks) [s].

    And which pairs of kinds are of one lane, shape (kinds, kinds).
    """
    junction, types, m = site.intersection, site.types, len(site.intersection.movements)
    kinds = [(p, it) for it in types for p in range(m)]
    tables = np.full((len(kinds), len(kinds), len(marks), len(marks)), -math.inf)
    same = np.zeros(tables.shape[:2], bool)
    reach = branch(junction, site.fleet) - junction.approach_length
    for j, (q, other) in enumerate(kinds):
        gaps = _gaps(site, other, q)
        for i, (p, one) in enumerate(kinds):
            if not junction.allowed[p] or not junction.allowed[q]:
                continue
            if junction.movements.apart[p, q]:
                crossed = edges(junction, p, one, q, other)
                tables[i, j] = _crossing(crossed, ways[i], ways[j], marks)
            else:
                same[i, j] = True
                until = float(reach[p, q]) + one.length
                a = other.acceleration
                tables[i, j] = _behind(gaps, ways[i], ways[j], marks, one.length, until, a, site.dt)
    return tables, same


def _crossing(crossed: Edges, first: Drive, second: Drive, marks: Floats) -> Floats:
    """The separations of two kinds of different arms, by their marks [s]."""
    between = first.until(crossed.other) - second.until(crossed.own)
    table = np.full((len(marks), len(marks)), -math.inf)
    for k, (own, other) in enumerate(zip(crossed.own, crossed.other, strict=True)):
        here = table[: marks.searchsorted(other, "right"), marks.searchsorted(own) :]
        np.maximum(here, between[k], out=here)
    return table + second.until(marks) - first.until(marks)[:, None]


def _gaps(site: Site, it: VehicleType, p: int) -> Gaps:
    path, law = site.intersection.paths[p], law_of(site)
    limit = max(site.limit(path.movement.origin), site.limit(path.exit_arm))
    if law.model != IDM:
        return Gaps(np.array([0.0, limit]), np.zeros(2))
    driven = path.entry - path.start - it.length - BEFORE
    braking = max(kind.max_deceleration for kind in site.types)
    return least_gaps(traits_of(it), limit, site.dt, max(driven, 0.0), braking)


def _behind(
    gaps: Gaps, first: Drive, second: Drive, marks: Floats, length: float, until: float,
    acceleration: float, dt: float,
) -> Floats:  # fmt: skip
    """The separations of two kinds of one lane, by their marks [s].

    The first counts while its front is before `until`. Whatever speed its follower has then, it is
    a gap behind, and has to accelerate from there.
    """
    table = np.full((len(marks), len(marks)), -math.inf)
    v = np.linspace(0.0, gaps.speed[-1], SPEEDS + 1)[:, None]
    x = np.arange(-BEFORE, marks[-1] + STEP, STEP)
    at = np.round((marks + BEFORE) / STEP).astype(int)
    bound = second.speed(x)
    fastest = np.maximum(bound[:-1], bound[1:])
    for k in np.flatnonzero(marks < until).tolist():
        place = marks[k] - length - np.interp(v[:-1], *gaps)
        # Between two speeds, its gap is at least that of the lower one. A step is as fast as at its
        # end, for all rules of moving.
        ahead = np.maximum(x[1:] - place, 0.0)
        rising = np.sqrt((v[1:] + acceleration * dt) ** 2 + 2.0 * acceleration * ahead)
        needed = np.where(x[:-1] >= place, STEP / np.minimum(fastest, rising), 0.0)
        time = np.concatenate([np.zeros((SPEEDS, 1)), needed.cumsum(axis=1)], axis=1)
        at_marks = time[:, at]
        at_marks[(v[:-1] > second.speed(place))[:, 0]] = math.inf
        least = float(first.until(marks[k])) + at_marks.min(axis=0)
        least[marks < place.max()] = -math.inf
        table[: k + 1] = np.maximum(table[: k + 1], least)
    return table - first.until(marks)[:, None]


def _marks(tables: Floats, same: Bools) -> Ints:
    """Marks that make the separations large, by index; those within lanes must be positive.

    From each mark for all kinds, one kind after the other moves its mark to where it is best.
    """
    each, count = np.arange(len(tables)), tables.shape[2]
    best, most = np.zeros(len(each), int), -math.inf
    for start in range(count):
        chosen, score = np.full(len(each), start), -math.inf
        while (now := _worth(tables[each[:, None], each, chosen[:, None], chosen], same)) > score:
            score = now
            for k in each.tolist():
                ours, theirs = tables[k, each, :, chosen], tables[each, k, chosen, :]
                chosen[k] = np.argmax(_values(ours, theirs, same[k, :, None]).sum(axis=0))
        if score > most:
            best, most = chosen, score
    return best


def _worth(between: Floats, same: Bools) -> float:
    return float(_values(between, between.T, same).sum())


def _values(there: Floats, back: Floats, same: Bools) -> Floats:
    """What the separations of pairs of kinds are worth, both ways."""
    kept = (there > 0.0) & (back > 0.0)
    return np.where(kept, np.where(kept, there + back, 0.0), np.where(same, -LOST, 0.0))
