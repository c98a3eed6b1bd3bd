"""How vehicles with an engine choose their acceleration: SUMO's CC model with SUMO's leaders.

The law is in `minisim.carfollowing`; here is whom it follows. A vehicle obeys the hardest braking
that any of its leaders asks for (`MSVehicle::planMoveInternal`, with the model's radar):

- the vehicle ahead on the stretch of road that it is on (approach, way through the junction, exit);
- the last vehicle on every later stretch, wherever that one came from and however far it is;
- who is inside the junction on a way that begins or ends with its own (`minisim.junction.meetings`)
  and was there before it, as long as there is room to the place where the ways meet;
- the radar's leader: for those without anybody ahead on their own lane or way, the nearest who
  will leave by the same exit, as if just ahead where there is no room any more.

Who only crosses its way is no leader: for those SUMO asks of a vehicle no more than to be able to
stop before the crossing (`adaptToJunctionLeader`), and the CC model answers that question with the
radar's leader, whoever is meant.

One rule is left out: inside the junction SUMO's vehicles also follow who crosses before them, while
there is room up to the crossing. `docs/fidelity.md` shows the one replay in which that was seen.
"""

from __future__ import annotations

import math

import numpy as np

from minisim.carfollowing import (
    STANDSTILL,
    braking_distance,
    cruise_control,
    distance_control,
    engine_lag,
)
from minisim.engine.state import DRIVING, POSITION_EPS, Engine, Floats, Ints, Law, Records, Road
from minisim.jit import njit, njit_inline
from minisim.junction.meetings import Meeting

#: Vehicles inside the junction at once, at most.
INSIDE = 64

NOWHERE, JOIN, PART = int(Meeting.NOWHERE), int(Meeting.JOIN), int(Meeting.PART)


@njit
def accelerate_engines(
    vehicles: Records, lanes: Records, road: Road, law: Law, engine: Engine
) -> bool:
    """Choose every vehicle's acceleration from the present state; whether two overlap."""
    overlap = False
    ends = road.ends
    inside = np.empty(INSIDE, np.int64)
    count = gather(vehicles, lanes, ends, law, inside)
    for lane in range(len(lanes)):
        first = lanes[lane]["first"]
        for i in range(first, lanes[lane]["next"]):
            me = vehicles[i]
            if me["status"] != DRIVING:
                continue
            s, v, p = me["s"], me["v"], me["path"]
            v0 = engine.cruise_speed if me["advice"] == math.inf else me["advice"]
            u = cruise_control(v, v0, engine.cruise_gain, engine.a, engine.b)
            nearest = math.inf
            leave = ends[p, 0]
            if s < leave:
                led = False  # whether the radar sees somebody on its own lane or way
                for j in range(i - 1, first - 1, -1):
                    ahead = vehicles[j]
                    if ahead["status"] != DRIVING:
                        continue
                    rear = ahead["s"] - law.length
                    on_way = ahead["path"] == p and ahead["s"] >= law.entry and rear < leave
                    on_lane = j == i - 1 and s < law.entry and rear < law.entry
                    if on_way or on_lane:
                        u = min(u, follow(v, rear - s - law.min_gap, ahead["v"], engine))
                        nearest = min(nearest, rear - s)
                        led = True
                    if on_way:
                        break
                if count and not (led and s < law.entry) and law.entry - s <= engine.radar:
                    u = min(u, meet(vehicles, ends, law, engine, inside, count, i, led))
                j = lanes[int(ends[p, 2])]["tail"]
            else:
                j = me["ahead"]
            if j >= 0 and vehicles[j]["status"] == DRIVING:
                ahead = vehicles[j]
                rear = ahead["s"] - law.length - ends[ahead["path"], 0]
                gap = rear - (s - leave)
                # Who is beside it, on another way still, is left to the radar (`adaptToLeader`).
                beside = s < leave and gap < law.min_gap and rear < 0.0 and ahead["path"] != p
                if not beside:
                    u = min(u, follow(v, gap - law.min_gap, ahead["v"], engine))
                if s >= leave:
                    nearest = min(nearest, gap)
            overlap |= nearest <= 0.0
            a = realise(v, me["a"], u, me["stopping"] != 0, law, engine)
            me["a"] = min(a, max(me["brake"], -v / law.dt))
            me["stopping"] = v0 == 0.0
    return overlap


@njit
def gather(vehicles: Records, lanes: Records, ends: Floats, law: Law, inside: Ints) -> int:
    """Fill `inside` with the rows of all vehicles with some part in the junction; their number."""
    count = 0
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            s, p = vehicles[i]["s"], vehicles[i]["path"]
            if s < law.entry:
                break
            if (
                vehicles[i]["status"] == DRIVING
                and s - law.length < ends[p, 0]
                and count < len(inside)
            ):
                inside[count] = i
                count += 1
    return count


@njit
def meet(
    vehicles: Records,
    ends: Floats,
    law: Law,
    engine: Engine,
    inside: Ints,
    count: int,
    i: int,
    led: bool,
) -> float:
    """Acceleration that those inside the junction on other ways ask vehicle i for [m/s²].

    Source: `MSLink::getLeaderInfo`, `MSVehicle::adaptToJunctionLeader`,
    `MSLane::getLeaderOnConsecutive`, `MSVehicle::isLeader`.
    """
    meetings, waits = engine.meetings, engine.waits
    s, v, p = vehicles[i]["s"], vehicles[i]["v"], vehicles[i]["path"]
    to_exit = ends[p, 0] - s
    approaching = s < law.entry
    u = shown = shortest = math.inf  # shown: what the radar's leader asks for
    for k in range(count):
        j = inside[k]
        other = vehicles[j]
        q = other["path"]
        kind = int(meetings[p, q, 0])
        if kind == NOWHERE or (approaching and kind != JOIN):
            continue
        wait = waits[q, 0]
        driven = other["s"] - law.entry
        if kind == PART:
            if wait > 0.0 and driven - law.length >= wait:
                continue
        elif driven < wait:
            continue  # not yet on the part that others can meet
        to_meeting = to_exit - meetings[p, q, 1]
        if to_meeting < 0.0 and kind != JOIN:
            continue
        behind = ends[q, 0] - law.entry - meetings[q, p, 1] - (driven - law.length)
        past = behind + waits[p, 1] < 0.0
        leaves = wait if kind == PART and wait > 0.0 else ends[q, 0] - law.entry
        in_the_way = (
            behind < law.length
            and driven < leaves
            and (
                (not past and to_meeting > 0.0)
                or (kind == JOIN and to_meeting > behind - law.length)
            )
        )
        if to_meeting < -POSITION_EPS and not in_the_way:
            continue
        if kind == PART and not approaching and driven < s - law.entry - law.length:
            continue
        if past and kind != JOIN:
            continue
        leads = approaching or before(vehicles, i, j)
        if not leads and not in_the_way:
            continue
        if kind == JOIN and behind < 0.0:
            behind += max(meetings[q, p, 1] - meetings[p, q, 1], 0.0)
        gap = to_meeting - law.min_gap - behind
        stops = gap + braking_distance(other["v"], law.b_max, law.dt)  # if the other brakes hard
        if kind == JOIN and leads and not led and stops < shortest:
            shortest = stops
            to_part = law.entry + waits[p, 0] - s  # of its way that the other can meet
            shown = follow(v, gap if gap >= 0.0 else max(to_part, 0.0), other["v"], engine)
        if not approaching and gap >= 0.0:
            u = min(u, follow(v, gap, other["v"], engine))
    return min(u, shown)


@njit_inline
def before(vehicles: Records, i: int, j: int) -> bool:
    """Whether j entered the junction before i; of two at once the faster, then the later row."""
    mine, other = vehicles[i]["entered"], vehicles[j]["entered"]
    if mine != other:
        return bool(other < mine)
    if vehicles[i]["v"] != vehicles[j]["v"]:
        return bool(vehicles[i]["v"] < vehicles[j]["v"])
    return bool(vehicles[i]["id"] < vehicles[j]["id"])


@njit_inline
def follow(v: float, gap: float, v_leader: float, engine: Engine) -> float:
    """Acceleration that the ACC asks for behind a leader [m/s²]; none beyond the radar."""
    if gap > engine.radar:
        return math.inf
    return distance_control(v, gap, v_leader, engine.headway, engine.spacing_gain, engine.spacing)


@njit_inline
def realise(v: float, a: float, u: float, stopping: bool, law: Law, engine: Engine) -> float:
    """Acceleration of this step: the engine's answer to `u`, no further than standstill.

    A desired speed of 0 makes SUMO ask, from the next step on, for standstill within one step.
    """
    u = -v / law.dt if stopping else max(u, -v / law.dt)
    a = max(min(engine_lag(a, u, engine.lag, law.dt), engine.a_max), -law.b_max)
    return -v / law.dt if v + a * law.dt < STANDSTILL * law.dt else a
