"""What misperception does to a run of DIM, with or without human drivers: counts for its summary.

- `crossings`: vehicles that entered the junction.
- `false_grants`: how often a vehicle held the right of way although the same rules, applied to the
  true view, would have made it wait; counted once each time it holds the right of way.
- `disagreement_s`: how long there were participants that had chosen different cliques [s].
- `deadlock_s`: how long participants waited while none crossed or had the right of way [s].

The last three compare with the truth, which no vehicle knows. If every reading is right, all are 0.
"""

from __future__ import annotations

from collections.abc import Mapping

from dim.agent import Agent, Rules
from dim.decision import DecisionTable
from dim.perception import Percept, Reader
from minisim.control import View


class Tally:
    """The counts of one run; the yellow zone begins `start` [m] before the junction."""

    def __init__(self, reader: Reader, start: float) -> None:
        self._reader, self._start = reader, start
        self._going: set[int] = set()
        self._blamed: set[int] = set()  # vehicles whose right of way has been counted as false
        self._before: set[int] = set()  # vehicles that are about to cross
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
        self, view: View, true: View, sights: Mapping[int, View], rules: Rules,
        table: DecisionTable, going: set[int],
    ) -> None:  # fmt: skip
        """Add one look around to the counts.

        `true` is what vehicles would make of the `view` without an error, `sights` what each
        vehicle that follows DIM has made of what it saw. It decides by these `rules` and this
        `table`. Those in `going` now have the right of way.
        """
        passed, self._since = view.time - self._since, view.time
        self._disagreement += passed * self._disagree
        self._deadlock += passed * self._stuck
        before = {v.id for v in view.vehicles if 0.0 <= v.distance <= self._start}
        self._crossings += len(self._before - before)  # also those that entered and left in between
        self._before = before
        truth = self._reader.read(true)
        should = self._rightly(view, sights, truth, rules, table)
        self._going = going
        wrongly = going - should - set(truth.crossing)
        self._false_grants += len(wrongly - self._blamed)
        self._blamed = (self._blamed & going) | wrongly
        self._disagree = len(self._choices(truth, sights, rules, table)) > 1
        self._stuck = bool(truth.participants) and not truth.crossing and not going

    def _rightly(
        self, view: View, sights: Mapping[int, View], truth: Percept, rules: Rules,
        table: DecisionTable,
    ) -> set[int]:  # fmt: skip
        """The vehicles that would go if they saw the truth, by the same rules in the same state."""
        rightly = set()
        for vehicle in view.vehicles:
            agent = Agent(vehicle.id, vehicle.lane, rules)
            agent.right_of_way = vehicle.id in self._going
            if vehicle.id in sights and agent.decide(truth, table):
                rightly.add(vehicle.id)
        return rightly

    def _choices(
        self, true: Percept, sights: Mapping[int, View], rules: Rules, table: DecisionTable
    ) -> set[int]:
        """The cliques that the participants have chosen, each from the case that it sees."""
        seen = [sights[v] for v in true.participants]
        if seen and all(sight is seen[0] for sight in seen):
            return set()
        choices = set()
        for vehicle, sight in zip(true.participants, seen, strict=True):
            percept = self._reader.read(sight)
            frozen = bool(percept.crossing) and rules.gate == "clear"
            if vehicle in percept.participants and not frozen:
                choices.add(table.surely(*percept.asked))
        return choices
