"""What wrong perception does to a run of DIM: counts for its summary.

A session of DIM whose perception errs, among human drivers too, adds to the summary of its run:

- `crossings`: vehicles that entered the junction.
- `false_grants`: how often a vehicle held the right of way where the same rules on the true view
  had it wait, counted once each time it holds it.
- `disagreement_s`: how long two vehicles that took part had chosen different cliques [s].
- `deadlock_s`: how long vehicles took part while none was crossing and none had the right of way
  [s].

All of it compares with the truth, which no vehicle knows. Where every reading is right, the last
three are 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dim.agent import Agent, Rules
from dim.decision import DecisionTable
from dim.perception import Percept, Reader
from minisim.control import Command, Go, Hold, View


class Tally:
    """The counts of one run.

    Args:
        rules, reader: those of the vehicles.
        start: how far before the junction the yellow zone begins [m].
    """

    def __init__(self, rules: Rules, reader: Reader, start: float) -> None:
        self._rules, self._reader, self._start = rules, reader, start
        self._going: set[int] = set()
        self._blamed: set[int] = set()  # those whose right of way has been counted as false
        self._before: set[int] = set()  # those that are about to cross
        self._crossings = self._false_grants = 0
        self._disagreement = self._deadlock = 0.0
        self._since = 0.0
        self._disagree = self._stuck = False

    @property
    def counts(self) -> Mapping[str, float]:
        """What has been counted so far."""
        return {
            "crossings": self._crossings,
            "false_grants": self._false_grants,
            "disagreement_s": round(self._disagreement, 6),
            "deadlock_s": round(self._deadlock, 6),
        }

    def count(
        self,
        true: View,
        sights: Mapping[int, View],
        table: DecisionTable,
        commands: Iterable[Command],
    ) -> None:
        """Count one look around.

        Args:
            true: what vehicles would see without an error.
            sights: what each vehicle that follows DIM has seen, by its id.
            table: in force.
            commands: what the vehicles decided.
        """
        passed, self._since = true.time - self._since, true.time
        self._disagreement += passed * self._disagree
        self._deadlock += passed * self._stuck
        before = {v.id for v in true.vehicles if 0.0 <= v.distance <= self._start}
        self._crossings += len(self._before - before)  # also those that came and left in between
        self._before = before
        truth = self._reader.read(true)
        should = self._rightly(true, sights, truth, table)
        self._carry_out(commands, sights)
        wrongly = {v for v in self._going if v not in should and v not in truth.crossing}
        self._false_grants += len(wrongly - self._blamed)
        self._blamed = (self._blamed & self._going) | wrongly
        self._disagree = len(self._choices(truth, sights, table)) > 1
        self._stuck = bool(truth.participants) and not truth.crossing and not self._going

    def _rightly(
        self, true: View, sights: Mapping[int, View], truth: Percept, table: DecisionTable
    ) -> set[int]:
        """The vehicles that would go from the same state by the same rules on the true view."""
        rightly = set()
        for vehicle in true.vehicles:
            if vehicle.id not in sights:
                continue
            agent = Agent(vehicle.id, vehicle.lane, self._rules)
            agent.right_of_way = vehicle.id in self._going
            if agent.decide(truth, table):
                rightly.add(vehicle.id)
        return rightly

    def _carry_out(self, commands: Iterable[Command], near: Iterable[int]) -> None:
        for command in commands:
            if isinstance(command, Go):
                self._going.add(command.vehicle)
            elif isinstance(command, Hold):
                self._going.discard(command.vehicle)
        self._going.intersection_update(near)

    def _choices(
        self, truth: Percept, sights: Mapping[int, View], table: DecisionTable
    ) -> set[int]:
        """The cliques that those that take part have chosen, as each sees the case."""
        seen = [sights[v] for v in truth.participants]
        if seen and all(sight is seen[0] for sight in seen):
            return set()
        choices = set()
        for vehicle, sight in zip(truth.participants, seen, strict=True):
            percept = self._reader.read(sight)
            frozen = bool(percept.crossing) and self._rules.gate == "clear"
            if vehicle in percept.participants and not frozen:
                choices.add(table.surely(percept.case, percept.unknown, percept.occupied))
        return choices
