"""The car-following models of a run, and how limits and hold lines bound the acceleration.

Only this module depends on `Law.model`. The equations are in `minisim.carfollowing`, the table of
models in `minisim.vehicle`. Hosts move vehicles by these functions, `baselines.prediction` too.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

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
    stop_within,
)
from minisim.control import Plan, Site
from minisim.fleet import Fleet
from minisim.jit import njit_inline, njit_inner
from minisim.junction.geometry import Intersection
from minisim.junction.partings import turning_room
from minisim.ticks import NEVER, first_tick
from minisim.vehicle import MODELS, POSITION_EPS, VehicleType

#: A held vehicle aims to stop this far before its hold line [m]; at most it stops 0.3 m before it.
#: The margin exceeds `minisim.control.COMMIT_MARGIN`, so the vehicle never looks unable to stop.
STOP_MARGIN = 0.25

#: How far a recording of the junction alone reaches before its entry and past its exit [m].
RECORD_BEFORE, RECORD_PAST = 60.0, 30.0

#: SUMO's vehicle has left a lane once it is past its end. One that slows down for a turn often gets
#: to the very end, and a light may change then [m].
PAST_THE_END = 1e-9

#: Values of `Law.model`.
IDM, IIDM, KRAUSS = map(list(MODELS).index, ("idm", "iidm", "krauss"))

#: How far before a red light SUMO's vehicles stop (`jmStoplineGap`'s default) [m].
STOP_LINE_GAP = 1.0


class Traits(NamedTuple):
    """What the law needs to know of a vehicle's type (SI units)."""

    a: float
    b: float
    b_max: float
    headway: float
    min_gap: float
    delta: float
    length: float
    width: float
    rear_axle: float  # 0 if the body is a chord of its path


def traits_of(vehicle: VehicleType) -> Traits:
    """The traits of a type."""
    it = vehicle
    return Traits(*map(float, (
        it.acceleration, it.deceleration, it.max_deceleration, it.headway, it.min_gap, it.exponent,
        it.length, it.width, it.rear_axle or 0.0,
    )))  # fmt: skip


class Law(NamedTuple):
    """What a run's vehicles have in common: the step, the model, lines and switches (SI units)."""

    dt: float
    model: int  # car-following model, by its place in `minisim.vehicle.MODELS`
    quartic: bool  # all vehicles have the usual exponent δ = 4
    mixed: bool  # vehicles' brakes differ
    semi_implicit: bool  # positions follow from speeds by `semi_implicit`, not `ballistic`
    entry: float  # s of the junction entry
    hold: float  # s of the hold line
    leave: float  # s up to which a vehicle stays in view at least
    longest: float  # length of the longest vehicle
    room: float  # see `minisim.junction.partings.turning_room`
    margin: float  # see `minisim.vehicle.VehicleType`
    sumo: bool  # vehicles keep to SUMO's rules
    sight: float  # how far before the entry a view reaches
    depart_speed: float  # highest at insertion
    wake_on_clear: bool
    wake_when_empty: bool
    record_from: int  # ticks
    record_to: int
    record_start: float  # s where recording starts
    record_past: float  # how far past the junction exit recording continues


def build_law(
    site: Site,
    plan: Plan,
    depart_speed: float | None = None,
    record: str | None = None,
    record_window: tuple[float, float] = (0.0, math.inf),
) -> Law:
    """The scalars of a run."""
    return _law(site.intersection, site.fleet, site.dt, plan, depart_speed, record, record_window)


@lru_cache(maxsize=256)
def _law(
    intersection: Intersection, fleet: Fleet, dt: float, plan: Plan, depart_speed: float | None,
    record: str | None, record_window: tuple[float, float],
) -> Law:  # fmt: skip
    vehicle, entry = fleet.worst, intersection.approach_length
    near = record == "junction"
    law = Law(
        dt=dt,
        model=list(MODELS).index(vehicle.model),
        quartic=all(it.exponent == 4.0 for it in fleet.types),
        mixed=len({it.max_deceleration for it in fleet.types}) > 1,
        semi_implicit=MODELS[vehicle.model].stepwise,
        entry=entry + PAST_THE_END if vehicle.sumo and vehicle.model == "krauss" else entry,
        hold=entry - plan.hold_distance,
        leave=entry + plan.reach,
        longest=vehicle.length,
        room=turning_room(intersection, fleet),
        margin=vehicle.margin,
        sumo=vehicle.sumo is not None,
        sight=plan.sight,
        depart_speed=math.inf if depart_speed is None else depart_speed,
        wake_on_clear=plan.wake_on_clear,
        wake_when_empty=plan.wake_when_empty,
        record_from=first_tick(record_window[0], dt) if record else NEVER,
        record_to=first_tick(record_window[1], dt) if record else NEVER,
        record_start=entry - RECORD_BEFORE if near else -math.inf,
        record_past=RECORD_PAST if near else math.inf,
    )
    # An int in place of a float would recompile every kernel.
    whole = ("model", "record_from", "record_to")
    plain: dict[str, Any] = {
        k: float(x) for k, x in law._asdict().items() if type(x) is int and k not in whole
    }
    return law._replace(**plain)


@njit_inline
def closeness(v: float, gap: float, v_leader: float, me: Traits, law: Law) -> float:
    """The weight that this run's law gives a vehicle ahead, 0 to infinity; the largest decides.

    Under the IDM it is the desired gap over the actual one, under Krauß's law 1/(safe speed).
    """
    if law.model == KRAUSS:
        v_safe = safe_speed(gap - me.min_gap, v_leader, me.b, me.headway, law.dt)
        return 1.0 / v_safe if v_safe > 0.0 else math.inf
    return gap_ratio(v, gap, v_leader, me.a, me.b, me.headway, me.min_gap)


@njit_inline
def room_behind(gap: float, v_leader: float, b_leader: float, me: Traits, law: Law) -> float:
    """The distance behind a leader in which a vehicle must be able to stop, times 2·b_max [m²/s²].

    The leader stops no sooner than its brakes can, and there is room for corners in a turn. If the
    leader's brakes are the weaker ones, they count as equal: otherwise two vehicles that stop apart
    could touch on the way.
    """
    room = gap - law.room
    if law.semi_implicit:
        b_max = b_leader if b_leader > me.b_max else me.b_max
        return 2.0 * me.b_max * (room + braking_distance(v_leader, b_max, law.dt))
    squared = v_leader * v_leader
    if b_leader > me.b_max:
        squared *= me.b_max / b_leader
    return 2.0 * me.b_max * room + squared


@njit_inline
def short_of(room: float, v: float, v_new: float, me: Traits, law: Law) -> bool:
    """Whether a stop after a step to `v_new` may take more than this room: quick and cautious."""
    top = v_new if v_new > v else v
    return top * (top + 2.0 * me.b_max * law.dt) > room


@njit_inner
def keep_room(v: float, room: float, me: Traits, law: Law) -> float:
    """Highest acceleration after which the brakes still stop a vehicle in this room [m/s²].

    With it, no vehicle runs into its leader under any law at any step: a vehicle that can stop
    behind its leader before the step still can after it, at worst by braking as hard as the leader.
    No law promises that by itself: the IDM brakes late at long steps or a large `acceleration`, and
    Krauß's law assumes that no vehicle brakes harder than b. Ordinary traffic is not affected.
    Source: Gipps 1981, Transportation Research B 15:105, and Krauß 1998, §3.1, with the same brakes
    for both vehicles and a reaction time of one step.
    """
    distance = room / (2.0 * me.b_max)
    if law.semi_implicit:
        return (stepwise_towards(0.0, distance, me.b_max, law.dt) - v) / law.dt
    return stop_within(v, distance, me.b_max, law.dt)


@njit_inline
def follow(v: float, v0: float, z: float, me: Traits, law: Law) -> float:
    """The acceleration that the car-following law gives.

    At a desired speed of 0 it is the limit of the IDM: comfortable braking and the leader's share.
    """
    if law.model == KRAUSS:
        v_safe = 1.0 / z if z > 0.0 else math.inf
        return (krauss(v, v0, v_safe, me.a, me.b, law.dt) - v) / law.dt
    if v0 <= 0.0:
        if law.model == IIDM:
            return -me.b + min(me.a * (1.0 - z * z), 0.0)
        return -me.b - me.a * z * z
    if law.model == IIDM:
        return iidm(v, v0, z, me.a, me.b, me.delta)
    return idm(v, v0, z, me.a, me.b, me.delta)


@njit_inline
def drive(v: float, limit: float, advice: float, z: float, me: Traits, law: Law) -> float:
    """The acceleration that the law gives at a speed limit and an advised speed.

    A vehicle that is too fast for the advice brakes at b at most, unless its leader alone asks for
    more: the IDM would add both.
    """
    acc = within(v, follow(v, limit, z, me, law), limit, law)
    if advice < limit:
        told = within(v, follow(v, advice, z, me, law), advice, law)
        acc = min(acc, max(told, -me.b))
    return acc


@njit_inner
def obey(told: float, v: float, limit: float, z: float, me: Traits, law: Law) -> float:
    """The acceleration of a vehicle whose acceleration a command sets to `told`.

    The command takes the place of the law's wish. So the law is asked as on a road without a limit,
    and the vehicle drives up to its limit without slowing down before. Above it, it brakes at b.
    """
    acc = min(max(told, 0.0) if v == 0.0 else told, follow(v, math.inf, z, me, law))
    if v + acc * law.dt > limit:
        acc = min(acc, max((limit - v) / law.dt, -me.b))
    return acc


@njit_inline
def within(v: float, acc: float, limit: float, law: Law) -> float:
    """`acc`, unless a step of it would take a vehicle past its speed limit.

    Where a·dt is large, the IDM would overshoot: it assumes short steps.
    """
    return (limit - v) / law.dt if v < limit < v + acc * law.dt else acc


@njit_inner
def insertable(gap: float, v_leader: float, me: Traits, law: Law) -> float:
    """Highest speed at which this run's law allows insertion; negative when there is none.

    A law without a rule allows any speed if the gap is at least the one at standstill.
    Source: `insertionFollowSpeed` of each of SUMO's models.
    """
    if law.model == IDM or law.model == IIDM:
        return insertion_speed(gap, v_leader, me.a, me.b, me.headway, me.min_gap)
    if gap < me.min_gap:
        return -1.0
    if law.model == KRAUSS:
        return safe_speed(gap - me.min_gap, v_leader, me.b, me.headway, law.dt)
    return math.inf


@njit_inline
def braking_begins(v: float, distance: float, me: Traits, law: Law) -> bool:
    """Whether something `distance` ahead may call for comfortable braking in this step."""
    return 2.0 * me.b * distance <= v * v + 4.0 * me.b * v * law.dt


@njit_inline
def slow_down(v: float, acc: float, target: float, distance: float, me: Traits, law: Law) -> float:
    """Bound on the acceleration with which comfortable braking meets a lower limit ahead."""
    if v + acc * law.dt <= target:
        return acc
    if law.semi_implicit:
        v_new = stepwise_towards(target, distance, me.b, law.dt)
    else:
        v_new = max(speed_towards(v, target, distance, me.b, law.dt), target)
    return max((v_new - v) / law.dt, -me.b)


@njit_inner
def krauss_stop(v: float, room: float, me: Traits, law: Law) -> float:
    """The acceleration with which a vehicle may still stop in `room` [m] by Krauß's law.

    Source: SUMO's `MSCFModel_Krauss::stopSpeed`.
    """
    v_new = stepwise_towards(0.0, room - STILL, me.b, law.dt) if room >= STILL else 0.0
    return (v_new - v) / law.dt


@njit_inline
def hold(v: float, s: float, me: Traits, law: Law) -> float:
    """Bound on the acceleration of a vehicle without right of way.

    The vehicle brakes comfortably for its hold line, no earlier than it must. If that does not
    suffice, it brakes comfortably to stop before the junction, and if that does not, as hard as it
    must.
    """
    to_line = law.hold - s
    if law.sumo and law.model == KRAUSS:
        return stop_at_line(v, to_line, me, law)
    if law.semi_implicit:
        return hold_stepwise(v, to_line, law.entry - s, me.b, law.dt)
    distance = to_line - STOP_MARGIN
    if v * v <= 2.0 * me.b * distance:
        if v == 0.0 and distance < 1e-3:
            return 0.0
        v_new = speed_towards(v, 0.0, distance, me.b, law.dt)
        return (v_new - v) / law.dt if v_new > 0.0 else -v * v / (2.0 * max(distance, 1e-6))
    to_junction = law.entry - s
    if v * v <= 2.0 * me.b * to_junction:
        return -me.b
    return -v * v / (2.0 * max(to_junction - STOP_MARGIN, 1e-6))


@njit_inner
def stop_at_line(v: float, to_line: float, me: Traits, law: Law) -> float:
    """`hold` by SUMO's rule: a vehicle stops 1 m before a line, or nearer if it must.

    Source: `MSVehicle::planMoveInternal` (`DIST_TO_STOPLINE_EXPECT_PRIORITY`).
    """
    braking = braking_distance(v, me.b, law.dt)
    return krauss_stop(
        v, to_line - max(min(STOP_LINE_GAP, to_line - braking), POSITION_EPS), me, law
    )


@njit_inner
def hold_stepwise(v: float, to_line: float, to_entry: float, b: float, dt: float) -> float:
    """`hold` for `semi_implicit`; a function of its own to keep the inner loop short."""
    needed = braking_distance(v, b, dt)
    distance = to_line - STOP_MARGIN
    if needed <= distance:
        v_new = stepwise_towards(0.0, distance, b, dt) if distance >= STILL else 0.0
        return (v_new - v) / dt
    if needed <= to_entry:
        return -b
    return -v * v / (2.0 * max(to_entry - STOP_MARGIN, 1e-6))
