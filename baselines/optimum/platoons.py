"""When each vehicle of a lane can be at its mark at the earliest, behind those ahead of it.

A *reference* drives for each vehicle, tick by tick: it enters as soon as it can, never waits, and
follows the reference ahead by the IDM. With y ≤ 0 for how far a real vehicle is ahead of its
reference and e for how much faster it is, a real one stays in the *cone*

    y ≤ 0  and  e ≤ −r·y,

whatever it is told: a vehicle that has fallen behind may be faster, but only in proportion to how
far it is behind. So none passes a place before its reference does.

*Why it stays there.* A controller only lowers what the law asks for. The next speed v + F·dt grows
with v (dt·c ≤ 1) and falls with y, so the worst states are those with e = −r·y. Along them F is
concave in |y|: its free part is, and the ratio z of wanted and actual gap is convex, for it is a
quadratic over a linear term (`_safe` says when, and takes a larger gap otherwise). A concave
function is below its tangents, so e' ≤ h·|y| with h = r·(1 − c·dt) + k·dt, where c = −∂F/∂v and k =
∂F/∂gap at the reference. As |y'| ≥ |y|·(1 − dt·(r + h)/2), the next cone has r' = h / (1 − dt·(r +
h)/2). In continuous time it is r' = r² − c·r + k, which stays small where the law damps well (c² >
4k), as the IDM does near its limit. On such orders: Hirsch, Smith 2005, Monotone Dynamical Systems
(Handbook of Differential Equations: ODE 2).

*The vehicle ahead* is in the cone of its own reference, too: up to (u − w)/r further behind at a
speed of up to the limit u. The law asks for less behind it than behind the reference as long as
z ≥ r·v / (2√(ab)). Where that may fail, the law is asked behind both ends of this range, and the
higher answer counts: z is a linear term over a linear one, so none between them asks for less.

*Where the cone gets too wide* (as with a small gap at a low speed), the reference drives on at the
limit, which no vehicle exceeds, and starts anew from there.

Until it has to slow down for the junction, a vehicle is compared with its reference. From there it
is as fast as alone (`baselines.optimum.alone`), and so is what those behind it follow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baselines.optimum.alone import Drive, drives
from baselines.prediction import Floats, law_of
from minisim.carfollowing import insertion_speed
from minisim.control import Site
from minisim.jit import njit, njit_inline
from minisim.junction.movements import Ints
from minisim.junction.partings import branch
from minisim.laws import IDM, Traits, traits_of

#: The least r [1/s]: a cone may be wider than it must.
NARROWEST = 0.02

#: The widest cone that goes on, as r·dt, and the smallest gap [m].
WIDEST, CLOSEST = 0.5, 0.1

#: References drive for so much longer than the road takes at the limit [s], and so far past the
#: mark [m], as those behind them follow them there.
LONGEST, BEYOND = 120.0, 60.0

#: Tangents are tried up to so far behind a reference [m].
FURTHEST = 60.0


class Reference(NamedTuple):
    """What no vehicle is ahead of; one value per tick, from `first` on."""

    first: int
    s: Floats  #: its front, past the junction entry [m]
    v: Floats  #: its speed [m/s]
    r: Floats  #: of its cone [1/s]
    length: float  #: of the vehicle [m]


#: An empty road.
NONE = Reference(0, np.empty(0), np.empty(0), np.empty(0), 0.0)


class Road(NamedTuple):
    """Where a vehicle is compared with its reference (SI units); places are past the entry."""

    start: float  #: where its front is at insertion
    end: float  #: where it has to slow down, or no longer matters
    limit: float
    depart: float  #: highest speed at insertion
    dt: float


def earliest(
    site: Site, enters: Ints, lane: Ints, kind: Ints, marks: Floats, depart: float | None = None
) -> Floats:
    """When vehicles can be at their marks at the earliest [s], shape (k,).

    `enters` is the first tick at which each can enter. Vehicles are sorted by lane, and by their
    order in it. `marks` are places past the entry, by kind [m]. For vehicles of a law other than
    the IDM, it is when they would be there alone.
    """
    ways, m = drives(site, depart), len(site.intersection.movements)
    reach = branch(site.intersection, site.fleet) - site.intersection.approach_length
    roads = [_road(site, way, float(mark), depart) for way, mark in zip(ways, marks, strict=True)]
    traits = [traits_of(it) for it in site.types]
    ready, ahead = np.zeros(len(kind)), NONE
    for i, k in enumerate(kind.tolist()):
        way, road = ways[k], roads[k]
        if road is None:
            ready[i] = enters[i] * site.dt + way.before + way.until(marks[k])
            continue
        until = math.inf
        if i == 0 or lane[i] != lane[i - 1]:
            ahead = NONE
        else:
            until = float(reach[kind[i - 1] % m, k % m]) + ahead.length
        own = _reference(traits[k // m], road, int(enters[i]), ahead, until)
        place = min(float(marks[k]), road.end)
        passes = _passes(own, place, site.dt)
        ready[i] = passes + float(way.until(marks[k]) - way.until(place))
        ahead = own if marks[k] < road.end else _slowing(own, way, place, passes, site.dt)
    return ready


def _road(site: Site, way: Drive, mark: float, depart: float | None) -> Road | None:
    """Up to where a vehicle may drive at the limit of its approach lane; None if nowhere."""
    law = law_of(site)
    if law.model != IDM:
        return None
    limit = way.limit
    free = way.v >= limit
    if way.behind > limit:
        free &= way.s <= way.crossing
    if not free.any():
        return None
    begin = int(free.argmax())
    slow = np.flatnonzero(~free[begin:])
    end = float(way.s[begin + slow[0] - 1 if len(slow) else -1])
    first = limit if depart is None else min(depart, limit)
    return Road(float(way.s[0]), min(end, mark + BEYOND), limit, first, law.dt)


def _reference(me: Traits, road: Road, enters: int, ahead: Reference, until: float) -> Reference:
    """That of a vehicle behind another one, which matters while its front is before `until`."""
    steps = round(((road.end - road.start) / road.limit + LONGEST) / road.dt)
    s, v, r = np.empty((3, steps))
    gone = ahead.first + int(ahead.s.searchsorted(until))
    first, count = _follow(
        me, road, enters, gone, ahead.first, ahead.s - ahead.length, ahead.v, ahead.r, s, v, r
    )
    return Reference(first, s[:count], v[:count], r[:count], me.length)


def _passes(own: Reference, place: float, dt: float) -> float:
    """When a reference passes a place at the earliest [s]."""
    n = int(own.s.searchsorted(place))
    if n == 0 or n == len(own.s):
        return (own.first + n) * dt
    pace = max(float(own.v[n - 1]), float(own.v[n]))
    return (own.first + n - 1) * dt + (place - float(own.s[n - 1])) / pace


def _slowing(own: Reference, way: Drive, place: float, passes: float, dt: float) -> Reference:
    """A reference that from a place on drives as fast as a vehicle does alone."""
    n = int(own.s.searchsorted(place))
    ticks = own.first + n + np.arange(round(LONGEST / dt))
    s = np.interp(ticks * dt - passes + way.until(place), way.time, way.s)
    s = s[: int(s.searchsorted(place + BEYOND))]
    v, steepest = way.speed(s), max(float((-np.diff(way.v) / np.diff(way.s)).max()), NARROWEST)
    kept = (own.s, own.v, own.r)
    s, v, r = map(np.append, (it[:n] for it in kept), (s, v, np.full(len(s), steepest)))
    return Reference(own.first, s, v, r, own.length)


@njit
def _follow(
    me: Traits, road: Road, enters: int, gone: int, first: int, rear: Floats, speed: Floats,
    cone: Floats, s_out: Floats, v_out: Floats, r_out: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Fill the arrays of a reference; returns its first tick, and how many there are.

    The rear, speed and cone of the reference ahead begin at tick `first`, until it is `gone`.
    """
    u, dt, q = road.limit, road.dt, 2.0 * math.sqrt(me.a * me.b)
    gone = min(gone, first + len(rear))
    tick, v = enters, road.depart
    while tick < gone:
        gap = rear[tick - first] - road.start if tick >= first else -math.inf
        if gap >= me.min_gap:
            w, most = speed[tick - first], 0.0
            back = (u - w) / cone[tick - first]
            most = insertion_speed(gap, w, me.a, me.b, me.headway, me.min_gap)
            if gap - back >= me.min_gap:
                other = insertion_speed(gap - back, u, me.a, me.b, me.headway, me.min_gap)
                most = max(most, other)
            v = min(v, most)
            break
        tick += 1
    begins, s, r = tick, road.start, NARROWEST
    # One that enters later does so as soon as it has a gap, which has grown for less than a step.
    late = min(
        road.depart,
        insertion_speed(me.min_gap + u * dt, u, me.a, me.b, me.headway, me.min_gap),
    )
    for k in range(len(s_out)):
        s_out[k], v_out[k], r_out[k] = s, v, r
        if s >= road.end:
            return begins, k + 1
        gap, w, its = math.inf, u, 1.0
        if tick < gone:
            gap, w, its = rear[tick - first] - s, speed[tick - first], cone[tick - first]
        v_new, r_new = _step(me, u, dt, q, v, r, gap, w, its)
        s += (v + v_new) / 2.0 * dt if r_new > 0.0 else u * dt
        v, tick = v_new, tick + 1
        r = max(r_new, NARROWEST, (late - v) / (s - road.start))
    return begins, len(s_out)


@njit_inline
def _step(
    me: Traits, u: float, dt: float, q: float, v: float, r: float, gap: float, w: float, its: float
) -> tuple[float, float]:
    """The next speed of a reference, and the r of its cone; u and −1 if that is too wide.

    The one ahead is at a speed w, with a cone of its own; `q` is 2√(ab).
    """
    if r * dt > WIDEST:
        return u, -1.0
    # Vehicles further back than this are in the cone at any speed, if r is at least `wide`.
    back = 1.5 * (u - v) / r + u * dt
    gap = _safe(me, u, dt, q, v, r, gap, w)
    low = min(max(v, math.sqrt(me.min_gap * q)), u)
    ahead = me.min_gap / low + me.headway + (low - w) / q < its * (gap + back) / q
    further, top = gap, w
    if w < u and ahead and gap < math.inf:
        further, top = _safe(me, u, dt, q, v, r, gap - (u - w) / its, u), u
    acc = _asked(me, u, q, v, gap, w)
    if top > w:
        acc = max(acc, _asked(me, u, q, v, further, top))
    acc = max(acc, -me.b_max)
    h = _slope(me, u, dt, q, v, r, gap, w, acc)
    if top > w:
        h = max(h, _slope(me, u, dt, q, v, r, further, top, acc))
    if (u - v) * (1.0 - h / r) > dt * (acc + me.b_max):
        h = r
    v_new = min(max(v + acc * dt, 0.0), u)
    part = 1.0 - dt * (r + h) / 2.0
    if part < WIDEST:
        return u, -1.0
    wide = (u - v_new) / (back - dt * (u - min(v, v_new)))
    return v_new, max(h / part, wide, NARROWEST)


@njit_inline
def _asked(me: Traits, u: float, q: float, v: float, gap: float, w: float) -> float:
    """What the IDM asks for [m/s²]."""
    z = _wanted(me, q, v, w)[0] / gap
    return float(me.a * (1.0 - (v / u) ** me.delta - z * z))


@njit_inline
def _safe(
    me: Traits, u: float, dt: float, q: float, v: float, r: float, gap: float, w: float
) -> float:
    """The gap, or a larger one, for which the next speed grows with the speed, and z is convex.

    In a larger gap the law asks for more, so a larger one bounds it.
    """
    if gap == math.inf:
        return gap
    top, steep = _wanted(me, q, u, w)
    wanted, more = _wanted(me, q, v, w)
    least = math.sqrt(2.0 * me.a * dt * top * steep / max(1.0 - me.a * me.delta * dt / u, 0.1))
    if gap < least:
        far = gap + (u - v) / r  # the gap of those back enough to be at the limit
        if gap <= CLOSEST:
            gap = least
        else:
            z, n = max(wanted / gap, top / far), max(more / gap, steep / far)
            if dt * me.a * (me.delta / u + 2.0 * z * n) > 1.0:
                gap = least
    x = v - r * gap  # the quadratic over the linear term, where that is 0
    return gap if me.min_gap + x * me.headway + x * (x - w) / q >= 0.0 else math.inf


@njit_inline
def _slope(
    me: Traits, u: float, dt: float, q: float, v: float, r: float, gap: float, w: float, acc: float
) -> float:
    """The least h for which e' ≤ h·|y| is known, from tangents at several places."""
    best, y = math.inf, 0.0
    while y < FURTHEST:
        its = v + r * y
        wanted, more = _wanted(me, q, its, w)
        z, pace = wanted / (gap + y), (its / u) ** me.delta
        c = me.a * (me.delta * pace / max(its, 1e-9) + 2.0 * z * more / (gap + y))
        h = r * (1.0 - c * dt) + 2.0 * me.a * z * z / (gap + y) * dt
        e = r * y + dt * (me.a * (1.0 - pace - z * z) - acc)
        if e <= h * y + 1e-12:
            best = min(best, h)
        y = 2.0 * y + 1.0
    return max(best, 0.0)


@njit_inline
def _wanted(me: Traits, q: float, v: float, w: float) -> tuple[float, float]:
    """The gap that the IDM wants, and how it grows with the speed [s]."""
    dynamic = v * me.headway + v * (v - w) / q
    if dynamic <= 0.0:
        return me.min_gap, 0.0
    return me.min_gap + dynamic, me.headway + (2.0 * v - w) / q
