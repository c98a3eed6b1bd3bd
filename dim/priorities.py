"""Which lane comes first where cliques tie: priorities that all vehicles know without a message.

Fixed ranks starve the last lane. The two rules here change the ranks as time passes. They need
nothing that a vehicle cannot know by itself:

- "rotating" needs a shared clock, such as that of satellite navigation. Each lane in turn comes
  first for some seconds, and the others follow clockwise.
- "waiting" puts that lane first whose front vehicle passed the start of the yellow zone longest
  ago. A vehicle that comes later has seen only what happened since the junction came into its
  sensors' range. When it takes part itself, it has watched for at least `memory` = (range − yellow
  zone's start) / speed limit, since no vehicle drives faster. So no wait counts more than `memory`,
  and every participant knows all waits: a vehicle that passed before the late one began to watch
  has waited for longer. Lanes that tie rank as by "rotating".

All vehicles that look at the same moment get the same ranks, whenever they came.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from dim.zones import Zones
from minisim.control import Observed, Site
from minisim.errors import InputError

#: How long each lane comes first [s]. No vehicle takes as long to cross: from a stand 2 m before
#: the junction, 22 m at 2.6 m/s² take 4.1 s. So there is a decision in every turn of a lane.
TURN_TIME = 10.0

#: How far vehicles see the others' approach lanes and yellow zones [m]. Manoeuvres have been read
#: from up to 150 m before a junction (Phillips, Wheeler, Kochenderfer, "Generalizable intention
#: prediction", IEEE IV 2017).
SENSOR_RANGE = 100.0

#: Times that differ by less are the same [s]: hosts round their clocks.
SAME_TIME = 1e-6


class Ranking(NamedTuple):
    """The rank of each lane, 0 first, and until when they hold if nothing happens [s]."""

    ranks: tuple[int, ...]
    until: float


def rotating(time: float, n: int, turn_time: float = TURN_TIME) -> Ranking:
    """Ranks by the shared clock: the lane whose turn it is, then the others clockwise."""
    turns = math.floor((time + SAME_TIME) / turn_time)
    return Ranking(tuple((lane - turns) % n for lane in range(n)), (turns + 1) * turn_time)


def longest_waiting(
    time: float, n: int, since: dict[int, float], memory: float, turn_time: float = TURN_TIME
) -> Ranking:
    """Ranks by waiting time, counted up to `memory`.

    Args:
        time: now [s].
        n: number of lanes.
        since: lane -> when its front vehicle passed the start of the yellow zone [s]; any time at
            least `memory` ago for a vehicle that was there before the observer.
        memory: the time for which every participant has watched at least [s].
        turn_time: of the rotating ranks, which break ties [s].
    """
    turns = rotating(time, n, turn_time)
    waits = {lane: min(time - when, memory) for lane, when in since.items()}
    order = sorted(range(n), key=lambda lane: (-round(waits.get(lane, -1.0), 6), turns.ranks[lane]))
    ends = [when + memory for when in since.values() if when + memory > time + SAME_TIME]
    ranks = tuple(order.index(lane) for lane in range(n))
    return Ranking(ranks, min([turns.until, *ends]))


def memory_of(site: Site, zones: Zones, sensor_range: float = SENSOR_RANGE) -> float:
    """The time for which a vehicle has watched at least when it begins to take part [s].

    Raises:
        InputError: the sensors do not reach beyond the yellow zone.
    """
    room = sensor_range - zones.yellow_start
    if room <= 0.0:
        raise InputError(
            f"sensors that reach {sensor_range:g} m do not see beyond the yellow zone, which "
            f"starts {zones.yellow_start:g} m before the junction"
        )
    return room / site.speed_limit


class PassingTimes:
    """When each vehicle passed the start of the yellow zone, as one observer saw it.

    Args:
        start: of the yellow zone [m before the junction].
    """

    def __init__(self, start: float) -> None:
        self._start = start
        self._passed: dict[int, float] = {}

    def look(self, time: float, vehicles: Iterable[Observed]) -> dict[int, float]:
        """Note which vehicles have passed; lane -> when its front vehicle did [s].

        A vehicle that is there at the first look counts as having just passed.
        """
        near = [v for v in vehicles if v.distance <= self._start]
        self._passed = {v.id: self._passed.get(v.id, time) for v in near}
        fronts: dict[int, float] = {}
        for vehicle in near:  # front to back
            if vehicle.distance >= 0.0:
                fronts.setdefault(vehicle.lane, self._passed[vehicle.id])
        return fronts
