"""Advance every vehicle until something happens that the caller must know about.

Functions over the arrays of `minisim.engine.state`; numba compiles them where it is installed, and
the same source runs as plain Python. A step inserts vehicles, chooses every acceleration from
the state at its beginning, then moves every vehicle.
"""

from __future__ import annotations

from minisim.engine.broad_phase import may_touch
from minisim.engine.cruise.ends import look
from minisim.engine.cruise.law import Cruise
from minisim.engine.cruise.step import accelerate as accelerate_cruising
from minisim.engine.following import accelerate, choose
from minisim.engine.insertion import insert
from minisim.engine.moving import CLEAR, MARKED, catch_up, move
from minisim.engine.packed import (
    ACC,
    CLEARED,
    LENGTH,
    PATH,
    RELEASED,
    ROW,
    S,
    V,
    count,
    dismiss,
    heed,
    store,
)
from minisim.engine.state import ARRIVED, Floats, Ints, Layout, Records
from minisim.jit import njit_inline, njit_inner, njit_with
from minisim.laws import Law

#: Reasons to return, as bits, beside those to wake a session.
TOUCH, GAP, TRACE_FULL, DONE = 4, 8, 16, 32


@njit_with(choose, move, may_touch)
def advance(
    floats: Floats,
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    layout: Layout,
    law: Law,
    cruise: Cruise | None,
    trace: Records,
    bodies: Floats,
    observed: Records,
    traced: int,
    tick: int,
    until: int,
    heeds: int,
) -> tuple[int, int, int, int]:
    """Advance from `tick` to `until` at most; stop after any step that gives a reason to return.

    Args:
        floats, ints: the vehicles on the road, see `minisim.engine.packed`.
        cruise: what vehicles under cruise control need beside `law`; None under any other law.
        trace: the recording, filled from line `traced` on.
        bodies: scratch space (k, 6) for the k vehicles that can be in or near the junction at once.
        observed: filled with what a view shows at the end, see `observe`.
        heeds: the first tick at which vehicles wake the session.

    Returns:
        The tick reached, the reasons (bits, 0 at `until`), and the numbers of lines recorded and
        vehicles observed.
    """
    braking = heed(floats, ints, vehicles, lanes, layout, law)
    reasons = 0
    while tick < until and reasons == 0:
        reasons = step(floats, ints, vehicles, lanes, layout, law, cruise, bodies, braking, tick)
        tick += 1
        if tick < heeds:
            reasons &= ~(MARKED | CLEAR)
        if law.record_from <= tick < law.record_to:
            traced = record(floats, ints, lanes, layout, law, trace, traced, tick)
            if traced + lanes[-1]["end"] > len(trace):
                reasons |= TRACE_FULL
    return tick, reasons, traced, observe(floats, ints, vehicles, lanes, law, observed)


@njit_inline
def step(
    floats: Floats,
    ints: Ints,
    vehicles: Records,
    lanes: Records,
    layout: Layout,
    law: Law,
    cruise: Cruise | None,
    bodies: Floats,
    braking: bool,
    tick: int,
) -> int:
    """Take one step, from `tick` to the next; returns the reasons to return, as bits."""
    reasons = 0
    if insert(floats, ints, vehicles, lanes, layout, law, cruise, tick):
        reasons |= MARKED
    if cruise is None:
        overlap = accelerate(floats, ints, vehicles, lanes, layout, law, braking)
    else:
        overlap = accelerate_cruising(vehicles, lanes, layout, law, cruise)
        for i in range(count(lanes)):
            floats[ACC, i] = vehicles[ints[ROW, i]]["a"]
    if overlap:
        reasons |= GAP
    reasons |= move(floats, ints, vehicles, lanes, layout, law, tick + 1)
    if cruise is not None:
        store(floats, ints, vehicles, lanes)
        if look(vehicles, lanes, layout, law, cruise, tick + 1):
            reasons |= CLEAR
        for i in range(count(lanes) - 1, -1, -1):
            floats[S, i], floats[ACC, i] = vehicles[ints[ROW, i]]["s"], vehicles[ints[ROW, i]]["a"]
            if vehicles[ints[ROW, i]]["status"] == ARRIVED:
                dismiss(floats, ints, vehicles, lanes, i)
                catch_up(vehicles, lanes)
    if law.wake_when_empty and reasons & (MARKED | CLEAR) and occupied(floats, ints, lanes, law):
        reasons &= ~(MARKED | CLEAR)
    if may_touch(floats, ints, lanes, layout, law, bodies):
        reasons |= TOUCH
    done = True
    for lane in range(len(lanes)):
        done &= lanes[lane]["first"] == lanes[lane]["end"]
    return reasons | DONE if done else reasons


@njit_inner
def occupied(floats: Floats, ints: Ints, lanes: Records, law: Law) -> bool:
    """Whether any vehicle is inside the junction, at least partly."""
    inside = False
    for i in range(count(lanes)):
        inside |= floats[S, i] > law.entry and ints[CLEARED, i] == 0
    return inside


@njit_inner
def record(
    floats: Floats,
    ints: Ints,
    lanes: Records,
    layout: Layout,
    law: Law,
    trace: Records,
    traced: int,
    tick: int,
) -> int:
    """Write one line for every vehicle in the recorded stretch; returns the count so far."""
    for i in range(count(lanes)):
        s = floats[S, i]
        past = s - floats[LENGTH, i] - layout.ends[ints[PATH, i], 0]
        if s < law.record_start or past > law.record_past:
            continue
        line = trace[traced]
        line["tick"], line["row"] = tick, ints[ROW, i]
        line["s"], line["v"], line["a"] = s, floats[V, i], floats[ACC, i]
        line["released"] = ints[RELEASED, i]
        traced += 1
    return traced


@njit_inner
def observe(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, law: Law, observed: Records
) -> int:
    """Fill `observed` with the vehicles of a view (`minisim.control.View`); returns how many."""
    found = 0
    for lane in range(len(lanes)):
        first = lanes[lane]["slot"]
        for i in range(first, first + lanes[lane]["driving"]):
            distance = law.entry - floats[S, i]
            if distance > law.sight:
                break
            if ints[CLEARED, i] != 0:
                continue
            me, seen = vehicles[ints[ROW, i]], observed[found]
            seen["id"] = me["id"]
            seen["lane"] = lane
            seen["manoeuvre"] = me["manoeuvre"]
            seen["distance"] = distance
            seen["speed"] = floats[V, i]
            seen["length"] = me["length"]
            seen["demand_time"] = me["demand_tick"] * law.dt
            seen["rank"] = me["rank"]
            seen["speed_factor"] = me["factor"]
            seen["type"] = me["type"]
            found += 1
    return found
