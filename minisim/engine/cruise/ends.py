"""What happens at the ends of the roads: the order on an exit lane, and SUMO's rules there."""

from __future__ import annotations

from minisim.carfollowing import braking_distance
from minisim.engine.cruise.law import Cruise
from minisim.engine.state import ARRIVED, DRIVING, Layout, Records
from minisim.jit import njit_inner
from minisim.laws import PAST_THE_END, Law

#: Length of the turnarounds at the far ends of the published roads [m].
TURNAROUND = 4.67

#: Time headway that SUMO leaves a vehicle behind another that is inserted (`tau`'s default) [s].
REACTION = 1.0

#: SUMO's `NUMERICAL_EPS` [m].
TOLERANCE = 0.001


@njit_inner
def blocked(vehicles: Records, layout: Layout, law: Law, cruise: Cruise, arm: int) -> bool:
    """Whether a vehicle arriving on an arm keeps others from being inserted there.

    Where the road leads back, SUMO assumes that the vehicle at its end might turn, and keeps room
    for it to stop. Source: `MSLane::isInsertionSuccess`, `MSCFModel::getSecureGap`.
    """
    i = cruise.last[arm]
    if i < 0 or not cruise.turns_back[arm] or vehicles[i]["status"] != DRIVING:
        return False
    while vehicles[i]["ahead"] >= 0 and vehicles[vehicles[i]["ahead"]]["status"] == DRIVING:
        i = vehicles[i]["ahead"]
    first = vehicles[i]
    rest = layout.ends[first["path"], 1] - first["s"]
    needed = braking_distance(first["v"], cruise.type.b_max, law.dt) + REACTION * first["v"]
    return bool(rest + TURNAROUND + law.margin - cruise.type.min_gap < needed)


@njit_inner
def look(
    vehicles: Records, lanes: Records, layout: Layout, law: Law, cruise: Cruise, tick: int
) -> bool:
    """Note after a step which vehicles have entered the junction or an exit lane.

    The vehicle ahead on an exit lane is the one that entered that lane before.

    Returns whether a vehicle was taken off the road.
    """
    lost = False
    for lane in range(len(lanes)):
        for i in range(lanes[lane]["first"], lanes[lane]["next"]):
            mine = cruise.memory[i]
            if mine["at_red"] != 0:  # SUMO puts it on the line (`MSVehicle::processLaneAdvances`)
                vehicles[i]["s"] = law.entry - PAST_THE_END
                vehicles[i]["a"] = 0.0
                mine["at_red"] = 0
            if i < lanes[lane]["front"] and mine["entered"] == 0:
                mine["entered"] = tick
            p = vehicles[i]["path"]
            if mine["merged"] == 0 and vehicles[i]["s"] >= law.entry + cruise.waits[p, 0]:
                mine["merged"] = tick
            if mine["left"] == 0 and vehicles[i]["s"] >= layout.ends[p, 0]:
                mine["left"] = 1
                exit_arm = int(layout.ends[p, 2])
                vehicles[i]["ahead"] = cruise.last[exit_arm]
                cruise.last[exit_arm] = i
            if cruise.teleports and mine["left"] != 0 and vehicles[i]["status"] == DRIVING:
                lost |= teleport(vehicles, layout, cruise, i, tick)
    return lost


@njit_inner
def teleport(vehicles: Records, layout: Layout, cruise: Cruise, i: int, tick: int) -> bool:
    """Remove a vehicle that has run into the one ahead on its exit; return whether it has.

    SUMO's default answer to a collision. It counts as one if the gap is less than `min_gap`.
    Source: `MSLane::detectCollisionBetween`; `MSVehicleTransfer`, which finds no road behind.
    """
    j = vehicles[i]["ahead"]
    if j < 0 or vehicles[j]["status"] != DRIVING:
        return False
    ends = layout.ends
    rear = vehicles[j]["s"] - cruise.type.length - ends[vehicles[j]["path"], 0]
    if rear - (vehicles[i]["s"] - ends[vehicles[i]["path"], 0]) >= cruise.type.min_gap - TOLERANCE:
        return False
    vehicles[i]["status"] = ARRIVED
    vehicles[i]["arrival_tick"] = tick
    vehicles[i]["cleared"] = 1
    for k in range(len(vehicles)):  # those behind it follow the one ahead of it
        if vehicles[k]["ahead"] == i:
            vehicles[k]["ahead"] = j
    arm = int(ends[vehicles[i]["path"], 2])
    if cruise.last[arm] == i:
        cruise.last[arm] = j
    return True
