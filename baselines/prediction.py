"""Where a vehicle will be, step by step, if it drives on by the car-following law of the hosts.

The vehicle is alone on its path, behind at most two others with known motion: the one ahead in its
lane, and the one that goes before it into the same exit lane. Positions here are distances past the
junction entry, negative before it.
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
    """Car following of a site's vehicles (SI units), as `minisim.vehicle.VehicleType` has it."""

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
        vehicle = site.vehicle
        return cls(
            dt=site.dt,
            a=vehicle.acceleration,
            b=vehicle.deceleration,
            b_max=vehicle.max_deceleration,
            headway=vehicle.headway,
            min_gap=vehicle.min_gap,
            delta=vehicle.exponent,
            improved=vehicle.model == "iidm",
            length=vehicle.length,
            limit=site.speed_limit,
        )


class Course(NamedTuple):
    """What a prediction needs of a path.

    Attributes:
        crossing: from entry to exit [m].
        turn: highest speed inside the junction [m/s].
        exit_arm: index of the arm that it leaves by.
    """

    crossing: float
    turn: float
    exit_arm: int


def courses(site: Site) -> tuple[Course, ...]:
    """The courses of all movements of a site."""
    junction = site.intersection
    return tuple(
        Course(
            path.exit - path.entry,
            min(site.speed_limit, junction.turn_speed(path.movement, LATERAL_ACCELERATION)),
            path.exit_arm,
        )
        for path in junction.paths
    )


class Leader(NamedTuple):
    """A vehicle with known motion, as its follower meets it.

    Attributes:
        s, v: its positions [m] and speeds [m/s], one a step from now on; after the last it is gone.
        until: its rear matters up to this position on its own path [m].
        shift: added to its position to measure it on the follower's path [m].
    """

    s: Floats
    v: Floats
    until: float = math.inf
    shift: float = 0.0


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

    Args:
        law: its car following.
        course: through the junction.
        position: past the junction entry [m].
        speed: [m/s].
        lane: the vehicle ahead in its lane.
        exit_lane: the one that enters the same exit lane before it.
        beyond: how far past the exit the rear is followed [m].
        horizon: [s].

    Returns:
        None where it does not get through within the horizon, or where a leader appears beside or
        behind it, which would be an emergency.
    """
    steps = math.ceil(horizon / law.dt)
    s, v = np.empty(steps), np.empty(steps)
    count = _drive(
        law, course.crossing, course.turn, position, speed, beyond,
        lane.s, lane.v, lane.until,
        exit_lane.s, exit_lane.v, exit_lane.shift,
        s, v,
    )  # fmt: skip
    return (s[:count].copy(), v[:count].copy()) if count else None


@njit
def _drive(
    law: Following,
    crossing: float,
    turn: float,
    position: float,
    speed: float,
    beyond: float,
    lane_s: Floats,
    lane_v: Floats,
    lane_until: float,
    exit_s: Floats,
    exit_v: Floats,
    exit_shift: float,
    s_out: Floats,
    v_out: Floats,
) -> int:
    """Fill `s_out` and `v_out`; the steps filled, or 0 where the vehicle does not get through."""
    s, v = position, speed
    end = crossing + law.length + beyond
    for k in range(len(s_out)):
        s_out[k], v_out[k] = s, v
        if s >= end:
            return k + 1
        z = 0.0
        first = True  # no vehicle is between it and the junction
        if k < len(lane_s):
            first = lane_s[k] >= 0.0
            rear = lane_s[k] - law.length
            if rear < lane_until:
                if rear <= s:
                    return 0
                z = gap_ratio(v, rear - s, lane_v[k], law.a, law.b, law.headway, law.min_gap)
        if k < len(exit_s) and exit_s[k] >= 0.0 and (first or s >= 0.0):
            gap = exit_s[k] + exit_shift - law.length - s
            if gap <= 0.0:
                return 0
            z = max(z, gap_ratio(v, gap, exit_v[k], law.a, law.b, law.headway, law.min_gap))
        v0 = turn if 0.0 <= s < crossing else law.limit
        if law.improved:
            acc = iidm(v, v0, z, law.a, law.b, law.delta)
        else:
            acc = idm(v, v0, z, law.a, law.b, law.delta)
        if s < 0.0 and v + acc * law.dt > turn:
            slower = max(speed_towards(v, turn, -s, law.b, law.dt), turn)
            acc = min(acc, max((slower - v) / law.dt, -law.b))
        s, v = ballistic(s, v, max(acc, -law.b_max), law.dt)
    return 0
