"""The queue of a junction where humans drive, and which vehicles of DIM it keeps waiting."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from dim.harmony import HarmonyMatrix
from dim.humans.drivers import Drivers, Readings
from dim.perception import ROUNDING, UNKNOWN
from dim.zones import Zones
from minisim.control import AT_LINE, HALTING, Observed, View


class Queue:
    """The first vehicle of each lane, in the order in which they came.

    A vehicle of DIM has come once it is the first of its lane in the yellow zone, a human once it
    also stands at the line. Of those that come at once, DIM's are before humans, then lane a is
    before lane b. A vehicle leaves the queue when its front enters the junction.
    """

    def __init__(self, zones: Zones, drivers: Drivers) -> None:
        self._yellow = zones.yellow_start + ROUNDING
        self._line = zones.green + AT_LINE
        self._drivers = drivers
        self.heads: dict[int, Observed] = {}  #: by id, in order
        self.people: set[int] = set()  #: ids of the humans among them
        #: Humans that are the first of their lane in the yellow zone.
        self.near: list[Observed] = []
        self.humans = False  #: whether a human is in the queue or inside the junction

    def look(self, view: View) -> None:
        """Note which vehicles have come and which have gone."""
        firsts: dict[int, Observed] = {}
        for vehicle in view.vehicles:  # front to back
            if vehicle.distance >= 0.0:
                firsts.setdefault(vehicle.lane, vehicle)
        near = [v for v in firsts.values() if v.distance <= self._yellow]
        self.near = [v for v in near if self.is_human(v)]
        here = {v.id: v for v in near}
        stay = {i: here.pop(i) for i in self.heads if i in here}
        come = [v for v in here.values() if v not in self.near or self._stands(v)]
        come.sort(key=lambda v: (self.is_human(v), v.lane))
        self.heads = stay | {v.id: v for v in come}
        self.people = {i for i, v in self.heads.items() if self.is_human(v)}
        inside = (self.is_human(v) for v in view.vehicles if v.distance < 0.0)
        self.humans = bool(self.people) or any(inside)

    def is_human(self, vehicle: Observed) -> bool:
        """Whether a human drives a vehicle, as lamps would tell."""
        return self._drivers[vehicle.lane, vehicle.rank].human

    def _stands(self, vehicle: Observed) -> bool:
        return vehicle.speed <= HALTING and vehicle.distance <= self._line


class Courtesy:
    """How vehicles of DIM interpret a view, so that each vehicle in the queue gets its turn.

    One that came after a human takes no part until all that came before it, and are in its way,
    have entered the junction. Humans before the junction take no part either: they go after all
    vehicles that came before them, and those that come after them wait.

    As humans do, vehicles of DIM go as soon as others inside are out of the way. So with a human at
    the junction, one inside does not count once it is in no other's way; where perception errs, it
    counts until it has left.
    """

    def __init__(
        self, trust: str, readings: Readings, matrix: HarmonyMatrix, queue: Queue, exact: bool
    ) -> None:
        self._trust, self._readings, self._queue = trust, readings, queue
        self._exact = exact  # whether perception does not err
        self._conflict, self._movements = (~matrix.values).tolist(), matrix.movements
        self._turns = len(readings.turns) if matrix.types > 1 else 0  # rows of the matrix by type
        self._latest: tuple[View, View] | None = None  # what was seen last, and its interpretation

    def __call__(self, view: View, seen: View) -> View:
        """What a vehicle makes of what it has `seen` of the true `view`."""
        if self._latest is None or self._latest[0] is not seen:
            ways = {
                v.id: self._readings.possible(v, self._trust)
                for v in view.vehicles
                if self._queue.is_human(v)
            }
            there = list(self._there(seen, ways))
            if self._exact and self._queue.humans:
                there = [v for v in there if v.distance >= 0.0 or self._blocks_any(v, there)]
            taken = tuple(self._known(v, ways.get(v.id, ())) for v in there)
            self._latest = seen, View(seen.time, taken)
        return self._latest[1]

    def _there(self, seen: View, ways: Mapping[int, list[int]]) -> Iterator[Observed]:
        """The vehicles that take part or are inside; `ways` are those that each human may take."""
        waiting = self._waiting(seen, ways)
        closed = -1  # the lane of which no more vehicles take part
        for vehicle in seen.vehicles:
            if vehicle.distance >= 0.0:
                if self._queue.is_human(vehicle) or vehicle.id in waiting:
                    closed = vehicle.lane
                if vehicle.lane == closed:
                    continue
            yield vehicle

    def _blocks_any(self, vehicle: Observed, there: Iterable[Observed]) -> bool:
        """Whether a vehicle inside may still be in the way of one from another lane."""
        possible, trust = self._readings.possible, self._trust
        others = (v for v in there if v.lane != vehicle.lane)
        return any(self._readings.blocks(vehicle, possible(v, trust), trust) for v in others)

    def _known(self, vehicle: Observed, ways: Sequence[int]) -> Observed:
        """A vehicle as DIM takes it: the manoeuvre of a human is known only if no other is left."""
        if not self._queue.is_human(vehicle):
            return vehicle
        known = self._movements[ways[0]].manoeuvre if len(ways) == 1 else UNKNOWN
        return vehicle._replace(manoeuvre=known)

    def _waiting(self, seen: View, ways: Mapping[int, list[int]]) -> set[int]:
        """Vehicles of DIM that came after a human, and after another that is in their way."""
        waiting: set[int] = set()
        shown = {v.id: v for v in seen.vehicles}
        taken: list[int] = []  # rows of the matrix that vehicles before may take
        human = False  # whether there is one before
        for i in self._queue.heads:
            if i not in shown:
                continue
            rows = self._rows(shown[i], ways.get(i))
            human |= i in ways
            if human and any(self._conflict[row][other] for row in rows for other in taken):
                waiting.add(i)
            taken += rows
        return waiting

    def _rows(self, vehicle: Observed, ways: list[int] | None) -> list[int]:
        """The rows of the matrix for all that a vehicle may do."""
        if ways is None:
            row = self._readings.rows[vehicle.lane]
            ways = [row[vehicle.manoeuvre]] if vehicle.manoeuvre != UNKNOWN else list(row[1:])
        return [vehicle.type * self._turns + way for way in ways]
