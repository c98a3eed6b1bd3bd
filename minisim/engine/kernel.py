"""Advance every vehicle until something happens that the caller must know about.

Functions over the arrays of `minisim.engine.state`; numba compiles them where it is installed, and
the same source runs as plain Python. A step inserts vehicles, chooses every acceleration from
the state at its beginning, then moves every vehicle.
"""

from __future__ import annotations

import math

from minisim.carfollowing import ballistic, semi_implicit
from minisim.control import HALTING
from minisim.engine.broad_phase import may_touch
from minisim.engine.cruise.ends import look
from minisim.engine.cruise.law import Cruise
from minisim.engine.cruise.step import accelerate as accelerate_cruising
from minisim.engine.insertion import insert
from minisim.engine.state import ARRIVED, DRIVING, Floats, Layout, Records
from minisim.jit import njit, njit_inline
from minisim.laws import (
    Law,
    braking_begins,
    closeness,
    drive,
    hold,
    keep_room,
    room_behind,
    short_of,
    slow_down,
)

#: Reasons to return, as bits.
MARK, CLEAR, TOUCH, GAP, TRACE_FULL, DONE = 1, 2, 4, 8, 16, 32


@njit
def advance(
    vehicles: Records,
    lanes: Records,
    road: Layout,
    law: Law,
    cruise: Cruise | None,
    trace: Records,
    traced: int,
    bodies: Floats,
    observed: Records,
    tick: int,
    until: int,
) -> tuple[int, int, int, int]:
    """Advance from `tick` to `until` at most; stop after any step that gives a reason to return.

    Args:
        cruise: what vehicles under cruise control need beside `law`; None under any other law.
        trace: the recording, filled from line `traced` on.
        bodies: scratch space (k, 6) for the k vehicles that can be in or near the junction at once.
        observed: filled with what a view shows at the end, see `observe`.

    Returns:
        The tick reached, the reasons (bits, 0 at `until`), and the numbers of lines recorded and
        vehicles observed.
    """
    reasons = 0
    while tick < until and reasons == 0:
        reasons = step(vehicles, lanes, road, law, cruise, bodies, tick)
        tick += 1
        if law.record_from <= tick < law.record_to:
            traced = record(vehicles, lanes, road, law, trace, traced, tick)
            if traced + lanes[-1]["end"] > len(trace):
                reasons |= TRACE_FULL
    return tick, reasons, traced, observe(vehicles, lanes, law, observed)


@njit_inline
def step(
    vehicles: Records,
    lanes: Records,
    road: Layout,
    law: Law,
    cruise: Cruise | None,
    bodies: Floats,
    tick: int,
) -> int:
    """Take one step, from `tick` to the next; returns the reasons to return, as bits."""
    reasons = 0
    if insert(vehicles, lanes, road, law, cruise, tick):
        reasons |= MARK
    if cruise is None:
        overlap = accelerate(vehicles, lanes, road, law)
    else:
        overlap = accelerate_cruising(vehicles, lanes, road, law, cruise)
    if overlap:
        reasons |= GAP
    reasons |= move(vehicles, lanes, road, law, tick + 1)
    if cruise is not None and look(vehicles, lanes, road, law, cruise, tick + 1):
        reasons |= CLEAR
    if may_touch(vehicles, lanes, road, law, bodies):
        reasons |= TOUCH
    return reasons


@njit_inline
def accelerate(vehicles: Records, lanes: Records, road: Layout, law: Law) -> bool:
    """Choose every vehicle's acceleration from the present state; returns whether two overlap.

    Helpers get rows and numbers, never arrays: counting references to arrays would take longer than
    the arithmetic.
    """
    overlap = False
    branch, ends, types = road.branch, road.ends, road.types
    start, speed = road.section_start, road.section_speed
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        first, front = lanes[lane]["first"], lanes[lane]["front"]
        for i in range(first, lanes[lane]["next"]):
            me = vehicles[i]
            if me["status"] != DRIVING:
                continue
            s, v, p, mine = me["s"], me["v"], me["path"], types[me["type"]]
            released = is_open or me["go"] != 0

            # The vehicle ahead in the lane, until its rear has left the shared path. If it has
            # turned off, one further ahead may still be on the path.
            z = 0.0
            room = math.inf  # to stop in
            j = i - 1
            while j >= first:
                ahead = vehicles[j]
                rear = ahead["s"] - ahead["length"]
                if ahead["status"] == DRIVING and rear < branch[ahead["path"], p]:
                    z = closeness(v, rear - s, ahead["v"], mine, law)
                    room = room_behind(rear - s, ahead["v"], ahead["b_max"], mine, law)
                    overlap |= rear <= s
                    break
                if s >= ends[p, 0]:
                    break
                j -= 1

            # A vehicle that cannot stop before the junction sees past a leader that may turn off.
            near = s < ends[p, 0] and v * v > 2.0 * mine.b_max * (law.entry - s)
            j = min(j, front) - 1
            while near and j >= first:
                ahead = vehicles[j]
                rear = ahead["s"] - ahead["length"]
                if ahead["status"] == DRIVING and rear < branch[ahead["path"], p]:
                    new = room_behind(rear - s, ahead["v"], ahead["b_max"], mine, law)
                    room = min(room, new)
                j -= 1

            # From the junction on, also the last vehicle ahead bound for the same exit lane.
            # Both positions are measured from that lane, so a vehicle that is still on another arc
            # counts as if it were on this one.
            j = -1
            if s >= law.entry:
                j = me["ahead"]
            elif released and (i == front or near):
                j = lanes[int(ends[p, 2])]["last"]
            if j >= 0 and vehicles[j]["status"] == DRIVING:
                ahead = vehicles[j]
                rear = ahead["s"] - ahead["length"] - ends[ahead["path"], 0]
                gap = rear - (s - ends[p, 0])
                if s >= law.entry or i == front:
                    z = max(z, closeness(v, gap, ahead["v"], mine, law))
                if rear >= 0.0:
                    room = min(room, room_behind(gap, ahead["v"], ahead["b_max"], mine, law))
                overlap |= gap <= 0.0 and s >= ends[p, 0]

            section, factor = me["section"], me["factor"]
            limit = speed[p, section] * factor
            acc = drive(v, limit, me["advice"], z, mine, law)
            k = section + 1
            while braking_begins(v, start[p, k] - s, mine, law):
                lower = speed[p, k] * factor
                acc = min(acc, slow_down(v, acc, lower, start[p, k] - s, mine, law))
                k += 1
            if not released and s < law.entry:
                acc = min(acc, hold(v, s, mine, law))
            if short_of(room, v, v + acc * law.dt, mine, law):
                acc = min(acc, keep_room(v, room, mine, law))
            brake = me["brake"] if v > 0.0 else max(me["brake"], 0.0)  # stays standing
            me["a"] = max(min(acc, brake), -mine.b_max)
    return overlap


@njit_inline
def move(vehicles: Records, lanes: Records, road: Layout, law: Law, tick: int) -> int:
    """Move every vehicle by one step, add up waiting and loss, and collect reasons to return."""
    reasons = 0
    done = True
    ends, marks = road.ends, road.marks
    start, speed = road.section_start, road.section_speed
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            if vehicles[i]["status"] != DRIVING:
                continue
            p = vehicles[i]["path"]
            s, v, acc = vehicles[i]["s"], vehicles[i]["v"], vehicles[i]["a"]
            if law.semi_implicit:
                s, v = semi_implicit(s, v, acc, law.dt)
            else:
                s, v = ballistic(s, v, acc, law.dt)
            vehicles[i]["s"] = s
            vehicles[i]["v"] = v
            if v <= HALTING:
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
                vehicles[i]["ahead"] = lanes[exit_arm]["last"]
                lanes[exit_arm]["last"] = i
            if vehicles[i]["cleared"] == 0 and s >= max(
                ends[p, 0] + vehicles[i]["length"], law.leave
            ):
                vehicles[i]["cleared"] = 1
                vehicles[i]["brake"] = math.inf
                if law.wake_on_clear:
                    reasons |= CLEAR
            if s >= ends[p, 1] - law.margin:
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
def record(
    vehicles: Records,
    lanes: Records,
    road: Layout,
    law: Law,
    trace: Records,
    traced: int,
    tick: int,
) -> int:
    """Write one line for every vehicle in the recorded stretch; returns the count so far."""
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            s = vehicles[i]["s"]
            past = s - vehicles[i]["length"] - road.ends[vehicles[i]["path"], 0]
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
    """Fill `observed` with the vehicles of a view (`minisim.control.View`); returns how many."""
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
            seen["length"] = me["length"]
            seen["demand_time"] = me["demand_tick"] * law.dt
            seen["rank"] = me["rank"]
            seen["speed_factor"] = me["factor"]
            seen["type"] = me["type"]
            count += 1
    return count
