"""Algorithm 1 of the paper for one vehicle: does it go, from what it perceives, alone?"""

from __future__ import annotations

from dim.decision import DecisionTable
from dim.perception import COMMITS, Percept
from minisim.parameters import declared, part, word

#: Who may enter while others cross. "clear": nobody new (the paper). "harmonious": a participant
#: in harmony with all of them (ours); behind a vehicle of its own lane it just follows.
GATES = ("clear", "harmonious")


@declared
class Rules:
    """The public rules: all vehicles hold the same ones, and nothing else in common."""

    table: DecisionTable = part("the decision of every case", DecisionTable)
    gate: str = word(
        "which vehicles may enter while others cross, see `GATES`", GATES, default="clear"
    )
    commit: str = word(
        "when a vehicle is committed, see `perception.COMMITS`", COMMITS,
        default="stoppable", label="commit rule",
    )  # fmt: skip


class Agent:
    """One vehicle's side of Algorithm 1; it remembers only whether it holds the right of way.

    Attributes:
        vehicle: its id.
        lane: its approach lane.
        right_of_way: whether it goes; False until it has decided otherwise.
    """

    __slots__ = ("lane", "right_of_way", "rules", "vehicle")

    def __init__(self, vehicle: int, lane: int, rules: Rules) -> None:
        self.vehicle = vehicle
        self.lane = lane
        self.rules = rules
        self.right_of_way = False

    def decide(self, percept: Percept, table: DecisionTable | None = None) -> bool:
        """Whether it goes, from what it perceives now (lines 4–12 of Algorithm 1).

        Crossing, it keeps going; by the paper's commit rule it also goes when it rolled past
        half of the green zone after losing its right of way ("it is granted the right of way by
        others"). By the stoppable rule such a vehicle is stopping, and waits. Not yet its lane's
        front vehicle, or held out by the gate, it does what it did before. Otherwise it goes
        exactly if it belongs to the clique; where it does not know somebody's intent, exactly if
        it belongs to the clique of every case that may be meant. So all who go belong to the
        clique of the true case, however little each of them knows.

        Args:
            percept: what it sees.
            table: of the lane priorities in force now, where these change; by default the rules'.
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
            lanes = table.surely(percept.case, percept.unknown, percept.occupied)
            self.right_of_way = bool(lanes >> self.lane & 1)
        return self.right_of_way
