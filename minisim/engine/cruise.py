"""Vehicles under cruise control: the law of the published runs, SUMO's CC model.

Everything special about this law is in this module: its leaders, what it remembers of each vehicle
and how it chooses accelerations. The kernel calls `accelerate` in place of its own, and `look`
after every step. The equations are in `minisim.carfollowing`.

A vehicle obeys the hardest braking that any of its leaders asks for
(`MSVehicle::planMoveInternal`, with the model's radar). The leaders are:

- the vehicle ahead on its own stretch of road (approach, way through the junction, exit);
- the last vehicle on every later stretch, from any lane and at any distance;
- vehicles inside the junction whose ways meet its own (`minisim.junction.meetings`), once it is
  inside too: those that were there before it, or that stand in the way (`meet`);
- the radar's leader: the first vehicle on its own lane, way or exit; but a vehicle inside the
  junction that meets its way comes before those on stretches behind (`radar`).

What the radar sees is SUMO's one quirk that its versions differ in, and the published runs depend
on it (`CruiseVehicle.sumo`). In 1.18 it also sees vehicles that only cross, those from its own lane
that turn off elsewhere, and those that wait inside the junction with priority; one with no room
left counts as if bumper to bumper. Since then it sees only those bound for the same exit, and where
there is no room left they are at the beginning of the part of the way that others can meet.
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
from minisim.engine.state import ARRIVED, DRIVING, NEVER, Floats, Ints, Law, Records, Road
from minisim.jit import njit, njit_inline
from minisim.junction.geometry import Intersection
from minisim.junction.meetings import Bools, Meeting, meetings, right_of_way, sagittas
from minisim.vehicle import CruiseVehicle

#: The most vehicles inside the junction at once.
INSIDE = 64

NOWHERE, JOIN, PART = int(Meeting.NOWHERE), int(Meeting.JOIN), int(Meeting.PART)
CROSS, WAIT = int(Meeting.CROSS), int(Meeting.WAIT)

#: SUMO's speed below which a vehicle halts (`SUMO_const_haltingSpeed`) [m/s].
HALTING = 0.1

#: Length of the turnarounds at the far ends of the published roads [m].
TURNAROUND = 4.67

#: Time headway that SUMO leaves a vehicle behind another that is inserted (`tau`'s default) [s].
REACTION = 1.0

#: SUMO's `NUMERICAL_EPS` [m].
TOLERANCE = 0.001

#: More than any gap [m].
FAR = 1e9

#: What the law remembers of a vehicle, row by row as in `minisim.engine.state.VEHICLE`.
MEMORY = np.dtype(
    [
        ("entered", np.int64),  # tick of entering the junction
        ("merged", np.int64),  # tick of passing the waiting position, if there is one
        ("left", np.int64),  # its front has left the junction
        ("stopping", np.int64),  # it was advised to stand still in the previous step
    ]
)


class Cruise(NamedTuple):
    """What a run of `minisim.vehicle.CruiseVehicle` needs besides `Law` (SI units).

    Attributes:
        teleports: whether a vehicle that runs into another on its exit is taken off the road.
        crossing_foes: whether the radar sees vehicles that only cross.
        meetings: (p, 2, p, 2, 4), see `minisim.junction.meetings.meetings`.
        waits: (p, 2): waiting position past the junction entry, sagitta [m].
        yields: (p, p): whether the first way must give way to the second.
        turns_back: (n,): whether the road of an arm leads back at its far end.
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
    max_speed: float
    teleports: bool
    crossing_foes: bool
    meetings: Floats
    waits: Floats
    yields: Bools
    turns_back: Bools
    memory: Records
    last: Ints


def build_cruise(site: Site, count: int, teleports: bool) -> Cruise | None:
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
        max_speed=vehicle.max_speed,
        teleports=teleports,
        crossing_foes=vehicle.sumo == "1.18",
        meetings=meetings(intersection),
        waits=np.stack([waits, sagittas(intersection, vehicle.length)], axis=-1),
        yields=_yields(intersection),
        turns_back=_turns_back(intersection),
        memory=np.zeros(count, MEMORY),
        last=np.full(intersection.n, -1),
    )


def _yields(intersection: Intersection) -> Bools:
    """Whether a way must give way to another (`MSVehicle::isLeader`); a road's priority decides."""
    rights = right_of_way(intersection)
    major, other = rights.major[:, None], rights.major[None, :]
    return np.where(major == other, rights.yields, ~major)


def _turns_back(intersection: Intersection) -> Bools:
    ways = zip(intersection.paths, intersection.ways or (), strict=False)
    arms = {path.exit_arm for path, way in ways if way.turns_back}
    return np.array([arm in arms for arm in range(intersection.n)])


@njit
def blocked(vehicles: Records, road: Road, law: Law, cruise: Cruise, arm: int) -> bool:
    """Whether no vehicle can be inserted on an arm for one that arrives there.

    Where the road leads back, SUMO takes it that the vehicle at its end might do so, and keeps room
    for it to stop. Source: `MSLane::isInsertionSuccess`, `MSCFModel::getSecureGap`.
    """
    i = cruise.last[arm]
    if i < 0 or not cruise.turns_back[arm] or vehicles[i]["status"] != DRIVING:
        return False
    while vehicles[i]["ahead"] >= 0 and vehicles[vehicles[i]["ahead"]]["status"] == DRIVING:
        i = vehicles[i]["ahead"]
    first = vehicles[i]
    rest = road.ends[first["path"], 1] - first["s"]
    needed = braking_distance(first["v"], law.b_max, law.dt) + REACTION * first["v"]
    return bool(rest + TURNAROUND + law.margin - law.min_gap < needed)


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
            led = math.inf  # what the leader on its own lane or way asks for
            behind = 2  # the part of its way on which that is; -1 is its own lane, 2 no leader
            if s < leave:
                u = min(u, (cruise.max_speed - v) / law.dt)
                wait = law.entry + cruise.waits[p, 0]
                for j in range(i - 1, first - 1, -1):
                    ahead = vehicles[j]
                    if ahead["status"] != DRIVING:
                        continue
                    rear = ahead["s"] - law.length
                    on_way = ahead["path"] == p and ahead["s"] >= law.entry and rear < leave
                    on_lane = j == i - 1 and s < law.entry and rear < law.entry
                    if on_way or on_lane:
                        asked = follow(v, rear - s - law.min_gap, ahead["v"], cruise)
                        u = min(u, asked)
                        nearest = min(nearest, rear - s)
                        if behind == 2:
                            led = asked
                            behind = -1 if on_lane else (1 if rear >= wait else 0)
                    if on_way and ahead["s"] >= wait:
                        break
                j = cruise.last[int(ends[p, 2])]
            else:
                j = me["ahead"]
            tail = math.inf
            if j >= 0 and vehicles[j]["status"] == DRIVING:
                ahead = vehicles[j]
                rear = ahead["s"] - law.length - ends[ahead["path"], 0]
                gap = rear - (s - leave)
                # A vehicle beside it on another way is left to the radar (`adaptToLeader`).
                beside = s < leave and gap < law.min_gap and rear < 0.0 and ahead["path"] != p
                if not beside:
                    tail = follow(v, gap - law.min_gap, ahead["v"], cruise)
                    u = min(u, tail)
                if s >= leave:
                    nearest = min(nearest, gap)
            near = law.entry - s <= cruise.radar and s < leave
            if count and near and (behind >= 0 or s >= law.entry):
                u = min(u, meet(vehicles, ends, law, cruise, inside, count, i, led, behind, tail))
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
def look(
    vehicles: Records, lanes: Records, road: Road, law: Law, cruise: Cruise, tick: int
) -> bool:
    """Note after a step which vehicles have entered the junction, and which an exit lane.

    The vehicle ahead on an exit lane is the one that entered that lane before.

    Returns whether a vehicle was taken off the road.
    """
    lost = False
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            mine = cruise.memory[i]
            if i < lanes[lane]["front"] and mine["entered"] == 0:
                mine["entered"] = tick
            p = vehicles[i]["path"]
            if mine["merged"] == 0 and vehicles[i]["s"] >= law.entry + cruise.waits[p, 0]:
                mine["merged"] = tick
            if mine["left"] == 0 and vehicles[i]["s"] >= road.ends[p, 0]:
                mine["left"] = 1
                exit_arm = int(road.ends[p, 2])
                vehicles[i]["ahead"] = cruise.last[exit_arm]
                cruise.last[exit_arm] = i
            if cruise.teleports and mine["left"] != 0 and vehicles[i]["status"] == DRIVING:
                lost |= teleport(vehicles, road, law, cruise, i, tick)
    return lost


@njit
def teleport(vehicles: Records, road: Road, law: Law, cruise: Cruise, i: int, tick: int) -> bool:
    """Take a vehicle off the road that has run into the one ahead on its exit; whether it has.

    SUMO's default answer to a collision. It counts as one if the gap is less than `min_gap`.
    Source: `MSLane::detectCollisionBetween`; `MSVehicleTransfer`, which finds no road behind.
    """
    j = vehicles[i]["ahead"]
    if j < 0 or vehicles[j]["status"] != DRIVING:
        return False
    ends = road.ends
    rear = vehicles[j]["s"] - law.length - ends[vehicles[j]["path"], 0]
    if rear - (vehicles[i]["s"] - ends[vehicles[i]["path"], 0]) >= law.min_gap - TOLERANCE:
        return False
    vehicles[i]["status"] = ARRIVED
    vehicles[i]["arrival_tick"] = tick
    vehicles[i]["cleared"] = 1
    for k in range(len(vehicles)):  # those behind it follow the one before it
        if vehicles[k]["ahead"] == i:
            vehicles[k]["ahead"] = j
    arm = int(ends[vehicles[i]["path"], 2])
    if cruise.last[arm] == i:
        cruise.last[arm] = j
    return True


@njit
def gather(vehicles: Records, lanes: Records, ends: Floats, law: Law, inside: Ints) -> int:
    """Fill `inside` with the rows of vehicles at least partly in the junction; returns how many."""
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
    led: float,
    behind: int,
    tail: float,
) -> float:
    """Acceleration that vehicles inside the junction on other ways ask of vehicle i [m/s²].

    A vehicle that has yet to enter may drive up to the junction (`MSVehicle::checkLinkLeader`), so
    only its radar counts. Inside it follows those that meet the part of the way that it is on; for
    a vehicle that only crosses it may also speed up so far that it comes after that one
    (`MSVehicle::adaptToJunctionLeader`).

    Args:
        led: what the leader on its own lane or way asks for; infinite without one.
        behind: the part of the way on which that leader is, -1 its own lane, 2 no leader.
        tail: what the last vehicle on its exit asks for.
    """
    s, v, p = vehicles[i]["s"], vehicles[i]["v"], vehicles[i]["path"]
    wait = cruise.waits[p, 0]
    part = 0 if wait > 0.0 and s < law.entry + wait else 1  # the next, or the one that it is on
    seen = radar(vehicles, ends, law, cruise, inside, count, i, part, led, behind, tail)
    u = seen
    if s < law.entry:
        return u
    for n in range(count):
        j = inside[n]
        other = vehicles[j]
        q = other["path"]
        for k in range(2):
            kind = int(cruise.meetings[p, part, q, k, 0])
            if kind == NOWHERE:
                continue
            gap, to_crossing, in_the_way = room(vehicles, ends, law, cruise, i, part, j, k)
            if gap == math.inf or not (in_the_way or before(vehicles, cruise, i, j, kind)):
                continue
            a = follow(v, gap, other["v"], cruise) if gap >= 0.0 else seen
            if kind == WAIT:
                a = seen
            elif kind == CROSS and to_crossing >= 0.0:
                time = (to_crossing - gap) / max(other["v"], HALTING)  # until that one is past
                faster = max(v, 2.0 * (to_crossing - law.min_gap) / time - v)
                a = max(a, min((faster - v) / time, seen))
            u = min(u, a)
    return u


@njit
def radar(
    vehicles: Records,
    ends: Floats,
    law: Law,
    cruise: Cruise,
    inside: Ints,
    count: int,
    i: int,
    part: int,
    led: float,
    behind: int,
    tail: float,
) -> float:
    """Acceleration that the radar's leader asks of vehicle i [m/s²]; for the arguments see `meet`.

    Part by part of the way: the leader on it, then the one of those that meet it behind whom there
    is the least room, counting what they need to brake.
    Source: `MSCFModel_CC::getRadarMeasurements`, `MSLane::getLeaderOnConsecutive`,
    `libsumo::Vehicle::getLeader` (where what is less than no room becomes none).
    """
    s, v, p = vehicles[i]["s"], vehicles[i]["v"], vehicles[i]["path"]
    for here in range(part, 2):
        if behind <= here:
            return led
        shortest = math.inf
        seen = math.inf
        for n in range(count):
            j = inside[n]
            other = vehicles[j]
            q = other["path"]
            for k in range(2):
                kind = int(cruise.meetings[p, here, q, k, 0])
                if kind == NOWHERE or not (cruise.crossing_foes or kind == JOIN):
                    continue
                gap, _, _ = room(vehicles, ends, law, cruise, i, here, j, k)
                stops = gap + braking_distance(other["v"], law.b_max, law.dt)
                if stops >= shortest:
                    continue
                if s >= law.entry and not before(vehicles, cruise, i, j, kind):
                    continue
                shortest = stops
                if gap < 0.0 and not cruise.crossing_foes:
                    gap = max(law.entry + here * cruise.waits[p, 0] - s, 0.0)
                elif gap < 0.0:
                    gap = 0.0 if other["s"] < ends[q, 0] else math.inf
                seen = follow(v, gap, other["v"], cruise)
        if shortest < math.inf:
            return seen
    return tail


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
    rear = driven - law.length
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
        behind < law.length
        and not waiting
        and (cruise.crossing_foes or driven < end)
        and (
            (not past and to_crossing > 0.0) or (kind == JOIN and to_crossing > behind - law.length)
        )
    )
    if to_crossing < -law.margin and not in_the_way:
        return math.inf, 0.0, False
    if kind == PART and s >= law.entry and driven < s - law.entry - law.length:
        return math.inf, 0.0, False
    if kind == WAIT:
        return -FAR, to_crossing, in_the_way
    if past and kind != JOIN:
        return math.inf, 0.0, False
    if kind == JOIN and behind < 0.0:
        behind += max(rival_behind - cruise.meetings[p, part, q, k, 1], 0.0)
    return to_crossing - law.min_gap - behind - rival_width, to_crossing, in_the_way


@njit_inline
def before(vehicles: Records, cruise: Cruise, i: int, j: int, kind: int) -> bool:
    """Whether j was in the junction before i, which is inside; if both at once, the faster one.

    What counts as being in it, is for the way that must yield to have passed its waiting position.
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


@njit_inline
def follow(v: float, gap: float, v_leader: float, cruise: Cruise) -> float:
    """Acceleration that the ACC asks for behind a leader [m/s²]; infinite beyond the radar."""
    if gap > cruise.radar:
        return math.inf
    return distance_control(v, gap, v_leader, cruise.headway, cruise.spacing_gain, cruise.spacing)


@njit_inline
def realise(v: float, a: float, u: float, stopping: bool, law: Law, cruise: Cruise) -> float:
    """Acceleration of this step: the engine's answer to `u`, never taking the speed below zero.

    Starting one step after a desired speed of 0, SUMO asks for standstill within one step.
    """
    u = -v / law.dt if stopping else max(u, -v / law.dt)
    a = max(min(engine_lag(a, u, cruise.lag, law.dt), cruise.a_max), -law.b_max)
    return -v / law.dt if v + a * law.dt < STANDSTILL * law.dt else a
