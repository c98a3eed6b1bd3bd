"""The car-following models of a run, and how limits and hold lines bound the acceleration.

Everything that depends on `Law.model` is in this module. The equations are in
`minisim.carfollowing`, and the table of models is in `minisim.vehicle`.
"""

from __future__ import annotations

import math

import numpy as np

from minisim.carfollowing import (
    STILL,
    braking_distance,
    gap_ratio,
    idm,
    iidm,
    insertion_speed,
    krauss,
    safe_speed,
    speed_towards,
    stepwise_towards,
)
from minisim.engine.state import STOP_MARGIN, Law, Road
from minisim.jit import njit, njit_inline
from minisim.vehicle import MODELS, POSITION_EPS

#: Values of `Law.model`.
IDM, IIDM, KRAUSS = map(list(MODELS).index, ("idm", "iidm", "krauss"))

#: How far before a red light SUMO's vehicles stop (`jmStoplineGap`'s default) [m].
STOP_LINE_GAP = 1.0


@njit_inline
def closeness(v: float, gap: float, v_leader: float, law: Law) -> float:
    """How much weight this run's law gives a vehicle ahead: from 0, none at all, to infinity.

    Under the IDM it is the ratio of the desired gap to the actual one; under Krauß's law it is the
    inverse of the safe speed. If there are several vehicles ahead, the one with the most weight
    decides.
    """
    if law.model == KRAUSS:
        v_safe = safe_speed(gap - law.min_gap, v_leader, law.b, law.headway, law.dt)
        return 1.0 / v_safe if v_safe > 0.0 else math.inf
    return gap_ratio(v, gap, v_leader, law.a, law.b, law.headway, law.min_gap)


@njit_inline
def follow(v: float, v0: float, z: float, law: Law) -> float:
    """The acceleration that the car-following law gives.

    At a desired speed of 0, this is what the IDM tends to as the desired speed falls to 0:
    comfortable braking plus the leader's share.
    """
    if law.model == KRAUSS:
        v_safe = 1.0 / z if z > 0.0 else math.inf
        return (krauss(v, v0, v_safe, law.a, law.b, law.dt) - v) / law.dt
    if v0 <= 0.0:
        if law.model == IIDM:
            return -law.b + min(law.a * (1.0 - z * z), 0.0)
        return -law.b - law.a * z * z
    if law.model == IIDM:
        return iidm(v, v0, z, law.a, law.b, law.delta)
    return idm(v, v0, z, law.a, law.b, law.delta)


@njit
def insertable(gap: float, v_leader: float, law: Law) -> float:
    """Highest speed at which this run's law allows insertion; negative when there is none.

    A law without a rule of its own allows any speed once the gap is at least the one at standstill.
    Source: `insertionFollowSpeed` of each of SUMO's models.
    """
    if law.model == IDM or law.model == IIDM:
        return insertion_speed(gap, v_leader, law.a, law.b, law.headway, law.min_gap)
    if gap < law.min_gap:
        return -1.0
    if law.model == KRAUSS:
        return safe_speed(gap - law.min_gap, v_leader, law.b, law.headway, law.dt)
    return math.inf


@njit_inline
def braking_begins(v: float, distance: float, law: Law) -> bool:
    """Whether something `distance` ahead may call for comfortable braking in this step."""
    return 2.0 * law.b * distance <= v * v + 4.0 * law.b * v * law.dt


@njit_inline
def slow_down(v: float, acc: float, target: float, distance: float, law: Law) -> float:
    """Bound on the acceleration with which comfortable braking meets a lower limit ahead."""
    if v + acc * law.dt <= target:
        return acc
    if law.semi_implicit:
        v_new = stepwise_towards(target, distance, law.b, law.dt)
    else:
        v_new = max(speed_towards(v, target, distance, law.b, law.dt), target)
    return max((v_new - v) / law.dt, -law.b)


@njit
def free(me: np.void, road: Road, law: Law) -> float:
    """The acceleration of a vehicle that no other one hinders, within the limits here and ahead."""
    s, v, p, section, factor = me["s"], me["v"], me["path"], me["section"], me["factor"]
    start, speed = road.section_start, road.section_speed
    acc = follow(v, min(speed[p, section] * factor, me["advice"]), 0.0, law)
    k = section + 1
    while braking_begins(v, start[p, k] - s, law):
        acc = min(acc, slow_down(v, acc, speed[p, k] * factor, start[p, k] - s, law))
        k += 1
    return acc


@njit
def stop_within(v: float, room: float, law: Law) -> float:
    """The acceleration with which a vehicle may still stop in `room` [m], as Krauß's law has it.

    Source: SUMO's `MSCFModel_Krauss::stopSpeed`.
    """
    v_new = stepwise_towards(0.0, room - STILL, law.b, law.dt) if room >= STILL else 0.0
    return (v_new - v) / law.dt


@njit_inline
def hold(v: float, s: float, law: Law) -> float:
    """Bound on the acceleration of a vehicle without right of way.

    The hold line is like the end of the road: the vehicle brakes comfortably, and no earlier than
    it must. If that no longer suffices, it brakes as hard as it must to stop before the junction.
    """
    to_line = law.hold - s
    if law.sumo and law.model == KRAUSS:
        return stop_at_line(v, to_line, law)
    if law.semi_implicit:
        return hold_stepwise(v, to_line, law.entry - s, law.b, law.dt)
    distance = to_line - STOP_MARGIN
    if v * v <= 2.0 * law.b * distance:
        if v == 0.0 and distance < 1e-3:
            return 0.0
        v_new = speed_towards(v, 0.0, distance, law.b, law.dt)
        return (v_new - v) / law.dt if v_new > 0.0 else -v * v / (2.0 * max(distance, 1e-6))
    if v * v <= 2.0 * law.b * to_line:
        return -law.b
    to_junction = max(law.entry - STOP_MARGIN - s, 1e-6)
    return -max(law.b, v * v / (2.0 * to_junction))


@njit
def stop_at_line(v: float, to_line: float, law: Law) -> float:
    """`hold` as SUMO has it: a vehicle stops 1 m before a line, or nearer if it must.

    Source: `MSVehicle::planMoveInternal` (`DIST_TO_STOPLINE_EXPECT_PRIORITY`).
    """
    braking = braking_distance(v, law.b, law.dt)
    return stop_within(v, to_line - max(min(STOP_LINE_GAP, to_line - braking), POSITION_EPS), law)


@njit
def hold_stepwise(v: float, to_line: float, to_entry: float, b: float, dt: float) -> float:
    """`hold` for `semi_implicit`; a function of its own to keep the inner loop short."""
    needed = braking_distance(v, b, dt)
    distance = to_line - STOP_MARGIN
    if needed <= distance:
        v_new = stepwise_towards(0.0, distance, b, dt) if distance >= STILL else 0.0
        return (v_new - v) / dt
    if needed <= to_line:
        return -b
    return -max(b, v * v / (2.0 * max(to_entry - STOP_MARGIN, 1e-6)))
