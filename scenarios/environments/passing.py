"""Which vehicles may go: those that are wished to, as far as that is safe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import groupby, takewhile
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.signals.heads import committed
from minisim.control import Command, Go, Hold, Observed, Site, View, can_stop


class Junction(NamedTuple):
    """A view by what can still be decided."""

    settled: list[Observed]  #: inside, or with the right of way and too close to stop for it
    asking: list[Observed]  #: the first of each lane that can still be held


def heeded(site: Site, *, masked: bool) -> npt.NDArray[np.bool_]:
    """Which movements may not go together, shape (m, m): those in conflict; none if not masked."""
    return site.conflicts if masked else np.zeros_like(site.conflicts)


class Passing:
    """Turns wishes into commands; it remembers which vehicles have the right of way.

    If `masked`, no two vehicles go whose ways conflict. That is safe for the reason for which DIM's
    gate "harmonious" is (see the page on safety), whatever clique is chosen: a vehicle gets the
    right of way only in harmony with all that are settled or get it too, and loses it only while it
    can still stop. Of two wishes that conflict, that of the vehicle that waited longer counts.
    """

    def __init__(self, site: Site, sight: float, *, masked: bool) -> None:
        self._rows = site.intersection.movements.rows
        self._conflicts: list[list[bool]] = heeded(site, masked=masked).tolist()
        self._brakes = [it.deceleration for it in site.types]
        self._sight = sight
        self._going: set[int] = set()

    def _stops(self, vehicle: Observed) -> bool:
        return can_stop(vehicle, self._brakes[vehicle.type])

    def movement(self, vehicle: Observed) -> int:
        """Index of a vehicle's movement."""
        return self._rows[vehicle.lane][vehicle.manoeuvre]

    def look(self, view: View) -> Junction:
        """What is settled, and which vehicles ask."""
        self._going.intersection_update(v.id for v in view.vehicles)
        settled: list[Observed] = []
        asking: list[Observed] = []
        for lane in self._lanes(view):
            inside = [v for v in lane if v.distance < 0.0]
            before = lane[len(inside) :]
            going = list(takewhile(lambda v: v.id in self._going, before))
            settled += inside
            sure = committed(going, self._stops)
            settled += sure
            rest = before[len(sure) :]
            if rest and rest[0].distance <= self._sight:
                asking.append(rest[0])
        return Junction(settled, asking)

    def _lanes(self, view: View) -> Iterator[list[Observed]]:
        for _, lane in groupby(view.vehicles, key=lambda v: v.lane):
            yield list(lane)

    def possible(self, vehicle: Observed, settled: list[Observed]) -> bool:
        """Whether a vehicle may go: without conflict with those that are settled, if masked."""
        conflicts = self._conflicts[self.movement(vehicle)]
        return not any(conflicts[self.movement(other)] for other in settled)

    def commands(self, junction: Junction, wished: Callable[[Observed], bool]) -> list[Command]:
        """Give the right of way to those that ask and are wished to go; take it from the others."""
        chosen: list[Observed] = []
        for vehicle in sorted(junction.asking, key=lambda v: (v.demand_time, v.lane)):
            if wished(vehicle) and self.possible(vehicle, junction.settled + chosen):
                chosen.append(vehicle)
        go = {v.id for v in chosen}
        asking = {v.id for v in junction.asking}
        new = [Go(k) for k in sorted(go - self._going)]
        back = [Hold(k) for k in sorted((asking & self._going) - go)]
        self._going = (self._going - asking) | go
        return [*back, *new]
