"""What the IDM costs a vehicle behind another, whatever that one does.

*Gaps.* The IDM brakes where the gap is below s0 + vT. So there is a curve g(v) of gaps over speeds
that a vehicle never falls below, once it is above: on the curve, the gap shrinks no faster than the
curve falls as the vehicle slows down (a control barrier; Ames et al. 2017, IEEE TAC 62:3861). With
w the leader's speed, that is w − v ≥ g'(v)·v̇ for every w. The curve is built from this with a
reserve for the step, and then tested: one step from every state near it, and from below it, by both
rules of moving (`ballistic`, `semi_implicit`), with a leader that brakes or accelerates as it can.

Vehicles are inserted with less behind a faster leader. Below the curve a gap recovers, by
`RECOVERY` per second at least, which the test shows too.

*Losses.* On a road with a limit u, a leader that has passed a place is nowhere ahead of a point
that leaves this place then and drives at u. Behind the leader the law asks for no more than behind
that point, from which the distance z only grows. So v as a function of z is below the solution of
dv/dz = v̇(z, v, u)/(u − v) (two solutions of an equation of first order do not cross), and z and the
time lost are above. This holds for any braking of both. The point counts until it leaves the road,
which the leader does no earlier. A vehicle may also wait first, and follow further behind.
"""

from __future__ import annotations

import itertools
import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from baselines.prediction import Floats
from minisim.laws import Traits

#: Speeds in the grid of the curve, and of leaders in the test.
SPEEDS, LEADERS = 141, 71

#: The curve is lowered by this where it cannot be kept [m].
LOWER = 0.01

#: Curves that are tried, the highest first: the share of s0 + vT at the limit at which they begin.
SHARES = (1.0, 0.95, 0.9, 0.85, 0.8, 0.7, 0.6, 0.5)

#: And what is added to the recovery while the curve is built, as the test has finer steps [m/s].
EXTRA = (0.1, 0.3)

#: Steepest slope of the curve [s]; a steeper one would only matter for small changes of speed.
STEEPEST = 4.0

#: How fast a gap below the curve recovers at 1 m/s or more; slower vehicles, in proportion [m/s].
RECOVERY = 0.5

#: Losses are followed for so much longer than the stretch takes at the limit [s].
LONGEST = 60.0

#: How far around the curve its test goes [m].
ABOVE, BELOW = 2.0, 30.0


class Gaps(NamedTuple):
    """The curve: at `speed`, no gap is smaller than `gap`."""

    speed: Floats  #: ascending from 0 [m/s]
    gap: Floats  #: at least 0 [m]


@lru_cache(maxsize=1024)
def least_losses(
    me: Traits, limit: float, dt: float, length: float, far: float, gone: float, start: float,
    alone: float, step: float, count: int,
) -> Floats:  # fmt: skip
    """What a vehicle loses on a stretch of `far` metres at least, shape (count,) [s].

    Against `alone` [s], if it begins at the speed `start` at most, behind a vehicle that began at
    each of the times 0, step, … before it, and is on its road for at least `gone` metres. At the
    beginning the gap is the way of the point but for `length` [m]. The law sees a state that is up
    to a step old, so the point counts as a step further ahead.
    """
    times = step * np.arange(count)
    ahead, v, done = limit * times - length, np.full(len(times), start), np.zeros(len(times))
    s, took = np.zeros(len(times)), 0.0
    while took < far / limit + LONGEST and (s < far).any():
        gap = np.where(limit * (times + took) < gone, ahead + limit * dt, math.inf)
        acc = _accelerations(me, v, gap, np.array(limit), limit, dt)
        after = np.minimum(v + acc * dt, limit)
        way = (v + after) / 2.0 * dt
        part = np.clip((far - s) / np.maximum(way, 1e-9), 0.0, 1.0)
        done += part * dt
        s, ahead, v, took = s + way, ahead + limit * dt - way, after, took + dt
    arrives = np.where(limit * times < length, math.inf, times + done)
    soonest = np.minimum.accumulate(arrives[::-1])[::-1]
    return np.asarray(np.maximum(soonest - times - alone, 0.0))


@lru_cache(maxsize=256)
def least_gaps(me: Traits, limit: float, dt: float, driven: float, braking: float) -> Gaps:
    """The curve of a vehicle that has driven so far since its insertion [m], up to `limit` [m/s].

    Its leaders may brake at `braking` [m/s²]. Without any curve that passes its test, gaps are only
    known to be positive.
    """
    for share, extra in itertools.product(SHARES, EXTRA):
        curve = _curve(me, limit, dt, braking, share, RECOVERY + extra)
        if all(_kept(curve, me, limit, dt, braking, stepwise) for stepwise in (False, True)):
            missing = max(_missing(curve, me, limit) - RECOVERY * driven / limit, 0.0)
            return Gaps(curve.speed, np.maximum(curve.gap - missing, 0.0))
    return Gaps(np.array([0.0, limit]), np.zeros(2))


def _accelerations(
    me: Traits, v: Floats, gap: Floats, w: Floats, limit: float, dt: float
) -> Floats:
    """What the IDM does at speeds v behind leaders of speeds w, within the brakes [m/s²]."""
    dynamic = v * me.headway + v * (v - w) / (2.0 * math.sqrt(me.a * me.b))
    wanted = me.min_gap + np.maximum(dynamic, 0.0)
    acc = me.a * (1.0 - (v / limit) ** me.delta - (wanted / np.maximum(gap, 1e-6)) ** 2)
    return np.maximum(np.maximum(acc, -me.b_max), -v / dt)


def _curve(
    me: Traits, limit: float, dt: float, braking: float, share: float, recovery: float
) -> Gaps:
    """The highest curve that keeps the condition, from `share` of s0 + vT at the limit on."""
    speed = np.linspace(limit, 0.0, SPEEDS)
    w, gap = np.linspace(0.0, limit, 2 * SPEEDS), np.zeros(SPEEDS)
    gap[0] = share * (me.min_gap + limit * me.headway)
    for i, v in enumerate(speed.tolist()):
        while gap[i] > 0.0:
            acc = _accelerations(me, np.array(v), gap[i], w, limit, dt)
            # In one step the leader may brake, and the vehicle only notices in the next one.
            unseen = dt * np.maximum(np.minimum(braking, w / dt) + acc, 0.0)
            closing = v - w + unseen + recovery * min(v, 1.0)
            held, gains = (closing > 0.0) & (acc < 0.0), acc > 0.0
            least = (closing[held] / -acc[held]).max(initial=0.0)
            most = (-closing[gains] / acc[gains]).min(initial=STEEPEST)
            if least <= most and not ((closing > 0.0) & (acc >= 0.0)).any():
                break
            gap[i] = max(gap[i] - LOWER, 0.0)
        if i + 1 < SPEEDS and gap[i] > 0.0:
            below = gap[i] - least * (v - speed[i + 1])
            gap[i + 1] = min(me.min_gap + speed[i + 1] * me.headway, max(below, 0.0))
    return Gaps(speed[::-1], gap[::-1])


def _kept(curve: Gaps, me: Traits, limit: float, dt: float, braking: float, stepwise: bool) -> bool:
    """Whether one step keeps gaps above the curve, and lets those below it recover."""
    off = np.concatenate([np.arange(-ABOVE, 1.0, 0.1), np.arange(1.0, BELOW, 1.0)])[:, None, None]
    w = np.linspace(0.0, limit, LEADERS)[None, :, None]
    harder = np.concatenate([
        np.maximum(w - braking * dt, 0.0), np.minimum(w + me.a * dt, limit)
    ], axis=2)  # fmt: skip
    for v in np.linspace(0.0, limit, SPEEDS):
        gap = np.interp(v, *curve) - off
        after = np.maximum(v + dt * _accelerations(me, v, gap, w, limit, dt), 0.0)
        pace = harder - after if stepwise else (w + harder - v - after) / 2.0
        left = np.interp(after, *curve) - (gap + dt * pace)
        allowed = np.maximum(off, 0.0) - RECOVERY * dt * min(v, 1.0) * (off >= 0.0)
        if ((left > allowed + 1e-9) & (gap > 0.0)).any():
            return False
    return True


def _missing(curve: Gaps, me: Traits, limit: float) -> float:
    """How far below the curve a vehicle may be inserted [m] (`insertion_speed`)."""
    v, w = curve.speed[:, None], np.linspace(0.0, limit, LEADERS)
    behind = me.min_gap + v * me.headway + v * (v - w) / (2.0 * math.sqrt(me.a * me.b))
    return float((curve.gap[:, None] - np.maximum(behind, me.min_gap)).max())
