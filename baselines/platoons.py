"""Platoons: one lane after the other is served, as queues are by a server that polls them.

Source: Timmerman, Boon, Transportmetrica A 17(3), 2021, 278–307 (arXiv 1901.04583). Vehicles are
slowed down before the junction so that they cross it in platoons, at full speed and close behind
each other. Platoons of different lanes keep a clearance time. Which vehicles form a platoon is the
discipline of a polling model. Exhaustive: a lane is served until no vehicle of it waits any more.
Gated: only those are served that have come when its turn begins. Then it is the turn of the next
lane, clockwise, in which a vehicle waits; if there is none, of the first vehicle that comes.

We had the abstract and the captions of the source, not its pseudocode. That empty lanes are passed
over, without a clearance time, is ours. Separations follow from car following and from conflict
zones (`baselines.flows`), so vehicles in harmony may pass at once. Their junctions have vehicles
that cross at full speed. On our four arms, those that turn follow each other no closer than 2.3 s,
so platoons lose more time than slots: at 350 veh/h/lane (fair) 11.3 s, 8.6 s if gated, to 5.4 s.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from typing import Literal

from baselines.flows import Flow, Lines
from baselines.prediction import Floats
from minisim.names import Name
from minisim.parameters import declared, word

SERVICES = ("exhaustive", "gated")


@declared
class Platoons(Flow):
    """Connected vehicles form platoons, lane after lane."""

    name = Name("platoons")

    service: Literal["exhaustive", "gated"] = word(
        "of a lane: until no vehicle waits, or only those that have come when its turn begins",
        SERVICES, default="exhaustive",
    )  # fmt: skip

    @property
    def rule(self) -> Polling:
        """Before the first vehicle."""
        return Polling(self.service == "gated")


@dataclass(frozen=True)
class Polling:
    """Lanes take turns."""

    gated: bool
    lane: int = 0  #: whose turn it is
    gate: frozenset[int] = frozenset()  #: ids of those that may still pass, if it is gated

    def choose(self, lines: Lines, free: Floats, clock: float) -> tuple[int, Polling]:
        """Go on with the lane, or turn to the next one in which a vehicle waits."""

        def waits(line: int) -> bool:
            head = lines[line][0] if lines[line] else None
            return head is not None and head.came <= max(clock, float(free[head.kind]))

        lane, gate = self.lane, self.gate
        goes_on = lines[lane] and lines[lane][0].id in gate if self.gated else waits(lane)
        if not goes_on:
            turns = [(lane + 1 + k) % len(lines) for k in range(len(lines))]
            first = min((k for k in turns if lines[k]), key=lambda k: lines[k][0].came)
            lane = next(filter(waits, turns), first)
            start = max(lines[lane][0].ready, float(free[lines[lane][0].kind]))
            gate = frozenset(it.id for it in takewhile(lambda it: it.came <= start, lines[lane]))
        return lane, Polling(self.gated, lane, gate - {lines[lane][0].id})
