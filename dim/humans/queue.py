"""Turns at a junction where humans drive: what came first, and what DIM makes of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dim.harmony import HarmonyMatrix
from dim.humans.drivers import Drivers, Readings
from dim.perception import ROUNDING, UNKNOWN
from dim.zones import Zones
from minisim.control import HALTING, Observed, View

LINE = 1.0  #: a driver stands at the line when its front is at most this far before it [m]


class Queue:
    """The first vehicles of the lanes that have come to the junction, in that order.

    A vehicle of DIM comes when it enters the yellow zone, or later becomes the first of its lane
    there. A human comes when it stands at the line. Of several at once, the vehicles of DIM come
    first, then the lanes in order. It leaves the queue when its front enters the junction.
    """

    def __init__(self, zones: Zones, drivers: Drivers) -> None:
        self._yellow = zones.yellow_start + ROUNDING
        self._line = zones.green + LINE
        self._drivers = drivers
        self.heads: dict[int, Observed] = {}  #: by id, in order
        self.people: set[int] = set()  #: ids of the humans among them

    def look(self, view: View) -> None:
        """Note what has come and gone."""
        firsts: dict[int, Observed] = {}
        for vehicle in view.vehicles:  # front to back
            if vehicle.distance >= 0.0:
                firsts.setdefault(vehicle.lane, vehicle)
        here = {v.id: v for v in firsts.values()}
        there = {i: here[i] for i in self.heads if i in here}
        come = [v for v in here.values() if v.id not in there and self._has_come(v)]
        come.sort(key=lambda v: (self.is_human(v), v.lane))
        self.heads = there | {v.id: v for v in come}
        self.people = {i for i, v in self.heads.items() if self.is_human(v)}

    def is_human(self, vehicle: Observed) -> bool:
        """Whether a human drives it, which its lamps would tell."""
        return self._drivers[vehicle.lane, vehicle.rank].human

    def _has_come(self, vehicle: Observed) -> bool:
        if self.is_human(vehicle):
            return vehicle.speed <= HALTING and vehicle.distance <= self._line
        return vehicle.distance <= self._yellow


class Courtesy:
    """How vehicles of DIM interpret what they see, so that humans get their turn.

    A vehicle that came after a human waits for all that came before it and are in its way. It
    takes no part until then, and neither do humans before the junction, which wait for DIM.
    """

    def __init__(
        self, trust: str, readings: Readings, matrix: HarmonyMatrix, queue: Queue
    ) -> None:
        self._trust, self._readings, self._queue = trust, readings, queue
        self._matrix = matrix
        self._conflict = (~matrix.values).tolist()
        self._latest: tuple[View, View] | None = None  # what was seen last, and its interpretation

    def __call__(self, view: View, seen: View) -> View:
        """What a vehicle takes for the traffic, given the true `view` and what it has `seen`."""
        if self._latest is None or self._latest[0] is not seen:
            true = {v.id: v for v in view.vehicles if self._queue.is_human(v)}
            self._latest = seen, View(seen.time, tuple(self._taken(seen, true)))
        return self._latest[1]

    def _taken(self, seen: View, true: Mapping[int, Observed]) -> Iterator[Observed]:
        shown = {v.id: v for v in seen.vehicles}
        ways = {
            i: self._ways(shown[i], true.get(i)) for i in (*self._queue.heads, *true) if i in shown
        }
        waiting = self._waiting(ways)
        closed = -1  # the lane whose vehicles before the junction do not take part
        for vehicle in seen.vehicles:
            human = vehicle.id in true
            if vehicle.distance >= 0.0:
                if human or vehicle.id in waiting:
                    closed = vehicle.lane
                if vehicle.lane == closed:
                    continue
            elif human:
                own = ways[vehicle.id]
                known = vehicle.manoeuvre if len(own) == 1 else UNKNOWN
                vehicle = vehicle._replace(manoeuvre=known)
            yield vehicle

    def _waiting(self, ways: Mapping[int, list[int]]) -> set[int]:
        """The vehicles of DIM that came after a human and have another before them in their way."""
        waiting: set[int] = set()
        before: list[int] = []
        behind = False  # whether a human came before
        for vehicle in self._queue.heads:
            if vehicle not in ways:
                continue
            if vehicle in self._queue.people:
                behind = True
            elif behind and any(
                self._conflict[k][q] for k in ways[vehicle] for one in (before[:1+max(n for n, i in enumerate(before) if i in self._queue.people)] if __import__("os").environ.get("BAR") else before) for q in ways[one]
            ):
                waiting.add(vehicle)
            before.append(vehicle)
        return waiting

    def _ways(self, vehicle: Observed, human: Observed | None) -> list[int]:
        """The rows of the matrix that a vehicle may mean."""
        row = self._readings.rows[vehicle.lane]
        if human is not None:
            own = self._readings.possible(human, self._trust)
        else:
            own = [row[vehicle.manoeuvre]] if vehicle.manoeuvre != UNKNOWN else list(row[1:])
        kind = vehicle.type if self._matrix.types > 1 else 0
        return [kind * len(self._readings.turns) + k for k in own]
