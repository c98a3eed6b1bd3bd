"""Vehicles under cruise control: the law of the published runs, SUMO's CC model.

Everything that is special about this law stands here: its leaders, what it remembers of each
vehicle, and how it chooses accelerations. The kernel calls `accelerate` in place of its own, and
`look` after every step. The equations are in `minisim.carfollowing`.

A vehicle obeys the hardest braking that any of its leaders asks for
(`MSVehicle::planMoveInternal`, with the model's radar). The leaders are:

- the vehicle ahead on the stretch of road that it is on (approach, way through the junction, exit);
- the last vehicle on every later stretch, from any lane and at any distance;
- a vehicle inside the junction on a way that begins or ends with its own
  (`minisim.junction.meetings`) and that was there before it, as long as there is room to the place
  where the ways meet;
- the radar's leader: where no vehicle is ahead on its own lane or way, the nearest one that will
  leave by the same exit. Where there is no room left, it counts as if it were just ahead.

A vehicle that only crosses its way is no leader. For those, SUMO asks of a vehicle no more than to
be able to stop before the crossing (`adaptToJunctionLeader`), and the CC model answers that
question with the radar's leader, whichever vehicle is meant.

One rule is left out: inside the junction SUMO's vehicles also follow one that crosses before them,
while there is room up to the crossing. `docs/fidelity.md` shows the one replay in which that was
seen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from minisim.carfollowing import (
    STANDSTILL,
    braking_distance,
    cruise_control,
    distance_control,
    engine_lag,
)
from minisim.control import Site
from minisim.engine.laws import hold
from minisim.engine.state import DRIVING, Floats, Ints, Law, Records, Road
from minisim.jit import njit, njit_inline
from minisim.junction.meetings import Meeting, meetings, sagittas
from minisim.vehicle import CruiseVehicle

#: Vehicles inside the junction at once, at most.
INSIDE = 64

NOWHERE, JOIN, PART = int(Meeting.NOWHERE), int(Meeting.JOIN), int(Meeting.PART)

#: What the law remembers of a vehicle, row by row as in `minisim.engine.state.VEHICLE`.
MEMORY = np.dtype(
    [
        ("entered", np.int64),  # tick of entering the junction
        ("left", np.int64),  # its front has left the junction
        ("stopping", np.int64),  # it was advised to stand in the step before
    ]
)


class Cruise(NamedTuple):
    """What a run of `minisim.vehicle.CruiseVehicle` needs beside `Law` (SI units).

    Attributes:
        meetings: (p, p, 2), see `minisim.junction.meetings.meetings`.
        waits: (p, 2): waiting position past the junction entry, sagitta [m].
        memory: (k,) of `MEMORY`.
        last: (n,): last row that entered the exit lane of each arm, or -1.
    """

    cruise_speed: float
    cruise_gain: float
    a: float
    b: float
    headway: float
    spacing_gain: float
    spacing: float
    lag: float
    a_max: float
    radar: float
    meetings: Floats
    waits: Floats
    memory: Records
    last: Ints


def build_cruise(site: Site, count: int) -> Cruise | None:
    """Collect what a run of `count` vehicles needs; None where they have no cruise control."""
    vehicle, intersection = site.vehicle, site.intersection
    if not isinstance(vehicle, CruiseVehicle):
        return None
    waits = [way.wait for way in intersection.ways or ()] or [0.0] * len(intersection.paths)
    return Cruise(
        cruise_speed=vehicle.cruise_speed,
        cruise_gain=vehicle.cruise_gain,
        a=vehicle.cruise_acceleration,
        b=vehicle.cruise_deceleration,
        headway=vehicle.headway,
        spacing_gain=vehicle.spacing_gain,
        spacing=vehicle.spacing,
        lag=vehicle.lag,
        a_max=vehicle.engine_acceleration,
        radar=vehicle.radar,
        meetings=meetings(intersection),
        waits=np.stack([waits, sagittas(intersection, vehicle.length)], axis=-1),
        memory=np.zeros(count, MEMORY),
        last=np.full(intersection.n, -1),
    )


@njit
def accelerate(vehicles: Records, lanes: Records, road: Road, law: Law, cruise: Cruise) -> bool:
    """Choose every vehicle's acceleration from the present state; returns whether two overlap."""
    overlap = False
    ends = road.ends
    inside = np.empty(INSIDE, np.int64)
    count = gather(vehicles, lanes, ends, law, inside)
    for lane in range(len(lanes)):
        is_open = lanes[lane]["open"] != 0
        first = lanes[lane]["first"]
        for i in range(first, lanes[lane]["next"]):
            me = vehicles[i]
            if me["status"] != DRIVING:
                continue
            s, v, p = me["s"], me["v"], me["path"]
            v0 = cruise.cruise_speed if me["advice"] == math.inf else me["advice"]
            u = cruise_control(v, v0, cruise.cruise_gain, cruise.a, cruise.b)
            nearest = math.inf
            leave = ends[p, 0]
            if s < leave:
                led = False  # whether the radar sees a vehicle on its own lane or way
                for j in range(i - 1, first - 1, -1):
                    ahead = vehicles[j]
                    if ahead["status"] != DRIVING:
                        continue
                    rear = ahead["s"] - law.length
                    on_way = ahead["path"] == p and ahead["s"] >= law.entry and rear < leave
                    on_lane = j == i - 1 and s < law.entry and rear < law.entry
                    if on_way or on_lane:
                        u = min(u, follow(v, rear - s - law.min_gap, ahead["v"], cruise))
                        nearest = min(nearest, rear - s)
                        led = True
                    if on_way:
                        break
                if count and not (led and s < law.entry) and law.entry - s <= cruise.radar:
                    u = min(u, meet(vehicles, ends, law, cruise, inside, count, i, led))
                j = cruise.last[int(ends[p, 2])]
            else:
                j = me["ahead"]
            if j >= 0 and vehicles[j]["status"] == DRIVING:
                ahead = vehicles[j]
                rear = ahead["s"] - law.length - ends[ahead["path"], 0]
                gap = rear - (s - leave)
                # One beside it, still on another way, is left to the radar (`adaptToLeader`).
                beside = s < leave and gap < law.min_gap and rear < 0.0 and ahead["path"] != p
                if not beside:
                    u = min(u, follow(v, gap - law.min_gap, ahead["v"], cruise))
                if s >= leave:
                    nearest = min(nearest, gap)
            overlap |= nearest <= 0.0
            stopping = cruise.memory[i]["stopping"] != 0
            a = realise(v, me["a"], u, stopping, law, cruise)
            a = min(a, max(me["brake"], -v / law.dt))
            cruise.memory[i]["stopping"] = v0 == 0.0
            if not is_open and me["go"] == 0 and s < law.entry:
                a = max(min(a, hold(v, s, law)), -law.b_max)
            me["a"] = a
    return overlap


@njit
def look(vehicles: Records, lanes: Records, road: Road, cruise: Cruise, tick: int) -> None:
    """Note after a step which vehicles have entered the junction, and which an exit lane.

    The vehicle ahead on an exit lane is the one that entered that lane before.
    """
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            mine = cruise.memory[i]
            if i < lanes[lane]["front"] and mine["entered"] == 0:
                mine["entered"] = tick
            p = vehicles[i]["path"]
            if mine["left"] == 0 and vehicles[i]["s"] >= road.ends[p, 0]:
                mine["left"] = 1
                exit_arm = int(road.ends[p, 2])
                vehicles[i]["ahead"] = cruise.last[exit_arm]
                cruise.last[exit_arm] = i


@njit
def gather(vehicles: Records, lanes: Records, ends: Floats, law: Law, inside: Ints) -> int:
    """Fill `inside` with the rows of vehicles at least partly in the junction; their number."""
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
    cruise: Cruise,
    inside: Ints,
    count: int,
    i: int,
    led: bool,
) -> float:
    """Acceleration that vehicles inside the junction on other ways ask of vehicle i [m/s²].

    Source: `MSLink::getLeaderInfo`, `MSVehicle::adaptToJunctionLeader`,
    `MSLane::getLeaderOnConsecutive`, `MSVehicle::isLeader`.
    """
    meetings, waits = cruise.meetings, cruise.waits
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
        if to_meeting < -law.margin and not in_the_way:
            continue
        if kind == PART and not approaching and driven < s - law.entry - law.length:
            continue
        if past and kind != JOIN:
            continue
        leads = approaching or before(vehicles, cruise, i, j)
        if not leads and not in_the_way:
            continue
        if kind == JOIN and behind < 0.0:
            behind += max(meetings[q, p, 1] - meetings[p, q, 1], 0.0)
        gap = to_meeting - law.min_gap - behind
        stops = gap + braking_distance(other["v"], law.b_max, law.dt)  # if the other brakes hard
        if kind == JOIN and leads and not led and stops < shortest:
            shortest = stops
            to_part = law.entry + waits[p, 0] - s  # of its way that the other can meet
            shown = follow(v, gap if gap >= 0.0 else max(to_part, 0.0), other["v"], cruise)
        if not approaching and gap >= 0.0:
            u = min(u, follow(v, gap, other["v"], cruise))
    return min(u, shown)


@njit_inline
def before(vehicles: Records, cruise: Cruise, i: int, j: int) -> bool:
    """Whether j entered the junction before i; if both at once, the faster, then the later row."""
    mine, other = cruise.memory[i]["entered"], cruise.memory[j]["entered"]
    if mine != other:
        return bool(other < mine)
    if vehicles[i]["v"] != vehicles[j]["v"]:
        return bool(vehicles[i]["v"] < vehicles[j]["v"])
    return bool(vehicles[i]["id"] < vehicles[j]["id"])


@njit_inline
def follow(v: float, gap: float, v_leader: float, cruise: Cruise) -> float:
    """Acceleration that the ACC asks for behind a leader [m/s²]; infinite beyond the radar."""
    if gap > cruise.radar:
        return math.inf
    return distance_control(v, gap, v_leader, cruise.headway, cruise.spacing_gain, cruise.spacing)


@njit_inline
def realise(v: float, a: float, u: float, stopping: bool, law: Law, cruise: Cruise) -> float:
    """Acceleration of this step: the engine's answer to `u`, which never goes below standstill.

    From the step after a desired speed of 0 on, SUMO asks for standstill within one step.
    """
    u = -v / law.dt if stopping else max(u, -v / law.dt)
    a = max(min(engine_lag(a, u, cruise.lag, law.dt), cruise.a_max), -law.b_max)
    return -v / law.dt if v + a * law.dt < STANDSTILL * law.dt else a
