"""What wrong perception does to a run: counts for its summary.

    simulate(scenario, Tallied(Dim(perception=…)), on_collision="record").summary()

behaves as the `Dim` does, on any host, and adds to the summary:

- `crossings`: vehicles that entered the junction.
- `false_grants`: how often a vehicle held the right of way where the same rules on the true view
  had it wait, counted once each time it holds it.
- `disagreement_s`: how long two vehicles that took part had chosen different cliques [s].
- `deadlock_s`: how long vehicles took part, nobody was crossing and nobody had the right of way
  [s].

All of it is about what is true; no vehicle knows it. With exact perception the last three are 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from dim.agent import Agent
from dim.controller import Dim, DimSession
from dim.decision import DecisionTable
from dim.perception import ROUNDING, Percept
from minisim.control import Command, Go, Hold, Observed, Plan, Site, View
from minisim.errors import instance


@dataclass(frozen=True)
class Tallied:
    """A `Dim` whose runs count what goes wrong."""

    dim: Dim

    def __post_init__(self) -> None:
        instance("dim", self.dim, Dim)

    @property
    def name(self) -> str:
        """That of the `Dim`."""
        return self.dim.name

    def start(self, site: Site) -> TallySession:
        """Begin a run; errors as `Dim.start`."""
        return TallySession(self.dim, site)


class TallySession:
    """A session of DIM, and what was counted.

    Attributes:
        plan: as DIM's.
    """

    def __init__(self, dim: Dim, site: Site) -> None:
        self._session = DimSession(dim, site)
        self.plan: Plan = self._session.plan
        self._start = dim.zones.yellow_start + ROUNDING
        self._see, self._session.see = self._session.see, self._watch
        self._sights: dict[int, View] = {}
        self._going: set[int] = set()
        self._blamed: set[int] = set()  # those whose right of way has been counted as false
        self._before: set[int] = set()  # those who are about to cross
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

    def decide(self, view: View) -> Iterable[Command]:
        """DIM's commands."""
        passed, self._since = view.time - self._since, view.time
        self._disagreement += passed * self._disagree
        self._deadlock += passed * self._stuck
        self._sights.clear()
        commands = list(self._session.decide(view))
        near = [v for v in view.vehicles if v.distance <= self._start]
        before = {v.id for v in near if v.distance >= 0.0}
        self._crossings += len(self._before - before)  # also who has come and left between looks
        self._before = before
        truth = self._session.reader.read(view)
        table, _ = self._session.table(view)
        should = self._rightly(near, truth, table)
        self._carry_out(commands, near)
        wrongly = {v for v in self._going if v not in should and v not in truth.crossing}
        self._false_grants += len(wrongly - self._blamed)
        self._blamed = (self._blamed & self._going) | wrongly
        self._disagree = len(self._choices(truth, table)) > 1
        self._stuck = bool(truth.participants) and not truth.crossing and not self._going
        return commands

    def _watch(self, view: View, ego: Observed) -> View:
        """Remember what each vehicle sees."""
        sight = self._sights[ego.id] = self._see(view, ego)
        return sight

    def _rightly(self, near: list[Observed], truth: Percept, table: DecisionTable) -> set[int]:
        """Who would go from the same state by the same rules on the true view."""
        found = set()
        for vehicle in near:
            agent = Agent(vehicle.id, vehicle.lane, self._session.rules)
            agent.right_of_way = vehicle.id in self._going
            if agent.decide(truth, table):
                found.add(vehicle.id)
        return found

    def _carry_out(self, commands: list[Command], near: list[Observed]) -> None:
        for command in commands:
            if isinstance(command, Go):
                self._going.add(command.vehicle)
            elif isinstance(command, Hold):
                self._going.discard(command.vehicle)
        self._going &= {v.id for v in near}

    def _choices(self, truth: Percept, table: DecisionTable) -> set[int]:
        """The cliques that those who take part have chosen, as each sees the case."""
        reader, rules = self._session.reader, self._session.rules
        sights = [self._sights[v] for v in truth.participants]
        if sights and all(sight is sights[0] for sight in sights):
            return set()
        found = set()
        for vehicle, sight in zip(truth.participants, sights, strict=True):
            percept = reader.read(sight)
            frozen = bool(percept.crossing) and rules.gate == "clear"
            if vehicle in percept.participants and not frozen:
                found.add(table.surely(percept.case, percept.unknown, percept.occupied))
        return found
