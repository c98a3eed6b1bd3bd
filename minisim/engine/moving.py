"""How vehicles move, and what happens on their way: marks, the junction, the end of the road."""

from __future__ import annotations

import math

from minisim.carfollowing import ballistic, semi_implicit
from minisim.control import HALTING
from minisim.engine.packed import (
    ACC,
    AHEAD,
    BRAKE,
    CLEARED,
    EVENT,
    LANE,
    LENGTH,
    LIMIT,
    LOST,
    MARK,
    PATH,
    RATIO,
    ROW,
    SECTION,
    WAITED,
    S,
    V,
    beware,
    count,
    dismiss,
    expect,
    padded,
)
from minisim.engine.state import ARRIVED, Floats, Ints, Layout, Records
from minisim.jit import njit_apart, njit_inline, njit_inner
from minisim.laws import Law

#: Reasons to wake a session, as bits.
MARKED, CLEAR = 1, 2


@njit_apart
def move(
    floats: Floats,
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    layout: Layout,
    law: Law,
    tick: int,
) -> int:
    """Move every vehicle by one step, add up waiting and loss; returns reasons to wake, as bits."""
    n = count(lanes)
    s, v, acc, event = floats[S], floats[V], floats[ACC], floats[EVENT]
    if law.semi_implicit:
        for i in range(padded(n)):
            s[i], v[i] = semi_implicit(s[i], v[i], acc[i], law.dt)
    else:
        for i in range(padded(n)):
            s[i], v[i] = ballistic(s[i], v[i], acc[i], law.dt)
    happens = False
    for i in range(n):
        happens |= s[i] >= event[i]
    if happens:
        enter_sections(floats, ints, vehicles, layout, n)
    add_up(floats, n)
    return happenings(floats, ints, vehicles, lanes, layout, law, n, tick) if happens else 0


@njit_inline
def enter_sections(floats: Floats, ints: Ints, vehicles: Records, layout: Layout, n: int) -> None:
    """Note the limits of the sections that vehicles have entered."""
    for i in range(n):
        if floats[S, i] < floats[EVENT, i]:
            continue
        p, section = ints[PATH, i], ints[SECTION, i]
        while floats[S, i] >= layout.section_start[p, section + 1]:
            section += 1
        me = vehicles[ints[ROW, i]]
        ints[SECTION, i] = me["section"] = section
        floats[LIMIT, i] = layout.section_speed[p, section] * me["factor"]


@njit_inline
def add_up(floats: Floats, n: int) -> None:
    """Count waiting, and the time lost against driving at the limit."""
    v, top, ratio = floats[V], floats[LIMIT], floats[RATIO]
    waited, lost = floats[WAITED], floats[LOST]
    for i in range(padded(n)):
        waited[i] += 1.0 if v[i] <= HALTING else 0.0
    for i in range(padded(n)):
        r = v[i] / top[i]
        ratio[i] = r
        lost[i] += 1.0 - r if v[i] < top[i] else 0.0


@njit_inner
def happenings(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law, n: int,
    tick: int,
) -> int:  # fmt: skip
    """Carry out what happens to the vehicles that have reached their `EVENT`."""
    reasons = 0
    arrived = 0
    for i in range(n):
        s = floats[S, i]
        if s < floats[EVENT, i]:
            continue
        row, p, lane = ints[ROW, i], ints[PATH, i], ints[LANE, i]
        me = vehicles[row]
        while s >= layout.marks[ints[MARK, i]]:
            ints[MARK, i] += 1
            reasons |= MARKED
        me["mark"] = ints[MARK, i]
        if s >= law.entry and row == lanes[lane]["front"]:
            exit_arm = int(layout.ends[p, 2])
            lanes[lane]["front"] = row + 1
            lanes[lane]["entered"] += 1
            me["ahead"], ints[AHEAD, i] = lanes[exit_arm]["last"], lanes[exit_arm]["tail"]
            lanes[exit_arm]["last"], lanes[exit_arm]["tail"] = row, i
        leave = max(layout.ends[p, 0] + floats[LENGTH, i], law.leave)
        if s >= law.entry and ints[CLEARED, i] == 0 and s >= leave:
            ints[CLEARED, i] = me["cleared"] = 1
            me["brake"] = floats[BRAKE, i] = me["told"] = math.inf
            if law.wake_on_clear:
                reasons |= CLEAR
        if s >= law.entry and s >= layout.ends[p, 1] - law.margin:
            me["status"], me["arrival_tick"] = ARRIVED, tick
            arrived += 1
        beware(floats, ints, vehicles, layout, law, i)
        expect(floats, ints, layout, law, i)
    for i in range(n - 1, -1, -1):
        if arrived and vehicles[ints[ROW, i]]["status"] == ARRIVED:
            dismiss(floats, ints, vehicles, lanes, i)
            arrived -= 1
    catch_up(vehicles, lanes)
    return reasons


@njit_inner
def catch_up(vehicles: Records, lanes: Records) -> None:
    """Note which row of each lane is the first not yet arrived."""
    for lane in range(len(lanes)):
        here = lanes[lane]
        while here["first"] < here["next"] and vehicles[here["first"]]["status"] == ARRIVED:
            here["first"] += 1
