"""The car-following models of a run, and how limits and hold lines bound the acceleration.

Only this module depends on `Law.model`. The equations are in `minisim.carfollowing`, the table of
models in `minisim.vehicle`. Hosts move vehicles by these functions, `baselines.prediction` too.
"""

from __future__ import annotations

import math
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
from minisim.jit import njit, njit_inline
from minisim.junction.partings import turning_room
from minisim.ticks import NEVER, first_tick
from minisim.vehicle import MODELS, POSITION_EPS

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


class Law(NamedTuple):
    """The scalars of a run: car following, lines and switches (SI units)."""

    dt: float
    a: float
    b: float
    b_max: float
    headway: float
    min_gap: float
    delta: float
    model: int  # car-following model, by its place in `minisim.vehicle.MODELS`
    semi_implicit: bool  # positions follow from speeds by `semi_implicit`, not `ballistic`
    length: float
    width: float
    entry: float  # s of the junction entry
    hold: float  # s of the hold line
    leave: float  # s up to which a vehicle stays in view at least
    room: float  # see `minisim.junction.partings.turning_room`
    margin: float  # see `minisim.vehicle.VehicleType`
    sumo: bool  # vehicles keep to SUMO's rules
    sight: float  # how far before the entry a view reaches
    depart_speed: float  # highest at insertion
    wake_on_clear: bool
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
    vehicle = site.vehicle
    entry = site.intersection.approach_length
    near = record == "junction"
    law = Law(
        dt=site.dt,
        a=vehicle.acceleration,
        b=vehicle.deceleration,
        b_max=vehicle.max_deceleration,
        headway=vehicle.headway,
        min_gap=vehicle.min_gap,
        delta=vehicle.exponent,
        model=list(MODELS).index(vehicle.model),
        semi_implicit=MODELS[vehicle.model].stepwise,
        length=vehicle.length,
        width=vehicle.width,
        entry=entry + PAST_THE_END if vehicle.sumo and vehicle.model == "krauss" else entry,
        hold=entry - plan.hold_distance,
        leave=entry + plan.reach,
        room=turning_room(site.intersection, site.vehicle),
        margin=vehicle.margin,
        sumo=vehicle.sumo is not None,
        sight=plan.sight,
        depart_speed=math.inf if depart_speed is None else depart_speed,
        wake_on_clear=plan.wake_on_clear,
        record_from=first_tick(record_window[0], site.dt) if record else NEVER,
        record_to=first_tick(record_window[1], site.dt) if record else NEVER,
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
def closeness(v: float, gap: float, v_leader: float, law: Law) -> float:
    """The weight that this run's law gives a vehicle ahead, 0 to infinity; the largest decides.

    Under the IDM it is the desired gap over the actual one, under Krauß's law 1/(safe speed).
    """
    if law.model == KRAUSS:
        v_safe = safe_speed(gap - law.min_gap, v_leader, law.b, law.headway, law.dt)
        return 1.0 / v_safe if v_safe > 0.0 else math.inf
    return gap_ratio(v, gap, v_leader, law.a, law.b, law.headway, law.min_gap)


@njit_inline
def room_behind(gap: float, v_leader: float, law: Law) -> float:
    """The distance behind a leader in which a vehicle must be able to stop, times 2·b_max [m²/s²].

    The leader stops no sooner than its brakes can, and there is room for corners in a turn.
    """
    room = gap - law.room
    if law.semi_implicit:
        return 2.0 * law.b_max * (room + braking_distance(v_leader, law.b_max, law.dt))
    return 2.0 * law.b_max * room + v_leader * v_leader


@njit_inline
def short_of(room: float, v: float, v_new: float, law: Law) -> bool:
    """Whether a stop after a step to `v_new` may take more than this room: quick and cautious."""
    top = v_new if v_new > v else v
    return top * (top + 2.0 * law.b_max * law.dt) > room


@njit
def keep_room(v: float, room: float, law: Law) -> float:
    """Highest acceleration after which the brakes still stop a vehicle in this room [m/s²].

    With it, no vehicle runs into its leader under any law at any step: a vehicle that can stop
    behind its leader before the step still can after it, at worst by braking as hard as the leader.
    No law promises that by itself: the IDM brakes late at long steps or a large `acceleration`, and
    Krauß's law assumes that no vehicle brakes harder than b. Ordinary traffic is not affected.
    Source: Gipps 1981, Transportation Research B 15:105, and Krauß 1998, §3.1, with the same brakes
    for both vehicles and a reaction time of one step.
    """
    distance = room / (2.0 * law.b_max)
    if law.semi_implicit:
        return (stepwise_towards(0.0, distance, law.b_max, law.dt) - v) / law.dt
    return stop_within(v, distance, law.b_max, law.dt)


@njit_inline
def follow(v: float, v0: float, z: float, law: Law) -> float:
    """The acceleration that the car-following law gives.

    At a desired speed of 0 it is the limit of the IDM: comfortable braking and the leader's share.
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


@njit_inline
def within(v: float, acc: float, limit: float, law: Law) -> float:
    """`acc`, unless a step of it would take a vehicle past its speed limit.

    Where a·dt is large, the IDM would overshoot: it assumes short steps.
    """
    return (limit - v) / law.dt if v < limit < v + acc * law.dt else acc


@njit
def insertable(gap: float, v_leader: float, law: Law) -> float:
    """Highest speed at which this run's law allows insertion; negative when there is none.

    A law without a rule allows any speed if the gap is at least the one at standstill.
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
def krauss_stop(v: float, room: float, law: Law) -> float:
    """The acceleration with which a vehicle may still stop in `room` [m] by Krauß's law.

    Source: SUMO's `MSCFModel_Krauss::stopSpeed`.
    """
    v_new = stepwise_towards(0.0, room - STILL, law.b, law.dt) if room >= STILL else 0.0
    return (v_new - v) / law.dt


@njit_inline
def hold(v: float, s: float, law: Law) -> float:
    """Bound on the acceleration of a vehicle without right of way.

    The vehicle brakes comfortably for its hold line, no earlier than it must. If that does not
    suffice, it brakes as hard as it must to stop before the junction.
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
    """`hold` by SUMO's rule: a vehicle stops 1 m before a line, or nearer if it must.

    Source: `MSVehicle::planMoveInternal` (`DIST_TO_STOPLINE_EXPECT_PRIORITY`).
    """
    braking = braking_distance(v, law.b, law.dt)
    return krauss_stop(v, to_line - max(min(STOP_LINE_GAP, to_line - braking), POSITION_EPS), law)


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
