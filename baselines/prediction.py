"""Where a vehicle will be, step by step, if it drives on by the car-following law of the hosts.

The vehicle follows at most two others, whose motion is known: the one ahead in its lane, and the
one that enters the same exit lane before it. Positions are distances past the junction entry,
negative before it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.carfollowing import ballistic, gap_ratio, idm, iidm, speed_towards
from minisim.control import LATERAL_ACCELERATION, Site
from minisim.jit import njit

Floats = npt.NDArray[np.float64]


class Following(NamedTuple):
    """Car following of a site's vehicles, from `minisim.vehicle.VehicleType` (SI units)."""

    dt: float
    a: float
    b: float
    b_max: float
    headway: float
    min_gap: float
    delta: float
    improved: bool
    length: float
    limit: float

    @classmethod
    def of(cls, site: Site) -> Following:
        """The law of a site's vehicles on its roads."""
        v = site.vehicle
        rates = v.acceleration, v.deceleration, v.max_deceleration
        gaps = v.headway, v.min_gap, v.exponent
        return cls(site.dt, *rates, *gaps, v.model == "iidm", v.length, site.speed_limit)


class Course(NamedTuple):
    """What a prediction needs of a path."""

    crossing: float  #: from entry to exit [m]
    turn: float  #: highest speed inside the junction [m/s]
    exit_arm: int  #: index of the arm that it leaves by


def courses(site: Site) -> tuple[Course, ...]:
    """The courses of all movements of a site."""
    junction = site.intersection
    turns = [junction.turn_speed(path.movement, LATERAL_ACCELERATION) for path in junction.paths]
    return tuple(
        Course(path.exit - path.entry, min(site.speed_limit, turn), path.exit_arm)
        for path, turn in zip(junction.paths, turns, strict=True)
    )


class Leader(NamedTuple):
    """A vehicle with known motion, as its follower meets it."""

    s: Floats  #: positions [m], one a step from now on; after the last it is gone
    v: Floats  #: speeds [m/s]
    until: float = math.inf  #: its rear matters up to this position on its own path [m]
    shift: float = 0.0  #: added to its position to measure it on the follower's path [m]


NO_LEADER = Leader(np.empty(0), np.empty(0))


def predict(
    law: Following,
    course: Course,
    position: float,
    speed: float,
    *,
    lane: Leader = NO_LEADER,
    exit_lane: Leader = NO_LEADER,
    beyond: float = 0.0,
    horizon: float = 60.0,
) -> tuple[Floats, Floats] | None:
    """Positions [m] and speeds [m/s] of a vehicle, one a step from now on, if it may drive on.

    It follows the vehicle ahead in its lane and the one that enters its exit lane before it, until
    its rear is `beyond` [m] past the exit. None if that takes longer than the horizon [s], or if a
    leader appears beside or behind it, which would be an emergency.
    """
    steps = math.ceil(horizon / law.dt)
    s, v = np.empty(steps), np.empty(steps)
    count = _drive(law, course, position, speed, lane, exit_lane, beyond, s, v)
    return (s[:count].copy(), v[:count].copy()) if count else None


@njit
def _drive(
    law: Following,
    course: Course,
    position: float,
    speed: float,
    lane: Leader,
    exit_lane: Leader,
    beyond: float,
    s_out: Floats,
    v_out: Floats,
) -> int:
    """Fill `s_out` and `v_out`; the number of steps, or 0 if the vehicle does not get through."""
    s, v = position, speed
    end = course.crossing + law.length + beyond
    for k in range(len(s_out)):
        s_out[k], v_out[k] = s, v
        if s >= end:
            return k + 1
        z = 0.0
        first = True  # no vehicle is between it and the junction
        if k < len(lane.s):
            first = lane.s[k] >= 0.0
            rear = lane.s[k] - law.length
            if rear < lane.until:
                if rear <= s:
                    return 0
                z = gap_ratio(v, rear - s, lane.v[k], law.a, law.b, law.headway, law.min_gap)
        if k < len(exit_lane.s) and exit_lane.s[k] >= 0.0 and (first or s >= 0.0):
            gap = exit_lane.s[k] + exit_lane.shift - law.length - s
            if gap <= 0.0:
                return 0
            z = max(z, gap_ratio(v, gap, exit_lane.v[k], law.a, law.b, law.headway, law.min_gap))
        v0 = course.turn if 0.0 <= s < course.crossing else law.limit
        if law.improved:
            acc = iidm(v, v0, z, law.a, law.b, law.delta)
        else:
            acc = idm(v, v0, z, law.a, law.b, law.delta)
        if s < 0.0 and v + acc * law.dt > course.turn:
            slower = max(speed_towards(v, course.turn, -s, law.b, law.dt), course.turn)
            acc = min(acc, max((slower - v) / law.dt, -law.b))
        s, v = ballistic(s, v, max(acc, -law.b_max), law.dt)
    return 0
