"""How vehicles choose their accelerations, from the state at the beginning of a step.

Three passes over the packed arrays: who the leaders are, what they ask for, and the acceleration.
Plain loops, so that the compiler vectorises them: each writes one array, and reads seven at most.
None changes an array only where a condition holds, or to a minimum of what it was: that would
become a masked store, for which the next loop has to wait. A vehicle with nothing but a leader
ahead, which is most of them, needs no more than these loops; the others are flagged, and take
`careful`.
"""

from __future__ import annotations

import math

from minisim.carfollowing import free_road
from minisim.engine.packed import (
    ACC,
    AHEAD,
    B_MAX,
    BRAKE,
    CARE,
    CLOSENESS,
    CLOSEST,
    FLAG,
    GAP,
    HEADWAY,
    LANE,
    LEAD_B,
    LEAD_V,
    LEAVE,
    LENGTH,
    LIMIT,
    MIN_GAP,
    NARROWEST,
    PATH,
    RATIO,
    REACH,
    RELEASED,
    ROOM,
    ROOT,
    ROW,
    SECTION,
    TYPE,
    A,
    B,
    S,
    V,
    count,
    padded,
)
from minisim.engine.state import Floats, Ints, Layout, Records
from minisim.jit import njit_apart, njit_inline, njit_inner
from minisim.laws import (
    IDM,
    IIDM,
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


@njit_inline
def accelerate(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law,
    braking: bool,
) -> bool:  # fmt: skip
    """Choose every vehicle's acceleration; returns whether two overlap."""
    n = count(lanes)
    next_ahead(floats, law, padded(n))
    overlap = False
    for lane in range(len(lanes)):
        overlap |= near_junction(floats, ints, lanes, layout, law, lane)
    overlap |= weigh(floats, ints, layout, law, n)
    choose(floats, ints, vehicles, lanes, layout, law)
    keep_rooms(floats, ints, layout, law, n)
    if braking:
        obey_brakes(floats, n)
    return overlap


@njit_inline
def next_ahead(floats: Floats, law: Law, n: int) -> None:
    """Take the vehicle in the slot before for the leader; right only before the junction."""
    s, v, length, gap, lead_v = floats[S], floats[V], floats[LENGTH], floats[GAP], floats[LEAD_V]
    for i in range(1, n):
        gap[i] = s[i - 1] - length[i - 1] - s[i]
    for i in range(1, n):
        lead_v[i] = v[i - 1]
    if law.semi_implicit or law.mixed:
        b_max, lead_b = floats[B_MAX], floats[LEAD_B]
        for i in range(1, n):
            lead_b[i] = b_max[i - 1]


@njit_inline
def near_junction(
    floats: Floats, ints: Ints, lanes: Records, layout: Layout, law: Law, lane: int
) -> bool:
    """The leaders of the vehicles that have entered the junction, and of the first that has not.

    Returns whether two overlap.
    """
    overlap = False
    branch = layout.branch
    s, v, length, b_max, leave = floats[S], floats[V], floats[LENGTH], floats[B_MAX], floats[LEAVE]
    row, path, ahead = ints[ROW], ints[PATH], ints[AHEAD]
    first = lanes[lane]["slot"]
    front = first + lanes[lane]["entered"]
    for i in range(first, min(front + 1, first + lanes[lane]["driving"])):
        p, out = path[i], s[i] >= leave[i]
        gap, lead = math.inf, i
        closest, narrowest = 0.0, math.inf

        # The vehicle ahead in the lane, until its rear has left the shared path. If it has
        # turned off, one further ahead may still be on the path, but not once it is on its exit.
        j = i - 1
        if out and row[j] != row[i] - 1:
            j = -1
        while j >= first:
            rear = s[j] - length[j]
            if rear < branch[path[j], p]:
                gap, lead = rear - s[i], j
                break
            j = -1 if out else j - 1

        # A vehicle that cannot stop before the junction sees past a leader that may turn off.
        if not out and v[i] * v[i] > 2.0 * b_max[i] * (law.entry - s[i]):
            narrowest = beyond(floats, ints, layout, law, first, lead, i)

        # From the junction on, also the last vehicle ahead bound for the same exit lane.
        # Both positions are measured from that lane, so a vehicle that is still on another arc
        # counts as if it were on this one.
        k = ahead[i]
        if i == front and ints[RELEASED, i]:
            k = lanes[int(layout.ends[p, 2])]["tail"]
        if k >= 0:
            rear = s[k] - length[k] - leave[k]
            other = rear - (s[i] - leave[i])
            if rear >= 0.0 and lead == i:
                gap, lead = other, k
            elif rear >= 0.0 and lead == k and (law.model == IDM or law.model == IIDM):
                gap = min(gap, other)  # the same vehicle: the smaller gap decides everything
            else:
                mine = layout.types[ints[TYPE, i]]
                closest = closeness(v[i], other, v[k], mine, law)
                if rear >= 0.0:
                    room = room_behind(other, v[k], b_max[k], mine, law)
                    narrowest = min(narrowest, room)
                overlap |= other <= 0.0 and out
        floats[GAP, i], floats[LEAD_V, i], floats[LEAD_B, i] = gap, v[lead], b_max[lead]
        floats[CLOSEST, i], floats[NARROWEST, i] = closest, narrowest
    return overlap


@njit_inner
def beyond(
    floats: Floats, ints: Ints, layout: Layout, law: Law, first: int, stop: int, i: int
) -> float:
    """The least room behind the vehicles from slot `first` to before `stop` on i's path."""
    narrowest = math.inf
    p, mine = ints[PATH, i], layout.types[ints[TYPE, i]]
    for j in range(stop - 1, first - 1, -1):
        rear = floats[S, j] - floats[LENGTH, j]
        if rear < layout.branch[ints[PATH, j], p]:
            gap = rear - floats[S, i]
            new = room_behind(gap, floats[V, j], floats[B_MAX, j], mine, law)
            narrowest = min(narrowest, new)
    return narrowest


@njit_inline
def weigh(floats: Floats, ints: Ints, layout: Layout, law: Law, n: int) -> bool:
    """What the leaders ask for; returns whether two vehicles overlap."""
    v, gap, lead_v, lead_b = floats[V], floats[GAP], floats[LEAD_V], floats[LEAD_B]
    z, room, b_max = floats[CLOSENESS], floats[ROOM], floats[B_MAX]
    closest, narrowest = floats[CLOSEST], floats[NARROWEST]
    overlap = False
    m = padded(n)
    for i in range(n):
        overlap |= gap[i] <= 0.0
    if law.model == IDM or law.model == IIDM:  # `gap_ratio`
        headway, root, min_gap = floats[HEADWAY], floats[ROOT], floats[MIN_GAP]
        for i in range(m):
            dynamic = v[i] * headway[i] + v[i] * (v[i] - lead_v[i]) / root[i]
            wanted = (min_gap[i] + (dynamic if dynamic > 0.0 else 0.0)) / gap[i]
            z[i] = max(wanted if gap[i] > 0.0 else math.inf, closest[i])
    else:
        for i in range(n):
            z[i] = closest[i]
            if gap[i] < math.inf:
                mine = layout.types[ints[TYPE, i]]
                z[i] = max(z[i], closeness(v[i], gap[i], lead_v[i], mine, law))
    if law.semi_implicit or law.mixed:
        for i in range(n):
            mine = layout.types[ints[TYPE, i]]
            behind = room_behind(gap[i], lead_v[i], lead_b[i], mine, law)
            room[i] = min(behind, narrowest[i])
    else:  # `room_behind` with equal brakes
        for i in range(m):
            behind = 2.0 * b_max[i] * (gap[i] - law.room) + lead_v[i] * lead_v[i]
            room[i] = min(behind, narrowest[i])
    return overlap


@njit_apart
def choose(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law
) -> None:
    """The acceleration that the law, the limits, the hold line and the brakes allow."""
    n, flag = count(lanes), floats[FLAG]
    if law.model == IDM and law.quartic:
        s, v, acc, ratio, z = floats[S], floats[V], floats[ACC], floats[RATIO], floats[CLOSENESS]
        a, b, b_max, top = floats[A], floats[B], floats[B_MAX], floats[LIMIT]
        care, reach = floats[CARE], floats[REACH]
        m = padded(n)
        for i in range(m):
            wanted = free_road(ratio[i], a[i], b[i], 4.0) - a[i] * z[i] * z[i]
            acc[i] = max(wanted, -b_max[i])
        for i in range(m):
            near = v[i] + reach[i]
            brakes = near * near >= 2.0 * b[i] * (care[i] - s[i])
            flag[i] = 1.0 if brakes or v[i] < top[i] < v[i] + acc[i] * law.dt else 0.0
    else:
        for i in range(n):
            flag[i] = 1.0
    for i in range(n):
        if flag[i] != 0.0:
            careful(floats, ints, vehicles, lanes, layout, law, i)


@njit_inline
def careful(
    floats: Floats, ints: Ints, vehicles: Records, lanes: Records, layout: Layout, law: Law, i: int
) -> None:
    """`choose` for a vehicle that may have to slow down, or that a command drives."""
    s, v, z, p = floats[S, i], floats[V, i], floats[CLOSENESS, i], ints[PATH, i]
    me, mine = vehicles[ints[ROW, i]], layout.types[ints[TYPE, i]]
    start, speed = layout.section_start, layout.section_speed
    if me["told"] < math.inf:
        acc = obey(me["told"], v, min(floats[LIMIT, i], me["advice"]), z, mine, law)
    else:
        acc = drive(v, floats[LIMIT, i], me["advice"], z, mine, law)
    k = ints[SECTION, i] + 1
    while braking_begins(v, start[p, k] - s, mine, law):
        lower = speed[p, k] * me["factor"]
        acc = min(acc, slow_down(v, acc, lower, start[p, k] - s, mine, law))
        k += 1
    if s < law.entry and not ints[RELEASED, i]:
        acc = min(acc, hold(v, s, mine, law))
    floats[ACC, i] = max(acc, -floats[B_MAX, i])
    first = lanes[ints[LANE, i]]["slot"]
    front = first + lanes[ints[LANE, i]]["entered"]
    if i > front and v * v > 2.0 * mine.b_max * (law.entry - s):
        room = min(floats[ROOM, i], beyond(floats, ints, layout, law, first, front, i))
        k = lanes[int(layout.ends[p, 2])]["tail"]
        if ints[RELEASED, i] and k >= 0:
            rear = floats[S, k] - floats[LENGTH, k] - layout.ends[ints[PATH, k], 0]
            gap = rear - (s - layout.ends[p, 0])
            if rear >= 0.0:
                room = min(room, room_behind(gap, floats[V, k], floats[B_MAX, k], mine, law))
        floats[ROOM, i] = room


@njit_inline
def keep_rooms(floats: Floats, ints: Ints, layout: Layout, law: Law, n: int) -> None:
    """Brake harder where the room behind a leader asks for it: `short_of` for all, then some."""
    v, acc, room, b_max = floats[V], floats[ACC], floats[ROOM], floats[B_MAX]
    short = False
    for i in range(n):
        v_new = v[i] + acc[i] * law.dt
        top = v_new if v_new > v[i] else v[i]
        short |= top * (top + 2.0 * b_max[i] * law.dt) > room[i]
    if not short:
        return
    for i in range(n):
        mine = layout.types[ints[TYPE, i]]
        if short_of(room[i], v[i], v[i] + acc[i] * law.dt, mine, law):
            acc[i] = max(min(acc[i], keep_room(v[i], room[i], mine, law)), -b_max[i])


@njit_inline
def obey_brakes(floats: Floats, n: int) -> None:
    """Brake where a command says so, within what the brakes can do."""
    v, acc, b_max = floats[V], floats[ACC], floats[B_MAX]
    for i in range(n):
        brake = floats[BRAKE, i] if v[i] > 0.0 else max(floats[BRAKE, i], 0.0)
        acc[i] = max(min(acc[i], brake), -b_max[i])
