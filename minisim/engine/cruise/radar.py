"""Which vehicles on other ways inside the junction a vehicle follows."""

from __future__ import annotations

import math
from typing import NamedTuple

from minisim.carfollowing import braking_distance
from minisim.control import HALTING
from minisim.engine.cruise.law import Cruise, follow
from minisim.engine.state import DRIVING, Floats, Ints, Records
from minisim.jit import njit_inline, njit_inner
from minisim.junction.meetings import Meeting
from minisim.laws import KRAUSS, Law, krauss_stop
from minisim.ticks import NEVER
from minisim.vehicle import POSITION_EPS

NOWHERE, JOIN, PART = int(Meeting.NOWHERE), int(Meeting.JOIN), int(Meeting.PART)
CROSS, WAIT = int(Meeting.CROSS), int(Meeting.WAIT)

#: More than any gap [m].
FAR = 1e9


class Ahead(NamedTuple):
    """What the leaders on a vehicle's own roads ask of it [m/s²], infinite without one."""

    own: float  # the one on its own lane or way
    part: int  # the part of the way on which that is; -1 is its own lane, 2 no leader
    tail: float  # the last one on its exit


@njit_inner
def gather(vehicles: Records, lanes: Records, ends: Floats, law: Law, cruise: Cruise) -> int:
    """Note the rows of the vehicles at least partly in the junction; returns how many they are."""
    inside, count = cruise.inside, 0
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            s, p = vehicles[i]["s"], vehicles[i]["path"]
            if s < law.entry:
                break
            if (
                vehicles[i]["status"] == DRIVING
                and s - cruise.type.length < ends[p, 0]
                and count < len(inside)
            ):
                inside[count] = i
                count += 1
                cruise.memory[i]["unseen"] = cruise.memory[i]["blocked"]
                cruise.memory[i]["blocked"] = 0
    return count


@njit_inner
def meet(
    vehicles: Records,
    ends: Floats,
    law: Law,
    cruise: Cruise,
    inside: Ints,
    i: int,
    ahead: Ahead,
    most: float,
) -> float:
    """Acceleration that vehicles inside the junction on other ways ask of vehicle i [m/s²].

    Without them it would take `most`.

    A vehicle that has yet to enter may drive up to the junction (`MSVehicle::checkLinkLeader`), so
    only its radar counts. Inside it follows those that meet the part of the way that it is on; it
    may also speed up if it still arrives after a vehicle that only crosses
    (`MSVehicle::adaptToJunctionLeader`).
    """
    s, v, p = vehicles[i]["s"], vehicles[i]["v"], vehicles[i]["path"]
    wait = cruise.waits[p, 0]
    part = 0 if wait > 0.0 and s < law.entry + wait else 1  # the next, or the one that it is on
    if law.model == KRAUSS:
        # It stops before the part of the way that others can meet, or before they do.
        begin = law.entry + part * wait - POSITION_EPS - s
        u, halt = math.inf, krauss_stop(v, begin, cruise.type, law)
    else:
        u = halt = radar(vehicles, ends, law, cruise, inside, i, part, ahead)
        if s < law.entry:
            return u
    crossing = halt
    for j in inside:
        other = vehicles[j]
        q = other["path"]
        for k in range(2):
            kind = int(cruise.meetings[p, part, q, k, 0])
            if kind == NOWHERE:
                continue
            gap, to_crossing, in_the_way = room(vehicles, ends, law, cruise, i, part, j, k)
            first = s < law.entry or before(vehicles, cruise, i, j, kind)
            if gap == math.inf or not (in_the_way or first):
                continue
            if law.model == KRAUSS:
                crossing = krauss_stop(v, to_crossing - cruise.type.min_gap, cruise.type, law)
            a = follow(v, gap, other["v"], law, cruise) if gap >= 0.0 else halt
            if kind == WAIT:
                a = max(halt, crossing)
            elif kind == CROSS and to_crossing >= 0.0:
                time = (to_crossing - gap) / max(other["v"], HALTING)  # until that one is past
                faster = max(v, 2.0 * (to_crossing - cruise.type.min_gap) / time - v)
                a = max(a, min((faster - v) / time, crossing))
            u = min(u, a)
            if v + min(u, most) * law.dt < HALTING and yields(vehicles, cruise, i, j, kind):
                cruise.memory[i]["blocked"] = 1
    return u


@njit_inline
def yields(vehicles: Records, cruise: Cruise, i: int, j: int, kind: int) -> bool:
    """Whether vehicle i, which hardly moves inside, gives up its request to leave because of j.

    It does so for one from its own lane, and on the straightest way also for any on its exit.
    Source: `MSVehicle::checkLinkLeader`, without leaders that have stood for 5 s.
    """
    p, left = vehicles[i]["path"], cruise.memory[j]["left"] != 0
    return bool((kind == PART and not left) or (kind == JOIN and left and cruise.straightest[p]))


@njit_inner
def radar(
    vehicles: Records,
    ends: Floats,
    law: Law,
    cruise: Cruise,
    inside: Ints,
    i: int,
    part: int,
    ahead: Ahead,
) -> float:
    """Acceleration that the radar's leader asks of vehicle i on this `part` of its way [m/s²].

    Part by part of the way: the leader on it, or else the vehicle meeting it that leaves the least
    room, counting what it needs to brake.
    Source: `MSCFModel_CC::getRadarMeasurements`, `MSLane::getLeaderOnConsecutive`,
    `libsumo::Vehicle::getLeader` (where negative room becomes 0).
    """
    s, v, p = vehicles[i]["s"], vehicles[i]["v"], vehicles[i]["path"]
    for here in range(part, 2):
        if ahead.part <= here:
            return ahead.own
        shortest = math.inf
        seen = math.inf
        for j in inside:
            other = vehicles[j]
            q = other["path"]
            for k in range(2):
                kind = int(cruise.meetings[p, here, q, k, 0])
                if kind == NOWHERE or not (cruise.crossing_foes or kind == JOIN):
                    continue
                gap, _, _ = room(vehicles, ends, law, cruise, i, here, j, k)
                stops = gap + braking_distance(other["v"], cruise.type.b_max, law.dt)
                if stops >= shortest:
                    continue
                if s >= law.entry and not before(vehicles, cruise, i, j, kind):
                    continue
                shortest = stops
                if gap < 0.0 and not cruise.crossing_foes:
                    gap = max(law.entry + here * cruise.waits[p, 0] - s, 0.0)
                elif gap < 0.0:
                    gap = 0.0 if other["s"] < ends[q, 0] else math.inf
                seen = follow(v, gap, other["v"], law, cruise)
        if shortest < math.inf:
            return seen
    return ahead.tail


@njit_inline
def room(
    vehicles: Records, ends: Floats, law: Law, cruise: Cruise, i: int, part: int, j: int, k: int
) -> tuple[float, float, bool]:
    """Room between vehicle i and a vehicle j that meets its way, as if both were on one way [m].

    It is infinite where j is not on part k of its way, or does not matter (any more), and a large
    negative number where i has to wait for it anyway.
    Also the distance from i to the crossing [m], and whether j stands in the way there.
    Source: `MSLink::getLeaderInfo`.
    """
    s, p, q = vehicles[i]["s"], vehicles[i]["path"], vehicles[j]["path"]
    wait = cruise.waits[q, 0]
    begin = wait if k == 1 else 0.0
    end = wait if k == 0 else ends[q, 0] - law.entry
    driven = vehicles[j]["s"] - law.entry
    rear = driven - cruise.type.length
    if driven < begin or rear >= end:
        return math.inf, 0.0, False
    kind = int(cruise.meetings[p, part, q, k, 0])
    width, rival_width = cruise.meetings[p, part, q, k, 3], cruise.meetings[q, k, p, part, 3]
    to_end = (law.entry + cruise.waits[p, 0] if part == 0 else ends[p, 0]) - s
    to_crossing = to_end - cruise.meetings[p, part, q, k, 2]
    if to_crossing + width < 0.0 and kind != JOIN:
        return math.inf, 0.0, False
    rival_behind = cruise.meetings[q, k, p, part, 1]
    behind = end - rival_behind - rear  # of its rear, before the crossing
    past = behind + rival_width + cruise.waits[p, 1] < 0.0
    waiting = k == 0 and wait > 0.0
    in_the_way = (
        behind < cruise.type.length
        and not waiting
        and (cruise.crossing_foes or driven < end)
        and (
            (not past and to_crossing > 0.0)
            or (kind == JOIN and to_crossing > behind - cruise.type.length)
        )
    )
    if to_crossing < -law.margin and not in_the_way:
        return math.inf, 0.0, False
    unseen = cruise.memory[j]["unseen"] != 0 and driven < end and kind in (JOIN, CROSS)
    if unseen and not in_the_way:
        return math.inf, 0.0, False
    if kind == PART and s >= law.entry and driven < s - law.entry - cruise.type.length:
        return math.inf, 0.0, False
    if kind == WAIT:
        return -FAR, to_crossing, in_the_way
    if past and kind != JOIN:
        return math.inf, 0.0, False
    if kind == JOIN and behind < 0.0:
        behind += max(rival_behind - cruise.meetings[p, part, q, k, 1], 0.0)
    return to_crossing - cruise.type.min_gap - behind - rival_width, to_crossing, in_the_way


@njit_inline
def before(vehicles: Records, cruise: Cruise, i: int, j: int, kind: int) -> bool:
    """Whether j was in the junction before i, which is inside; if both at once, the faster one.

    A vehicle on a way that must yield counts as in it once past its waiting position.
    Source: `MSVehicle::isLeader`.
    """
    mine, other = cruise.memory[i], cruise.memory[j]
    if other["left"] != 0:
        return True
    p, q = vehicles[i]["path"], vehicles[j]["path"]
    me, it = mine["entered"], other["entered"]
    if kind != PART:
        if cruise.yields[p, q]:
            me = mine["merged"]
            if cruise.yields[q, p]:
                it = other["merged"]
        else:
            it = other["merged"]
    me = me if me > 0 else NEVER
    it = it if it > 0 else NEVER
    if me != it:
        return bool(it < me)
    if vehicles[i]["v"] != vehicles[j]["v"]:
        return bool(vehicles[i]["v"] < vehicles[j]["v"])
    return bool(vehicles[i]["id"] < vehicles[j]["id"])
