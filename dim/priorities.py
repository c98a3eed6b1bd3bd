"""Which lane comes first where cliques tie: priorities that all vehicles know without a message.

Fixed ranks starve the last lane. The two rules here change the ranks as time passes, and need
nothing that a vehicle cannot know by itself:

- "rotating" needs a shared clock, such as satellite navigation gives. Each lane comes first for so
  many seconds in turn, and the others follow clockwise.
- "waiting" puts the lane first whose front vehicle passed the start of its yellow zone longest ago.
  A vehicle that comes later did not see that. It has seen what happened since the junction came
  into its sensors' range. When it takes part itself, it has watched for at least `memory` =
  (range − yellow zone's start) / speed limit, for no vehicle drives faster. So all waits count as
  `memory` at most. Then every participant knows all waits: a vehicle that passed before a late one
  began to watch has waited longer than that. Lanes that tie rank as "rotating" has them.

Both give the same ranks to all vehicles that look at one moment, whenever each of them came.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from dim.zones import Zones
from minisim.control import Observed, Site
from minisim.errors import InputError

#: How long each lane comes first [s]. Longer than any vehicle crosses: from a stand 2 m before
#: it, 22 m at 2.6 m/s² take 4.1 s. So every turn of a lane sees a decision.
TURN_TIME = 10.0

#: How far vehicles see the others' approach lanes and yellow zones [m]. Manoeuvres have been read
#: from up to 150 m before a junction (Phillips, Wheeler, Kochenderfer, "Generalizable intention
#: prediction", IEEE IV 2017); this stays within.
SENSOR_RANGE = 100.0

#: Instants this close are one [s]: hosts round their clocks.
SAME_TIME = 1e-6


class Ranking(NamedTuple):
    """Ranks, and until when they hold if nothing happens.

    Attributes:
        ranks: of each lane, 0 first.
        until: [s].
    """

    ranks: tuple[int, ...]
    until: float


def turn_at(time: float, n: int, turn_time: float = TURN_TIME) -> tuple[int, float]:
    """The lane whose turn it is by the shared clock, and when its turn ends [s]."""
    turns = math.floor((time + SAME_TIME) / turn_time)
    return turns % n, (turns + 1) * turn_time


def rotating(time: float, n: int, turn_time: float = TURN_TIME) -> Ranking:
    """Ranks by the shared clock: the lane whose turn it is, then the others clockwise."""
    first, until = turn_at(time, n, turn_time)
    return Ranking(tuple((lane - first) % n for lane in range(n)), until)


def longest_waiting(
    time: float, n: int, since: dict[int, float], memory: float, turn_time: float = TURN_TIME
) -> Ranking:
    """Ranks by waiting time, counted up to `memory`.

    Args:
        time: now [s].
        n: number of lanes.
        since: lane -> when its front vehicle passed the start of the yellow zone [s]; for a vehicle
            that was there before the observer, any time at least `memory` ago.
        memory: least time for which every participant has watched [s].
        turn_time: of the rotating ranks, which break ties [s].
    """
    turns = rotating(time, n, turn_time)
    waits = {lane: min(time - when, memory) for lane, when in since.items()}
    order = sorted(range(n), key=lambda lane: (-round(waits.get(lane, -1.0), 6), turns.ranks[lane]))
    ends = [when + memory for when in since.values() if when + memory > time + SAME_TIME]
    ranks = tuple(order.index(lane) for lane in range(n))
    return Ranking(ranks, min([turns.until, *ends]))


def memory_of(site: Site, zones: Zones, sensor_range: float = SENSOR_RANGE) -> float:
    """Least time for which a vehicle has watched when it begins to take part [s].

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


class Watch:
    """When each vehicle passed the start of the yellow zone, as one observer saw it.

    Attributes:
        start: of the yellow zone [m before the junction].
    """

    def __init__(self, start: float) -> None:
        self.start = start
        self._passed: dict[int, float] = {}

    def look(self, time: float, vehicles: Iterable[Observed]) -> dict[int, float]:
        """Note the vehicles that are new past the start; lane -> when its front vehicle passed [s].

        Vehicles that are already there at the first look count as having just come.
        """
        near = [v for v in vehicles if v.distance <= self.start]
        self._passed = {v.id: self._passed.get(v.id, time) for v in near}
        fronts: dict[int, float] = {}
        for vehicle in near:  # front to back
            if vehicle.distance >= 0.0:
                fronts.setdefault(vehicle.lane, self._passed[vehicle.id])
        return fronts
