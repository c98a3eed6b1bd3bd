"""DIM as a transition system over discrete zones: all that its safety and liveness depend on.

The protocol sees little of a vehicle's motion: it comes to the front of its lane, starts to roll,
gets committed, enters, leaves. So a state holds the front vehicle of each lane before the junction
(the only one of its lane that decides anything) and the set of movements inside. That set is
enough, however many vehicles follow each other on one movement, so the model is finite without a
limit on traffic. There is no time: whatever can happen next may happen, in any order and after any
delay. Every simulated run is a path of this model (`dim.proofs.conformance` checks it), but few
paths are runs.

All vehicles look at the same moment, as they do in `dim.controller`, but after any delay.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property, lru_cache
from typing import Final, NamedTuple

from dim.agent import GATES
from dim.decision import ORDERS, DecisionTable, decision_table
from dim.harmony import HarmonyMatrix
from dim.perception import COMMITS
from minisim.junction.movements import Movement
from minisim.parameters import declared, part, word

#: Which lane comes first where cliques tie. "fixed": the lanes' own order. "rotating": the lane
#: whose turn it is, then the others clockwise; a turn ends after a decision at the earliest.
#: "waiting": the lane whose front vehicle came first, as if every vehicle remembered that for ever.
PRIORITIES = ("fixed", "rotating", "waiting")

#: Phases of a front vehicle. It has waited since it came; or, with commit="paper" only, it has had
#: the right of way and may be anywhere before it is committed, where it may roll on without the
#: right of way; or it is committed.
WAITING: Final = 0
ROLLING: Final = 1
COMMITTED: Final = 2


class Front(NamedTuple):
    """The front vehicle of a lane, between the start of the yellow zone and the junction."""

    manoeuvre: int
    phase: int
    goes: bool


class State(NamedTuple):
    """What the protocol depends on."""

    fronts: tuple[Front | None, ...]  # of each lane
    inside: int = 0  # movements in the junction, bit k for the k-th
    turn: int = 0  # "rotating" only: the lane whose turn it is
    decided: bool = False  # "rotating" only: whether there was a decision in this turn
    came: tuple[int, ...] = ()  # "waiting" only: lanes with a front vehicle, in order of coming


class Event(NamedTuple):
    """What happens between two states: "arrive", "roll", "commit", "slow", "enter", "leave" of a
    movement; "look" of all vehicles; "turn" of the rotating priority."""

    what: str
    lane: int = -1
    manoeuvre: int = 0

    def __str__(self) -> str:
        return f"{self.what} {Movement(self.lane, self.manoeuvre)}" if self.manoeuvre else self.what


LOOK: Final = Event("look")
TURN: Final = Event("turn")

Step = tuple[Event, State]


@declared
class Protocol:
    """The rules of `dim.Dim` and `PRIORITIES`, and with them the states and what may happen."""

    matrix: HarmonyMatrix = part("harmony of the movements", HarmonyMatrix)
    order: str = word("which clique is preferred", ORDERS, default="size")
    gate: str = word("what may enter while others cross", GATES, default="clear")
    commit: str = word(
        "when a vehicle is committed", COMMITS, label="commit rule", default="stoppable"
    )
    priorities: str = word("which lane comes first at a tie", PRIORITIES, default="fixed")

    @property
    def start(self) -> State:
        """No vehicle is there."""
        return State((None,) * self.matrix.n)

    def successors(self, state: State) -> Iterator[Step]:
        """All that can happen next."""
        seen = self.look(state)
        if seen != state:
            yield LOOK, seen
        yield from self.moves(state)
        yield from self.arrivals(state)
        if self.priorities == "rotating" and (state.decided or not any(state.fronts)):
            yield TURN, state._replace(turn=(state.turn + 1) % self.matrix.n, decided=False)

    def arrivals(self, state: State) -> Iterator[Step]:
        """A vehicle comes to the front of a lane: at the start of the yellow zone, or behind one
        that has just entered the junction."""
        for lane, front in enumerate(state.fronts):
            if front is None:
                for manoeuvre in range(1, self.matrix.n):
                    after = self._put(state, lane, Front(manoeuvre, WAITING, False))
                    if self.priorities == "waiting":
                        after = after._replace(came=(*state.came, lane))
                    yield Event("arrive", lane, manoeuvre), after

    def moves(self, state: State) -> Iterator[Step]:
        """What the vehicles that are there can do."""
        paper = self.commit == "paper"
        for lane, front in enumerate(state.fronts):
            if front is None:
                continue
            manoeuvre, phase, goes = front
            if phase == WAITING and goes:
                to = ROLLING if paper else COMMITTED
                what = "roll" if paper else "commit"
                yield (
                    Event(what, lane, manoeuvre),
                    self._put(state, lane, Front(manoeuvre, to, True)),
                )
            elif phase == ROLLING:  # with the right of way, or no longer able to stop without it
                committed = Front(manoeuvre, COMMITTED, goes)
                yield Event("commit", lane, manoeuvre), self._put(state, lane, committed)
            elif phase == COMMITTED and goes:
                yield Event("enter", lane, manoeuvre), self._enter(state, lane, manoeuvre)
                if not paper:  # behind a slow vehicle it may become able to stop again
                    waiting = Front(manoeuvre, WAITING, True)
                    yield Event("slow", lane, manoeuvre), self._put(state, lane, waiting)
        inside = state.inside
        while inside:
            bit = inside & -inside
            inside ^= bit
            movement = self.matrix.movements[bit.bit_length() - 1]
            yield Event("leave", *movement), state._replace(inside=state.inside ^ bit)

    def look(self, state: State) -> State:
        """All vehicles decide (Algorithm 1, lines 4 to 12).

        A committed vehicle goes. While vehicles cross, the gate "clear" leaves the rest as it is,
        and the gate "harmonious" keeps out those in conflict with a crossing one. Of the others
        only the best clique goes.
        """
        n, movements = self.matrix.n, self.matrix.movements
        rows, bits = movements.rows, movements.bits
        occupied = state.inside
        for lane, front in enumerate(state.fronts):
            if front is not None and front.phase == COMMITTED:
                occupied |= bits[lane][front.manoeuvre]
        frozen = bool(occupied) and self.gate == "clear"
        case = 0
        for lane, front in enumerate(state.fronts):
            if front is not None and front.phase != COMMITTED:
                foes = self._foes[rows[lane][front.manoeuvre]]
                case += 0 if foes & occupied else front.manoeuvre * n**lane
        chosen = 0 if frozen else self._table(state).lanes(case)
        fronts = tuple(
            front
            if front is None
            else Front(
                front.manoeuvre,
                front.phase,
                front.phase == COMMITTED or (front.goes if frozen else bool(chosen >> lane & 1)),
            )
            for lane, front in enumerate(state.fronts)
        )
        decided = state.decided or (self.priorities == "rotating" and not frozen and case > 0)
        return state._replace(fronts=fronts, decided=decided)

    def conflict(self, state: State) -> tuple[Movement, Movement] | None:
        """Two movements of different arms in conflict that are inside at once, or None: safe."""
        inside = state.inside
        while inside:
            k = inside.bit_length() - 1
            inside ^= 1 << k
            if self._foes[k] & inside:
                other = (self._foes[k] & inside).bit_length() - 1
                return self.matrix.movements[other], self.matrix.movements[k]
        return None

    def _enter(self, state: State, lane: int, manoeuvre: int) -> State:
        after = self._put(state, lane, None)
        return after._replace(
            inside=state.inside | self.matrix.movements.bits[lane][manoeuvre],
            came=tuple(other for other in state.came if other != lane),
        )

    def _put(self, state: State, lane: int, front: Front | None) -> State:
        return state._replace(fronts=(*state.fronts[:lane], front, *state.fronts[lane + 1 :]))

    @cached_property
    def _foes(self) -> tuple[int, ...]:
        """For each movement, those of other arms in conflict with it, as bits."""
        movements, values = self.matrix.movements, self.matrix.values
        return tuple(
            sum(
                1 << k
                for k, other in enumerate(movements)
                if other.origin != one.origin and not values[i, k]
            )
            for i, one in enumerate(movements)
        )

    def _table(self, state: State) -> DecisionTable:
        return _table(self.matrix, self.order, self.priorities, state.turn, state.came)


@lru_cache(maxsize=4096)
def _table(
    matrix: HarmonyMatrix, order: str, priorities: str, turn: int, came: tuple[int, ...]
) -> DecisionTable:
    n = matrix.n
    if priorities == "waiting":
        lanes = [*came, *(lane for lane in range(n) if lane not in came)]
    else:
        lanes = [(turn + k) % n for k in range(n)]
    return decision_table(matrix, order, tuple(lanes.index(lane) for lane in range(n)))
