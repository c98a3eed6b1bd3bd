"""Why vehicles of DIM wait or go, said from what each of them last saw."""

from __future__ import annotations

from collections.abc import Mapping

from dim.agent import Agent
from dim.decision import DecisionTable, explain
from dim.perception import Percept, Reader
from minisim.control import Observed, View, can_stop
from minisim.junction.movements import Movement
from minisim.reasons import Reason


class Reasons:
    """What the vehicles of a session answer when asked why, with the table in force."""

    def __init__(self, reader: Reader, table: DecisionTable, gate: str) -> None:
        self._reader, self._table, self._gate = reader, table, gate

    def of(self, me: Observed, agent: Agent, sight: View) -> Reason | None:
        """The reason of a vehicle that has decided; None if it left that to the one ahead."""
        if me.distance < 0.0:
            return Reason("crossing", me.id)
        percept = self._reader.read(sight)
        if agent.right_of_way:
            return self._goes(me, percept)
        if me.id in percept.crossing:
            return Reason("held", me.id)
        if me.id not in percept.participants:
            return None
        seen = {v.id: v for v in sight.vehicles}
        crossing = [seen[vehicle] for vehicle in percept.crossing]
        if crossing and self._gate == "clear":
            inside = tuple(v.id for v in crossing)
            return Reason("not clear", me.id, inside)
        against = tuple(v.id for v in crossing if v.lane != me.lane and self._in_way(me, v))
        if against:
            return Reason("not in harmony", me.id, against)
        return self._chosen(me, percept, [seen[vehicle] for vehicle in percept.participants])

    def _goes(self, me: Observed, percept: Percept) -> Reason:
        stops = can_stop(me, self._reader.decelerations[me.type])
        if not stops:
            return Reason("committed", me.id)
        lanes = self._table.surely(*percept.asked)
        clique = self._names(percept, lanes)
        if percept.crossing or str(self._reader.typed(me)) not in clique:
            return Reason("goes", me.id)
        return Reason("clique goes", me.id, clique=clique, note=self._why(percept))

    def _chosen(self, me: Observed, percept: Percept, participants: list[Observed]) -> Reason:
        """Why it is not among those that may go, although no crossing vehicle is in its way."""
        lanes = self._table.surely(*percept.asked)
        if lanes >> me.lane & 1:
            return Reason("looks again", me.id)
        if percept.unknown:
            unread = tuple(v.id for v in participants if not v.manoeuvre and v.id != me.id)
            return Reason("intent unknown", me.id, unread)
        rivals = [v for v in participants if lanes >> v.lane & 1]
        against = tuple(v.id for v in rivals if self._conflict(me, v))
        clique = tuple(str(self._reader.typed(v)) for v in rivals)
        return Reason("other clique", me.id, against, clique, note=self._why(percept))

    def _admitted(self, percept: Percept) -> tuple[Movement, ...]:
        table = self._table
        return table.participants(table.admitted(percept.case, percept.occupied, percept.barred))

    def _names(self, percept: Percept, lanes: int) -> tuple[str, ...]:
        return tuple(str(m) for m in self._admitted(percept) if lanes >> m.origin & 1)

    def _why(self, percept: Percept) -> str:
        """Why the clique was chosen, in one sentence."""
        table, movements = self._table, self._admitted(percept)
        if percept.unknown or not movements:
            return ""
        return explain(movements, table.matrix, table.order, table.priorities).reason

    def _in_way(self, me: Observed, other: Observed) -> bool:
        """Whether one that crosses bars another's movement."""
        passing = self._reader.passing
        if passing is None or other.distance >= 0.0 or not (me.manoeuvre and other.manoeuvre):
            return self._conflict(me, other)
        return bool(passing.bars(other) >> self._table.matrix.index(self._reader.typed(me)) & 1)

    def _conflict(self, one: Observed, other: Observed) -> bool:
        """Whether their movements are not in harmony; one that is not known may be anything."""
        if not (one.manoeuvre and other.manoeuvre):
            return True
        return not self._table.matrix.harmony(self._reader.typed(one), self._reader.typed(other))


def reasons_of(
    reasons: Reasons, view: View, agents: Mapping[int, Agent], sights: Mapping[int, View]
) -> dict[int, Reason]:
    """The reasons of the vehicles in a view that have decided, each from what it saw."""
    found = {
        v.id: reasons.of(v, agents[v.id], sights[v.id])
        for v in view.vehicles
        if v.id in agents and v.id in sights
    }
    return {vehicle: reason for vehicle, reason in found.items() if reason is not None}
