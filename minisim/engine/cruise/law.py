"""The data of a run under SUMO's CC model, and its law as the engine carries it out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from minisim.carfollowing import STANDSTILL, distance_control, engine_lag, safe_speed
from minisim.control import Site
from minisim.engine.state import Floats, Ints, Layout, Records
from minisim.jit import njit_inline, njit_inner
from minisim.junction.geometry import Intersection
from minisim.junction.meetings import Bools, meetings, right_of_way, sagittas
from minisim.laws import KRAUSS, Law, Traits, traits_of
from minisim.vehicle import CruiseVehicle

#: What the law remembers of a vehicle, row by row as in `minisim.engine.state.VEHICLE`.
MEMORY = np.dtype(
    [
        ("entered", np.int64),  # tick of entering the junction
        ("merged", np.int64),  # tick of passing the waiting position, if there is one
        ("left", np.int64),  # its front has left the junction
        ("at_red", np.int64),  # it would have run a red light and stops dead
        ("fastest", np.float64),  # its top speed as set in the previous step, see `FASTEST` [m/s]
        ("blocked", np.int64),  # inside the junction, behind another, and hardly moving
        ("unseen", np.int64),  # it was so in the previous step
    ]
)


#: SUMO's default `desiredMaxSpeed` (`SUMOVTypeParameter`), 10000 km/h [m/s]. CC makes its desired
#: speed a factor on the limit (`MSCFModel_CC::finalizeSpeed`); from the next step on this speed
#: times that factor is the top speed (`MSBaseVehicle::getDesiredMaxSpeed`). So one that desires
#: nearly 0 must slow down at once.
FASTEST = 10000.0 / 3.6

#: The most vehicles inside the junction that others look at.
INSIDE = 64


class Cruise(NamedTuple):
    """What a run of `minisim.vehicle.CruiseVehicle` needs besides `Law` (SI units).

    Attributes:
        teleports: whether a vehicle that runs into another on its exit is taken off the road.
        obeys: whether vehicles keep to limits and lights (`CruiseVehicle.obeys`).
        crossing_foes: whether the radar sees vehicles that only cross.
        meetings: (p, 2, p, 2, 4), see `minisim.junction.meetings.meetings`.
        waits: (p, 2): waiting position past the junction entry, sagitta [m].
        yields: (p, p): whether the first way must give way to the second.
        turns_back: (n,): whether the road of an arm leads back at its far end.
        straightest: (p,): whether a way is the straightest one onto its exit.
        memory: (k,) of `MEMORY`.
        type: the only type of the vehicles.
        last: (n,): last row that entered the exit lane of each arm, or -1.
        inside: (INSIDE,): scratch space for the rows of the vehicles inside the junction.
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
    obeys: bool
    crossing_foes: bool
    meetings: Floats
    waits: Floats
    yields: Bools
    turns_back: Bools
    straightest: Bools
    memory: Records
    type: Traits
    last: Ints
    inside: Ints


def build_cruise(site: Site, count: int, teleports: bool = False) -> Cruise | None:
    """Collect what a run of `count` vehicles needs; None where they do not drive like SUMO's."""
    vehicle, intersection = site.vehicle, site.intersection
    if vehicle.sumo is None:
        return None
    looks_out = vehicle.looks_out
    if not isinstance(vehicle, CruiseVehicle):
        vehicle = CruiseVehicle()  # without effect under any other law
    waits = [way.wait for way in intersection.ways or ()] or [0.0] * len(intersection.paths)
    memory = np.zeros(count, MEMORY)
    memory["fastest"] = FASTEST
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
        obeys=vehicle.obeys,
        crossing_foes=looks_out,
        meetings=meetings(intersection),
        waits=np.stack([waits, sagittas(intersection, site.vehicle.length)], axis=-1),
        yields=_yields(intersection),
        turns_back=_turns_back(intersection),
        straightest=_straightest(intersection),
        memory=memory,
        type=traits_of(site.vehicle),
        last=np.full(intersection.n, -1),
        inside=np.zeros(INSIDE, np.int64),
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


def _straightest(intersection: Intersection) -> Bools:
    """Whether a way bends least of those onto its exit (`MSLane::getLogicalPredecessorLane`)."""
    bends = np.array([abs(path.turn) for path in intersection.paths])
    exits = intersection.movements.exits
    return np.array([bends[exits == exits[p]].min() == bends[p] for p in range(len(bends))])


@njit_inline
def follow(v: float, gap: float, v_leader: float, law: Law, cruise: Cruise) -> float:
    """Acceleration that a leader asks for [m/s²]; under the ACC infinite beyond the radar.

    The gap is measured beyond `min_gap`.
    """
    if law.model == KRAUSS:
        return (safe_speed(gap, v_leader, cruise.type.b, cruise.type.headway, law.dt) - v) / law.dt
    if gap > cruise.radar:
        return math.inf
    return distance_control(v, gap, v_leader, cruise.headway, cruise.spacing_gain, cruise.spacing)


@njit_inner
def allowed(
    s: float, v: float, p: int, v0: float, layout: Layout, law: Law, cruise: Cruise
) -> float:
    """The speed that a vehicle which obeys limits may drive [m/s].

    It takes its desired speed for a factor on the limit where it was one step before. So a limit
    counts only for the first step beyond it.
    Source: `MSCFModel_CC::finalizeSpeed`, `MSLane::getVehicleMaxSpeed`.
    """
    before = s - v * law.dt
    limit, turn = layout.section_speed[p, 0], layout.section_speed[p, 1]
    if before < law.entry <= s:
        return float(v0 * turn / limit)
    if before < layout.ends[p, 0] <= s:
        return float(min(v0 * limit / turn, cruise.max_speed))
    return v0


@njit_inner
def obey(told: float, v: float, advice: float, law: Law, cruise: Cruise) -> float:
    """What a vehicle asks of its engine if a command sets its acceleration."""
    asked = min(told, (cruise.max_speed - v) / law.dt, max((advice - v) / law.dt, -cruise.b))
    return asked if v > 0.0 else max(asked, 0.0)


@njit_inline
def realise(v: float, a: float, u: float, law: Law, cruise: Cruise) -> float:
    """Acceleration of this step: the engine's answer to `u`, never taking the speed below zero."""
    u = max(u, -v / law.dt)
    a = max(min(engine_lag(a, u, cruise.lag, law.dt), cruise.a_max), -cruise.type.b_max)
    return -v / law.dt if v + a * law.dt < STANDSTILL * law.dt else a
