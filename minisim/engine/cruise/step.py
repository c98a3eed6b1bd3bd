"""How vehicles under cruise control choose their accelerations: the leaders, and the hold line."""

from __future__ import annotations

import math

import numpy as np

from minisim.carfollowing import STANDSTILL, braking_distance, cruise_control
from minisim.engine.cruise.law import FASTEST, Cruise, allowed, follow, obey, realise
from minisim.engine.cruise.radar import Ahead, gather, meet
from minisim.engine.state import AMBER, DRIVING, Layout, Records
from minisim.jit import njit_inner
from minisim.laws import (
    KRAUSS,
    STOP_LINE_GAP,
    Law,
    braking_begins,
    hold,
    krauss_stop,
    slow_down,
    stop_at_line,
)
from minisim.laws import (
    follow as follow_law,
)
from minisim.vehicle import POSITION_EPS


@njit_inner
def accelerate(vehicles: Records, lanes: Records, layout: Layout, law: Law, cruise: Cruise) -> bool:
    """Choose every vehicle's acceleration from the present state; returns whether two overlap.

    All in one function for the reason given in `minisim.engine.kernel.accelerate`.
    """
    overlap = False
    ends, mine = layout.ends, cruise.type
    inside = cruise.inside[: gather(vehicles, lanes, ends, law, cruise)]
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        first = lanes[lane]["first"]
        for i in range(first, lanes[lane]["next"]):
            me = vehicles[i]
            if me["status"] != DRIVING:
                continue
            s, v, p = me["s"], me["v"], me["path"]
            v0 = cruise.cruise_speed if me["advice"] == math.inf else me["advice"]
            if law.model == KRAUSS:
                u = free(me, layout, law, cruise)
            else:
                u = cruise_control(v, v0, cruise.cruise_gain, cruise.a, cruise.b)
            if me["told"] < math.inf and law.model == KRAUSS:
                u = min(u, me["told"] if v > 0.0 else max(me["told"], 0.0))
            elif me["told"] < math.inf:
                u = obey(me["told"], v, me["advice"], law, cruise)
            if cruise.obeys:
                u = min(u, (allowed(s, v, p, v0, layout, law, cruise) - v) / law.dt)
            nearest = own = tail = math.inf
            part = 2  # of its way that the leader is on, see `Ahead`
            leave = ends[p, 0]
            held = not is_open and me["go"] == 0 and s < law.entry
            # Where it can stop at a light, only the radar sees beyond (`planMoveInternal`).
            blind = held and (law.model == KRAUSS or cruise.obeys)
            if cruise.obeys and lanes[lane]["open"] == AMBER and s < law.entry:
                blind = braking_distance(v, mine.b_max, law.dt) <= law.entry - s
            if s < leave:
                if law.model != KRAUSS:
                    u = min(u, (cruise.max_speed - v) / law.dt)
                wait = law.entry + cruise.waits[p, 0]
                for j in range(i - 1, first - 1, -1):
                    ahead = vehicles[j]
                    if ahead["status"] != DRIVING:
                        continue
                    rear = ahead["s"] - mine.length
                    on_way = ahead["path"] == p and ahead["s"] >= law.entry and rear < leave
                    on_lane = j == i - 1 and s < law.entry and rear < law.entry
                    if on_way or on_lane:
                        asked = follow(v, rear - s - mine.min_gap, ahead["v"], law, cruise)
                        u = min(u, asked) if on_lane or not blind else u
                        nearest = min(nearest, rear - s)
                        if part == 2:
                            own = asked
                            part = -1 if on_lane else (1 if rear >= wait else 0)
                    if on_way and ahead["s"] >= wait:
                        break
                j = cruise.last[int(ends[p, 2])]
            else:
                j = me["ahead"]
            if j >= 0 and vehicles[j]["status"] == DRIVING:
                ahead = vehicles[j]
                rear = ahead["s"] - mine.length - ends[ahead["path"], 0]
                gap = rear - (s - leave)
                # A vehicle beside it on another way is left to the radar, or waited for before the
                # junction (`adaptToLeader`).
                beside = s < leave and gap < mine.min_gap and rear < 0.0 and ahead["path"] != p
                if beside and law.model == KRAUSS and not blind:
                    u = min(u, krauss_stop(v, law.entry - s - POSITION_EPS, mine, law))
                elif not beside:
                    tail = follow(v, gap - mine.min_gap, ahead["v"], law, cruise)
                    u = u if blind else min(u, tail)
                if s >= leave:
                    nearest = min(nearest, gap)
            near = law.entry - s <= cruise.radar and s < leave and (len(inside) > 0 or blind)
            if law.model == KRAUSS and s < law.entry:  # it may drive up to the line
                stops = braking_begins(v, law.entry - s - 2.0 * STOP_LINE_GAP, mine, law)
                near = near and stops and not blind
            if near and (part >= 0 or s >= law.entry):
                foes = Ahead(own, part, tail)
                asked = meet(vehicles, ends, law, cruise, inside, i, foes, u)
                if law.model == KRAUSS and s < law.entry:
                    asked = max(asked, stop_at_line(v, law.entry - s, mine, law))
                u = min(u, asked)
            overlap |= nearest <= 0.0
            if law.model == KRAUSS:
                a = max(u, -mine.b_max) if v + u * law.dt >= STANDSTILL * law.dt else -v / law.dt
            else:
                u = min(u, (cruise.memory[i]["fastest"] - v) / law.dt)
                a = realise(v, me["a"], u, law, cruise)
                to_wait = law.entry + cruise.waits[p, 0] - s
                if cruise.obeys and not is_open and 0.0 < to_wait <= cruise.waits[p, 0]:
                    # Past a light that is red now, it is quick to pass its waiting position: SUMO
                    # leaves the engine out (`MSVehicle::processLinkApproaches`, `vSafeMin`).
                    least = min(v + u * law.dt, (to_wait + POSITION_EPS) / law.dt)
                    a = max(a, (least - v) / law.dt)
            a = min(a, max(me["brake"], -v / law.dt))
            cruise.memory[i]["fastest"] = FASTEST * v0 / layout.section_speed[p, me["section"]]
            if held and cruise.obeys:
                if s + (v + a * law.dt) * law.dt >= law.entry:
                    a = -v / law.dt
                    cruise.memory[i]["at_red"] = 1
            elif held:
                a = max(min(a, hold(v, s, mine, law)), -mine.b_max)
            me["a"] = a
    return overlap


@njit_inner
def free(me: np.void, layout: Layout, law: Law, cruise: Cruise) -> float:
    """The acceleration of a vehicle that nothing hinders, within the limits here and ahead."""
    s, v, p, section, factor = me["s"], me["v"], me["path"], me["section"], me["factor"]
    start, speed = layout.section_start, layout.section_speed
    acc = follow_law(v, min(speed[p, section] * factor, me["advice"]), 0.0, cruise.type, law)
    k = section + 1
    while braking_begins(v, start[p, k] - s, cruise.type, law):
        lower = speed[p, k] * factor
        acc = min(acc, slow_down(v, acc, lower, start[p, k] - s, cruise.type, law))
        k += 1
    return acc
