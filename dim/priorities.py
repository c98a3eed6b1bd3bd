"""Which lane comes first where cliques tie: priorities that all vehicles know without a message.

Fixed ranks starve the last lane. The two rules here change the ranks with time, by what every
vehicle can know on its own. Vehicles that look at the same moment get the same ranks:

- "rotating" needs a shared clock, such as satellite navigation has. Each lane in turn comes first
  for some seconds, and the others follow clockwise.
- "waiting" puts first the lane whose front vehicle passed the start of the yellow zone longest ago.
  A latecomer has watched only since the junction came within range of its sensors. Before it takes
  part, that is at least `memory` = (range − yellow zone's start) / speed limit, since no vehicle
  drives faster. So no wait counts for more than `memory`, and every participant knows all waits: a
  vehicle that passed before the latecomer began to watch has waited longer than that.
  Lanes that tie are ranked as in "rotating".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, NamedTuple

from dim.perception import ROUNDING
from dim.zones import Zones
from minisim.control import Observed, Site, View
from minisim.errors import InputError

CHANGING = ("rotating", "waiting")  #: priorities that change with time

#: How long each lane comes first [s]. No vehicle takes that long to cross: from a standstill 2 m
#: before the junction, 22 m at 2.6 m/s² take 4.1 s. So every lane's turn includes a decision.
TURN_TIME = 10.0

#: How far vehicles see the others' approach lanes and yellow zones [m]. Manoeuvres have been read
#: from 150 m (Phillips, Wheeler, Kochenderfer, "Generalizable intention prediction", IEEE IV 2017).
SENSOR_RANGE = 100.0

SAME_TIME = 1e-6  #: times that differ by less count as the same [s]: hosts round their clocks


class Ranking(NamedTuple):
    """Each lane's rank, 0 first, and the time until which the ranks hold if nothing happens [s]."""

    ranks: tuple[int, ...]
    until: float


def rotating(time: float, n: int, turn_time: float = TURN_TIME) -> Ranking:
    """Ranks by the shared clock: the lane whose turn it is, then the others clockwise."""
    turns = math.floor((time + SAME_TIME) / turn_time)
    return Ranking(tuple((lane - turns) % n for lane in range(n)), (turns + 1) * turn_time)


def longest_waiting(
    time: float, n: int, since: dict[int, float], memory: float, turn_time: float = TURN_TIME
) -> Ranking:
    """Ranks of n lanes by waiting time, capped at `memory` [s]; rotating ranks break ties.

    `since` is when the front vehicle of each lane passed the start of the yellow zone; for a
    vehicle that was there before the observer, any time at least `memory` ago will do.
    """
    turns = rotating(time, n, turn_time)
    waits = {lane: min(time - when, memory) for lane, when in since.items()}
    order = sorted(range(n), key=lambda lane: (-round(waits.get(lane, -1.0), 6), turns.ranks[lane]))
    ends = [when + memory for when in since.values() if when + memory > time + SAME_TIME]
    ranks = tuple(order.index(lane) for lane in range(n))
    return Ranking(ranks, min([turns.until, *ends]))


def memory_of(site: Site, zones: Zones, sensor_range: float = SENSOR_RANGE) -> float:
    """The least time a vehicle has watched before it takes part [s]; may raise `InputError`."""
    room = sensor_range - zones.yellow_start
    if room <= 0.0:
        raise InputError(
            f"sensors that reach {sensor_range:g} m do not see beyond the yellow zone, which "
            f"starts {zones.yellow_start:g} m before the junction"
        )
    return room / site.speed_limit


class PassingTimes:
    """When each vehicle passed `start`, the yellow zone's start [m], as one observer saw it."""

    def __init__(self, start: float) -> None:
        self._start = start
        self._passed: dict[int, float] = {}

    def look(self, time: float, vehicles: Iterable[Observed]) -> dict[int, float]:
        """Note which vehicles have passed; return lane -> when its front vehicle passed [s].

        A vehicle already there at the first look counts as having just passed.
        """
        near = [v for v in vehicles if v.distance <= self._start]
        self._passed = {v.id: self._passed.get(v.id, time) for v in near}
        fronts: dict[int, float] = {}
        for vehicle in near:  # front to back
            if vehicle.distance >= 0.0:
                fronts.setdefault(vehicle.lane, self._passed[vehicle.id])
        return fronts


def ranking_of(
    priorities: Any, site: Site, zones: Zones, turn_time: float, sensor_range: float
) -> Callable[[View], Ranking] | None:
    """The ranks that all participants read from a view, or None if they never change."""
    n = site.intersection.n
    if priorities == "rotating":
        return lambda view: rotating(view.time, n, turn_time)
    if priorities == "waiting":
        memory = memory_of(site, zones, sensor_range)
        passing = PassingTimes(zones.yellow_start + ROUNDING)
        return partial(_by_waiting, passing, n, memory, turn_time)
    return None


def _by_waiting(
    passing: PassingTimes, n: int, memory: float, turn_time: float, view: View
) -> Ranking:
    """The ranks by waiting. (No closure: a fork copies the passing times.)"""
    fronts = passing.look(view.time, view.vehicles)
    return longest_waiting(view.time, n, fronts, memory, turn_time)
