"""The paper's Algorithm 1 for one vehicle: to go or not, decided alone from what it perceives."""

from __future__ import annotations

from dim.decision import DecisionTable
from dim.perception import COMMITS, Percept
from minisim.parameters import declared, part, word

#: Which vehicles may enter while others cross. "clear": none (the paper). "harmonious" (ours): a
#: participant in harmony with all that cross, except those of its own lane, which it follows.
#: "passed" (ours): likewise, but a vehicle inside no longer counts for those whose way it has left.
GATES = ("clear", "harmonious", "passed")


@declared
class Rules:
    """The public rules: all that the vehicles have in common."""

    table: DecisionTable = part("the decision for every case", DecisionTable)
    gate: str = word("which vehicles enter while others cross, see `GATES`", GATES, default="clear")
    commit: str = word(
        "when a vehicle is committed, see `perception.COMMITS`", COMMITS,
        default="stoppable", label="commit rule",
    )  # fmt: skip


class Agent:
    """One vehicle's side of Algorithm 1; it only remembers whether it holds the right of way."""

    __slots__ = ("lane", "right_of_way", "rules", "vehicle")

    def __init__(self, vehicle: int, lane: int, rules: Rules) -> None:
        self.vehicle = vehicle
        self.lane = lane
        self.rules = rules
        self.right_of_way = False

    def decide(self, percept: Percept, table: DecisionTable | None = None) -> bool:
        """Whether the vehicle goes, given what it perceives now (lines 4–12 of Algorithm 1).

        - A crossing vehicle keeps going. Under the paper's commit rule it also goes if it has lost
          its right of way but rolled past the middle of the green zone ("it is granted the right
          of way by others"). Under the stoppable rule such a vehicle is stopping, and waits.
        - A vehicle that is not the first in its lane, or that the gate keeps out, does what it did
          before.
        - Any other vehicle goes if and only if it belongs to the clique. If it does not know an
          intent, it must belong to the clique of every possible case. So all the vehicles that go
          belong to the clique of the true case, however little each of them knows.

        If lane priorities change, `table` is for the present ones; by default it is the rules'.
        """
        rules = self.rules
        table = rules.table if table is None else table
        if percept.crossing:
            if self.vehicle in percept.crossing:
                self.right_of_way |= rules.commit == "paper"
                return self.right_of_way
            if rules.gate == "clear":
                return self.right_of_way
        if self.vehicle in percept.participants:
            lanes = table.surely(*percept.asked)
            self.right_of_way = bool(lanes >> self.lane & 1)
        return self.right_of_way
