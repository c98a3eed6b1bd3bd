"""Advance every vehicle until something happens that somebody has to know.

Functions over the arrays of `minisim.engine.state`; numba compiles them where it is installed, and
the same source runs as plain Python. A step is: insert, choose every acceleration from the state at
its beginning, then move everybody.
"""

from __future__ import annotations

import math

from minisim.carfollowing import (
    STILL,
    ballistic,
    braking_distance,
    gap_ratio,
    idm,
    iidm,
    insertion_speed,
    krauss,
    safe_speed,
    semi_implicit,
    speed_towards,
    stepwise_towards,
)
from minisim.engine.cruise import accelerate_engines
from minisim.engine.state import (
    ARRIVED,
    CC,
    DRIVING,
    IIDM,
    KRAUSS,
    STOP_MARGIN,
    Engine,
    Floats,
    Law,
    Records,
    Road,
)
from minisim.jit import njit, njit_inline
from minisim.junction.paths import locate

#: Reasons to return, as bits.
MARK, CLEAR, TOUCH, GAP, TRACE_FULL, DONE = 1, 2, 4, 8, 16, 32

#: SUMO's limit below which a vehicle counts as waiting [m/s].
WAITING_SPEED = 0.1

#: Bodies this close may touch within rounding [m]; the exact check follows in pymunk.
TOUCH_MARGIN = 0.02

#: Where the front of a vehicle is, compiled.
place = njit_inline(locate)


@njit
def advance(
    vehicles: Records,
    lanes: Records,
    road: Road,
    law: Law,
    engine: Engine | None,
    trace: Records,
    traced: int,
    bodies: Floats,
    observed: Records,
    tick: int,
    until: int,
) -> tuple[int, int, int, int]:
    """Advance from `tick` to `until` at most; stop at the end of a step with a reason.

    Args:
        trace: recording, filled from line `traced` on.
        bodies: scratch, (k, 5): how many vehicles can be in and near the junction at once.
        observed: filled with what a view shows at the end, see `observe`.

    Returns:
        The tick reached, the reasons (bits, 0 at `until`), the lines recorded, the vehicles
        observed.
    """
    reasons = 0
    while tick < until and reasons == 0:
        reasons = step(vehicles, lanes, road, law, engine, bodies, tick)
        tick += 1
        if law.record_from <= tick < law.record_to:
            traced = record(vehicles, lanes, road, law, trace, traced, tick)
            if traced + lanes[-1]["end"] > len(trace):
                reasons |= TRACE_FULL
    return tick, reasons, traced, observe(vehicles, lanes, law, observed)


@njit
def step(
    vehicles: Records,
    lanes: Records,
    road: Road,
    law: Law,
    engine: Engine | None,
    bodies: Floats,
    tick: int,
) -> int:
    """One step, from `tick` to the next; the reasons to return."""
    reasons = 0
    if insert(vehicles, lanes, road, law, tick):
        reasons |= MARK
    if engine is None:
        overlap = accelerate(vehicles, lanes, road, law)
    else:
        overlap = accelerate_engines(vehicles, lanes, road, law, engine)
        hold_engines(vehicles, lanes, law)
    if overlap:
        reasons |= GAP
    reasons |= move(vehicles, lanes, road, law, engine, tick + 1)
    if may_touch(vehicles, lanes, road, law, bodies):
        reasons |= TOUCH
    return reasons


@njit
def insert(vehicles: Records, lanes: Records, road: Road, law: Law, tick: int) -> bool:
    """Insert on each lane the next vehicle that is due, if the gap allows; FIFO, none dropped.

    No faster than the vehicle ahead allows, nor comfortable braking the lower limits ahead and,
    while the lane is closed, the hold line.

    Returns whether a vehicle was inserted past a wake-up mark.
    """
    passed = False
    for lane in range(len(lanes)):
        i = lanes[lane]["next"]
        if i == lanes[lane]["end"] or vehicles[i]["demand_tick"] > tick:
            continue
        s, p = law.length + law.slack, vehicles[i]["path"]
        section = 0
        while s >= road.section_start[p, section + 1]:
            section += 1
        factor = vehicles[i]["factor"]
        v = road.section_speed[p, section] * factor
        for k in range(section + 1, road.section_start.shape[1] - 1):
            room = max(road.section_start[p, k] - s, 0.0)
            v = min(v, math.sqrt((road.section_speed[p, k] * factor) ** 2 + 2.0 * law.b * room))
        if lanes[lane]["open"] == 0:
            v = min(v, math.sqrt(2.0 * law.b * max(law.hold - STOP_MARGIN - s, 0.0)))
        j = i - 1
        if j >= lanes[lane]["first"] and vehicles[j]["status"] == DRIVING:
            safe = insertable(vehicles[j]["s"] - law.length - s, vehicles[j]["v"], law)
            if safe < 0.0:
                continue
            v = min(v, safe)
        if law.depart_speed >= 0.0:
            if law.depart_speed > v:
                continue
            v = law.depart_speed
        lanes[lane]["next"] = i + 1
        vehicles[i]["status"] = DRIVING
        vehicles[i]["s"] = s
        vehicles[i]["v"] = v
        vehicles[i]["depart_tick"] = tick
        vehicles[i]["section"] = section
        while s >= road.marks[vehicles[i]["mark"]]:
            vehicles[i]["mark"] += 1
            passed = True
    return passed


@njit
def insertable(gap: float, v_leader: float, law: Law) -> float:
    """Highest speed at which the law of this run inserts a vehicle; negative when there is none.

    Source: SUMO's `insertionFollowSpeed` of each model. Its CC model takes any speed.
    """
    if law.model == KRAUSS or law.model == CC:
        if gap < law.min_gap:
            return -1.0
        if law.model == CC:
            return math.inf
        return safe_speed(gap - law.min_gap, v_leader, law.b, law.headway, law.dt)
    return insertion_speed(gap, v_leader, law.a, law.b, law.headway, law.min_gap)


@njit
def accelerate(vehicles: Records, lanes: Records, road: Road, law: Law) -> bool:
    """Choose every vehicle's acceleration from the present state; whether two overlap.

    Helpers get rows and numbers, never arrays: counting references to those would take longer
    than the arithmetic.
    """
    overlap = False
    branch, ends = road.branch, road.ends
    start, speed = road.section_start, road.section_speed
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        first, front = lanes[lane]["first"], lanes[lane]["front"]
        for i in range(first, lanes[lane]["next"]):
            me = vehicles[i]
            if me["status"] != DRIVING:
                continue
            s, v, p = me["s"], me["v"], me["path"]
            released = is_open or me["go"] != 0

            # The vehicle ahead in the lane, until its rear has left the shared path. When that one
            # has turned off, one further ahead may still be on it.
            z = 0.0
            j = i - 1
            while j >= first:
                ahead = vehicles[j]
                rear = ahead["s"] - law.length
                if ahead["status"] == DRIVING and rear < branch[ahead["path"], p]:
                    z = closeness(v, rear - s, ahead["v"], law)
                    overlap |= rear <= s
                    break
                if s >= ends[p, 0]:
                    break
                j -= 1

            # From the junction on, the last vehicle before it bound for the same exit lane. Both
            # are measured from there, so one that is still on another arc counts as if on this.
            j = -1
            if s >= law.entry:
                j = me["ahead"]
            elif released and i == front:
                j = lanes[int(ends[p, 2])]["last"]
            if j >= 0 and vehicles[j]["status"] == DRIVING:
                ahead = vehicles[j]
                rear = ahead["s"] - law.length - ends[ahead["path"], 0]
                gap = rear - (s - ends[p, 0])
                z = max(z, closeness(v, gap, ahead["v"], law))
                overlap |= gap <= 0.0 and s >= ends[p, 0]

            section, factor = me["section"], me["factor"]
            v0 = min(speed[p, section] * factor, me["advice"])
            acc = follow(v, v0, z, law)
            k = section + 1
            while braking_begins(v, start[p, k] - s, law):
                acc = min(acc, slow_down(v, acc, speed[p, k] * factor, start[p, k] - s, law))
                k += 1
            if not released and s < law.entry:
                acc = min(acc, hold(v, s, law))
            brake = me["brake"] if v > 0.0 else max(me["brake"], 0.0)  # who stands keeps standing
            me["a"] = max(min(acc, brake), -law.b_max)
    return overlap


@njit_inline
def closeness(v: float, gap: float, v_leader: float, law: Law) -> float:
    """How much a vehicle ahead counts for the law of this run: 0 not at all, infinite stops.

    The desired over the actual gap of the IDM, the inverse of Krauß's safe speed. Of several
    vehicles ahead the one that counts most decides.
    """
    if law.model == KRAUSS:
        v_safe = safe_speed(gap - law.min_gap, v_leader, law.b, law.headway, law.dt)
        return 1.0 / v_safe if v_safe > 0.0 else math.inf
    return gap_ratio(v, gap, v_leader, law.a, law.b, law.headway, law.min_gap)


@njit_inline
def follow(v: float, v0: float, z: float, law: Law) -> float:
    """Acceleration of the car-following law.

    A desired speed of 0 is the IDM's limit from above: comfortable braking, and the leader's share
    on it.
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
def braking_begins(v: float, distance: float, law: Law) -> bool:
    """Whether what is `distance` ahead may matter to comfortable braking in this step."""
    return 2.0 * law.b * distance <= v * v + 4.0 * law.b * v * law.dt


@njit_inline
def slow_down(v: float, acc: float, target: float, distance: float, law: Law) -> float:
    """Bound on the acceleration that meets a lower limit ahead by comfortable braking."""
    if v + acc * law.dt <= target:
        return acc
    if law.semi_implicit:
        v_new = stepwise_towards(target, distance, law.b, law.dt)
    else:
        v_new = max(speed_towards(v, target, distance, law.b, law.dt), target)
    return max((v_new - v) / law.dt, -law.b)


@njit_inline
def hold(v: float, s: float, law: Law) -> float:
    """Bound on the acceleration of a vehicle without right of way.

    The hold line is the end of the road: comfortable braking when it must, not earlier. Where
    that no longer reaches the line, stop before the junction, braking as hard as that needs.
    """
    to_line = law.hold - s
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
def hold_stepwise(v: float, to_line: float, to_entry: float, b: float, dt: float) -> float:
    """`hold` for `semi_implicit`, apart from it to keep the inner loop of the others short."""
    needed = braking_distance(v, b, dt)
    distance = to_line - STOP_MARGIN
    if needed <= distance:
        v_new = stepwise_towards(0.0, distance, b, dt) if distance >= STILL else 0.0
        return (v_new - v) / dt
    if needed <= to_line:
        return -b
    return -max(b, v * v / (2.0 * max(to_entry - STOP_MARGIN, 1e-6)))


@njit
def hold_engines(vehicles: Records, lanes: Records, law: Law) -> None:
    """Stop vehicles with an engine at their hold line where they have no right of way."""
    for lane in range(len(lanes)):
        if lanes[lane]["open"] != 0:
            continue
        for i in range(lanes[lane]["front"], lanes[lane]["next"]):
            me = vehicles[i]
            if me["status"] == DRIVING and me["go"] == 0 and me["s"] < law.entry:
                me["a"] = max(min(me["a"], hold(me["v"], me["s"], law)), -law.b_max)


@njit
def move(
    vehicles: Records, lanes: Records, road: Road, law: Law, engine: Engine | None, tick: int
) -> int:
    """Move everybody by one step, book waiting and loss, and collect the reasons to return."""
    reasons = 0
    done = True
    ends, marks = road.ends, road.marks
    start, speed = road.section_start, road.section_speed
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            if vehicles[i]["status"] != DRIVING:
                continue
            p = vehicles[i]["path"]
            before, acc = vehicles[i]["s"], vehicles[i]["a"]
            if law.semi_implicit:
                s, v = semi_implicit(before, vehicles[i]["v"], acc, law.dt)
            else:
                s, v = ballistic(before, vehicles[i]["v"], acc, law.dt)
            vehicles[i]["s"] = s
            vehicles[i]["v"] = v
            if v <= WAITING_SPEED:
                vehicles[i]["waiting_ticks"] += 1
            section = vehicles[i]["section"]
            while s >= start[p, section + 1]:
                section += 1
            vehicles[i]["section"] = section
            allowed = speed[p, section] * vehicles[i]["factor"]
            if v < allowed:
                vehicles[i]["lost_ticks"] += 1.0 - v / allowed
            while s >= marks[vehicles[i]["mark"]]:
                vehicles[i]["mark"] += 1
                reasons |= MARK
            if s < law.entry:
                continue
            if i == lanes[lane]["front"]:
                exit_arm = int(ends[p, 2])
                lanes[lane]["front"] = i + 1
                vehicles[i]["entered"] = tick
                vehicles[i]["ahead"] = lanes[exit_arm]["last"]
                lanes[exit_arm]["last"] = i
            if engine is not None and before < ends[p, 0] <= s:
                exit_arm = int(ends[p, 2])
                vehicles[i]["ahead"] = lanes[exit_arm]["tail"]
                lanes[exit_arm]["tail"] = i
            if vehicles[i]["cleared"] == 0 and s >= max(ends[p, 0] + law.length, law.leave):
                vehicles[i]["cleared"] = 1
                vehicles[i]["brake"] = math.inf
                if law.wake_on_clear:
                    reasons |= CLEAR
            if s >= ends[p, 1] - law.slack:
                vehicles[i]["status"] = ARRIVED
                vehicles[i]["arrival_tick"] = tick
        while (
            lanes[lane]["first"] < lanes[lane]["next"]
            and vehicles[lanes[lane]["first"]]["status"] == ARRIVED
        ):
            lanes[lane]["first"] += 1
        while (
            lanes[lane]["uncleared"] < lanes[lane]["next"]
            and vehicles[lanes[lane]["uncleared"]]["cleared"] != 0
        ):
            lanes[lane]["uncleared"] += 1
        done = done and lanes[lane]["first"] == lanes[lane]["end"]
    if done:
        reasons |= DONE
    return reasons


@njit
def may_touch(vehicles: Records, lanes: Records, road: Road, law: Law, bodies: Floats) -> bool:
    """Broad phase: whether any two bodies in or near the junction may touch.

    Rectangles a little larger than the bodies, tested exactly by separating axes, so it never
    misses what pymunk would find.
    """
    ends, shape, headings = road.ends, road.shape, road.headings
    count = 0
    inside = False
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            s = vehicles[i]["s"]
            p = vehicles[i]["path"]
            if s < law.entry - law.length:
                break
            if vehicles[i]["status"] != DRIVING or s > ends[p, 0] + 2.0 * law.length:
                continue
            if count == len(bodies):
                return True
            inside |= s >= law.entry
            past, crossing = s - law.entry, ends[p, 0] - law.entry
            x, y = place(shape[p], headings[p], crossing, past)
            x_rear, y_rear = place(shape[p], headings[p], crossing, past - law.length)
            along = math.hypot(x - x_rear, y - y_rear)
            ux, uy = (x - x_rear) / along, (y - y_rear) / along
            bodies[count, 0] = x - ux * law.length / 2.0
            bodies[count, 1] = y - uy * law.length / 2.0
            bodies[count, 2] = ux
            bodies[count, 3] = uy
            count += 1
    if not inside:
        return False
    half_length = law.length / 2.0 + TOUCH_MARGIN
    half_width = law.width / 2.0 + TOUCH_MARGIN
    reach = 4.0 * (half_length * half_length + half_width * half_width)
    for i in range(count):
        for j in range(i):
            dx = bodies[i, 0] - bodies[j, 0]
            dy = bodies[i, 1] - bodies[j, 1]
            if dx * dx + dy * dy < reach and rectangles_meet(
                dx, dy, bodies[i, 2], bodies[i, 3], bodies[j, 2], bodies[j, 3],
                half_length, half_width,
            ):  # fmt: skip
                return True
    return False


@njit
def rectangles_meet(
    dx: float,
    dy: float,
    ux: float,
    uy: float,
    wx: float,
    wy: float,
    half_length: float,
    half_width: float,
) -> bool:
    """Separating-axis test of two equal rectangles, centres (dx, dy) apart, headings u and w."""
    cos = abs(ux * wx + uy * wy)
    sin = abs(ux * wy - uy * wx)
    along = half_length + half_length * cos + half_width * sin
    across = half_width + half_length * sin + half_width * cos
    if abs(dx * ux + dy * uy) > along or abs(dy * ux - dx * uy) > across:
        return False
    return abs(dx * wx + dy * wy) <= along and abs(dy * wx - dx * wy) <= across


@njit
def record(
    vehicles: Records,
    lanes: Records,
    road: Road,
    law: Law,
    trace: Records,
    traced: int,
    tick: int,
) -> int:
    """Write one line for every vehicle in the recorded stretch; returns the lines written."""
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            s = vehicles[i]["s"]
            past = s - law.length - road.ends[vehicles[i]["path"], 0]
            if vehicles[i]["status"] != DRIVING or s < law.record_start or past > law.record_past:
                continue
            trace[traced]["tick"] = tick
            trace[traced]["row"] = i
            trace[traced]["s"] = s
            trace[traced]["v"] = vehicles[i]["v"]
            trace[traced]["a"] = vehicles[i]["a"]
            trace[traced]["released"] = is_open or vehicles[i]["go"] != 0
            traced += 1
    return traced


@njit
def observe(vehicles: Records, lanes: Records, law: Law, observed: Records) -> int:
    """Fill `observed` with the vehicles of a view (`minisim.control.View`); their number."""
    count = 0
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["uncleared"], lanes[lane]["next"]):
            me = vehicles[i]
            distance = law.entry - me["s"]
            if distance > law.sight:
                break
            if me["cleared"] != 0 or me["status"] != DRIVING:
                continue
            seen = observed[count]
            seen["id"] = me["id"]
            seen["lane"] = lane
            seen["manoeuvre"] = me["manoeuvre"]
            seen["distance"] = distance
            seen["speed"] = me["v"]
            seen["length"] = law.length
            seen["demand_time"] = me["demand_tick"] * law.dt
            count += 1
    return count
