"""The vehicles on the road as packed arrays: one row per quantity, one slot per vehicle.

The structured array of `minisim.engine.state` has a vehicle's quantities side by side, which is how
commands, results and most rules want them. The loops over all vehicles want one quantity of all
vehicles side by side, so that the compiler can vectorise them. Slots are in the order of the rows:
by lane, then front to back, without those that wait for their insertion or have arrived.

What changes at every step (`s`, `v`, `a`, waiting and loss) is kept only here during a run;
`store` copies it back.
"""

from __future__ import annotations

import math

import numpy as np

from minisim.engine.state import Floats, Ints, Layout, Records
from minisim.jit import njit, njit_inline, njit_inner
from minisim.laws import STOP_MARGIN, Law

#: Rows of the array of floats, as in `minisim.engine.state.VEHICLE` and `minisim.laws.Traits`.
S, V, ACC, LENGTH, B_MAX, A, B, HEADWAY, MIN_GAP, WAITED, LOST, BRAKE = range(12)
#: 2√(ab) of the IDM; the limit where it is, times the driver's factor; v over that limit.
ROOT, LIMIT, RATIO = 12, 13, 14
#: What other leaders ask for: a lower bound on `closeness`, an upper one on `room_behind`.
CLOSEST, NARROWEST = 15, 16
#: The first `s` ahead that may call for braking, and how fast it is left behind in a step.
CARE, REACH = 17, 18
#: The next `s` at which something happens, such as a wake-up mark, and where it matters no more
#: whether its body touches another near the junction; `s` of its exit from the junction.
EVENT, AWAY, LEAVE = 19, 20, 21
#: All rows from here on are new in each step.
LASTING = 22
#: The leader: the gap to its rear bumper, its speed, and the most that its brakes can do.
GAP, LEAD_V, LEAD_B = 22, 23, 24
#: `closeness` and `room_behind` of all leaders together; 1 where a vehicle needs the full rules.
CLOSENESS, ROOM, FLAG = 25, 26, 27
FLOATS = 28

#: Rows of the array of integers. `AHEAD` is a slot, or -1 once that vehicle has arrived.
ROW, LANE, PATH, TYPE, SECTION, MARK, AHEAD, CLEARED, RELEASED = range(9)
INTS = 9


def empty_pack(vehicles: Records, lanes: Records, layout: Layout) -> tuple[Floats, Ints]:
    """Room for as many vehicles as fit on the roads, shapes (FLOATS, k) and (INTS, k)."""
    shortest = vehicles["length"].min(initial=np.inf)
    longest_queue = int((layout.ends[:, 1] - layout.ends[:, 3]).max() / shortest) + 2
    most = min(len(vehicles), len(lanes) * longest_queue)
    width = (most + 7) // 8 * 8 + 8
    ints = aligned(INTS * width).view(np.int64)
    ints[:] = 0
    return aligned(FLOATS * width).reshape(FLOATS, width), ints.reshape(INTS, width)


def aligned(size: int) -> Floats:
    """Ones that begin at a cache line of 64 bytes, so that no vector of them spans two."""
    ones = np.ones(size + 8)
    start = -ones.ctypes.data // 8 % 8
    return ones[start : start + size]


@njit_inline
def count(lanes: Records) -> int:
    """How many vehicles are on the road."""
    last = lanes[-1]
    return int(last["slot"] + last["driving"])


@njit_inline
def padded(n: int) -> int:
    """The next multiple of what the processor takes at once, which `empty_pack` has room for.

    Loops without a remainder are faster; what they write past the last vehicle means nothing.
    """
    return (n + 7) // 8 * 8


@njit_inner
def admit(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law, i: int
) -> None:
    """Give row i, which has just been inserted on its lane, a slot behind the others there."""
    lane = vehicles[i]["lane"]
    at = lanes[lane]["slot"] + lanes[lane]["driving"]
    shift(floats, ints, lanes, lane, at, 1)
    me = vehicles[i]
    mine, p = layout.types[me["type"]], me["path"]
    ints[ROW, at], ints[LANE, at], ints[PATH, at], ints[TYPE, at] = i, lane, p, me["type"]
    ints[SECTION, at], ints[MARK, at] = me["section"], me["mark"]
    ints[AHEAD, at], ints[CLEARED, at] = -1, 0
    floats[S, at], floats[V, at], floats[ACC, at] = me["s"], me["v"], me["a"]
    floats[LENGTH, at], floats[B_MAX, at] = me["length"], me["b_max"]
    floats[A, at], floats[B, at] = mine.a, mine.b
    floats[HEADWAY, at], floats[MIN_GAP, at] = mine.headway, mine.min_gap
    floats[ROOT, at] = 2.0 * math.sqrt(mine.a * mine.b)
    floats[WAITED, at], floats[LOST, at] = 0.0, 0.0
    floats[LIMIT, at] = layout.section_speed[p, me["section"]] * me["factor"]
    floats[RATIO, at] = me["v"] / floats[LIMIT, at]
    floats[CLOSEST, at], floats[NARROWEST, at] = 0.0, math.inf
    floats[REACH, at] = (mine.a + 2.0 * mine.b) * law.dt
    floats[LEAVE, at] = layout.ends[p, 0]
    floats[AWAY, at] = layout.ends[p, 0] + 2.0 * me["length"]
    ints[RELEASED, at] = lanes[lane]["open"] != 0 or me["go"] != 0
    floats[BRAKE, at] = me["brake"]
    beware(floats, ints, vehicles, layout, law, at)
    expect(floats, ints, layout, law, at)


@njit_inner
def shift(floats: Floats, ints: Ints, lanes: Records, lane: int, at: int, by: int) -> None:
    """Make room for a slot on a lane (`by` 1), or close the gap that one leaves (`by` -1)."""
    n = count(lanes)
    for k in range(LASTING):
        shift_row(floats[k, at : n + 1], by)
    for k in range(INTS):
        for i in range(n, at, -1) if by > 0 else range(at, n - 1):
            ints[k, i] = ints[k, i - by]
    for i in range(n + by):
        ints[AHEAD, i] = shifted(ints[AHEAD, i], at, by)
    for arm in range(len(lanes)):
        lanes[arm]["tail"] = shifted(lanes[arm]["tail"], at, by)
        if arm > lane:
            lanes[arm]["slot"] += by
    lanes[lane]["driving"] += by


@njit_inline
def shift_row(row: Floats, by: int) -> None:
    """Move all but the last one back (`by` 1), or all but the first forward (`by` -1).

    A function over a part, whose indices are never below 0: so the compiler vectorises its loops.
    """
    last = len(row) - 1
    if by > 0:
        for i in range(last):
            row[last - i] = row[last - i - 1]
    else:
        for i in range(last):
            row[i] = row[i + 1]


@njit_inline
def shifted(slot: int, at: int, by: int) -> int:
    """Where a vehicle is after a shift; -1 if it has left its slot."""
    if slot < at:
        return slot
    return -1 if by < 0 and slot == at else slot + by


@njit_inner
def dismiss(floats: Floats, ints: Ints, vehicles: Records, lanes: Records, at: int) -> None:
    """Take the vehicle in a slot off the road."""
    keep(floats, ints, vehicles, at)
    lane = ints[LANE, at]
    shift(floats, ints, lanes, lane, at, -1)
    lanes[lane]["entered"] -= 1


@njit
def store(floats: Floats, ints: Ints, vehicles: Records, lanes: Records) -> None:
    """Copy what changes at every step back to the rows."""
    for i in range(count(lanes)):
        keep(floats, ints, vehicles, i)


@njit_inline
def keep(floats: Floats, ints: Ints, vehicles: Records, i: int) -> None:
    """`store` for one slot."""
    me = vehicles[ints[ROW, i]]
    me["s"], me["v"], me["a"] = floats[S, i], floats[V, i], floats[ACC, i]
    me["waiting_ticks"], me["lost_ticks"] = int(floats[WAITED, i]), floats[LOST, i]


@njit_inner
def heed(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law
) -> bool:
    """Take over what commands have changed; returns whether any vehicle is told to brake."""
    braking = False
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        first = lanes[lane]["slot"]
        for i in range(first, first + lanes[lane]["driving"]):
            me = vehicles[ints[ROW, i]]
            ints[RELEASED, i] = is_open or me["go"] != 0
            floats[BRAKE, i] = me["brake"]
            braking |= me["brake"] != math.inf
            beware(floats, ints, vehicles, layout, law, i)
    return braking


@njit_inline
def beware(floats: Floats, ints: Ints, vehicles: Records, layout: Layout, law: Law, i: int) -> None:
    """Note the first `s` ahead that may call for braking; minus infinity if that is anywhere."""
    s = floats[S, i]
    care = layout.section_start[ints[PATH, i], ints[SECTION, i] + 1]
    if s < law.entry:
        # `hold` keeps a vehicle that stands 1 mm before its line where it is.
        care = min(care, law.entry if ints[RELEASED, i] else law.hold - STOP_MARGIN - 1e-3)
    me = vehicles[ints[ROW, i]]
    free = me["advice"] == math.inf and me["told"] == math.inf
    floats[CARE, i] = care if free else -math.inf


@njit_inner
def expect(floats: Floats, ints: Ints, layout: Layout, law: Law, i: int) -> None:
    """Note the next `s` at which something happens."""
    p = ints[PATH, i]
    leave, length = floats[LEAVE, i], floats[LENGTH, i]
    event = min(layout.section_start[p, ints[SECTION, i] + 1], layout.marks[ints[MARK, i]])
    event = min(event, layout.ends[p, 1] - law.margin)
    if floats[S, i] < law.entry:
        event = min(event, law.entry)
    if ints[CLEARED, i] == 0:
        event = min(event, max(leave + length, law.leave))
    floats[EVENT, i] = event
