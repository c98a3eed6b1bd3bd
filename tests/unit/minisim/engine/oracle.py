"""The rules of a step, vehicle by vehicle over the rows: slow and obvious.

The engine does the same in loops over packed arrays (`minisim.engine.following` and `moving`);
`test_kernel.py` holds the two equal.
"""

from __future__ import annotations

import math

from minisim.carfollowing import ballistic, semi_implicit
from minisim.control import HALTING
from minisim.engine.state import DRIVING, Layout, Records
from minisim.laws import (
    Law,
    braking_begins,
    closeness,
    drive,
    hold,
    keep_room,
    obey,
    room_behind,
    short_of,
    slow_down,
)


def accelerate(vehicles: Records, lanes: Records, layout: Layout, law: Law) -> bool:
    """Choose every vehicle's acceleration from the present state; returns whether two overlap."""
    overlap = False
    branch, ends, types = layout.branch, layout.ends, layout.types
    start, speed = layout.section_start, layout.section_speed
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
            if me["told"] < math.inf:
                acc = obey(me["told"], v, min(limit, me["advice"]), z, mine, law)
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


def move(vehicles: Records, lanes: Records, layout: Layout, law: Law) -> None:
    """Move every vehicle by one step, and add up waiting and loss."""
    start, speed = layout.section_start, layout.section_speed
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
