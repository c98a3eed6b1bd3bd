"""DIM as a transition system over discrete zones: all that its safety and liveness depend on.

The protocol sees little of a vehicle's motion: it comes to the front of its lane, starts to roll,
becomes committed, enters, leaves. So a state holds the front vehicle of each lane before the
junction (the only one that decides anything) and the set of movements inside. However many vehicles
follow each other on one movement, the model is finite. There is no time: whatever can happen next
may happen, in any order and after any delay. Every simulated run is a path of this model
(`dim.proofs.conformance` checks it), but few paths are runs.

All vehicles look at the same moment, as in `dim.controller`, but after an arbitrary delay.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property, lru_cache
from typing import Final, NamedTuple

from dim.agent import GATES
from dim.decision import ORDERS, DecisionTable, decision_table
from dim.harmony import HarmonyMatrix
from dim.perception import COMMITS
from minisim.errors import items
from minisim.junction.movements import Movement, Movements
from minisim.parameters import Takes, checked, declared, part, word

#: Which lane comes first if cliques tie. "fixed": the lanes' own order. "rotating": the lane
#: whose turn it is, then the others clockwise; a turn ends after a decision at the earliest.
#: "waiting": the lane whose front vehicle came first, as if every vehicle remembered it forever.
PRIORITIES = ("fixed", "rotating", "waiting")

#: Phases of a front vehicle. It has been waiting since it came; or it is rolling (commit="paper"
#: only): it has had the right of way, may be anywhere before the point where it is committed, and
#: may roll on there without the right of way; or it is committed.
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

    fronts: tuple[Front | None, ...]  # one per lane
    inside: int = 0  # movements in the junction, bit k for the k-th one
    turn: int = 0  # "rotating" only: the lane whose turn it is
    decided: bool = False  # "rotating" only: whether there was a decision in this turn
    passed: int = 0  # gate "passed" only: bit k·m + j if all inside on k have left the way of j
    came: tuple[int, ...] = ()  # "waiting" only: lanes with a front vehicle, in order of arrival


class Event(NamedTuple):
    """What happens between two states: "arrive", "roll", "commit", "slow", "enter" or "leave" for a
    movement; "pass" for a movement and a foe whose way it leaves; "look" for all vehicles; "turn"
    for the rotating priority."""

    what: str
    lane: int = -1
    manoeuvre: int = 0
    foe: int = -1

    def __str__(self) -> str:
        return f"{self.what} {Movement(self.lane, self.manoeuvre)}" if self.manoeuvre else self.what


LOOK: Final = Event("look")
TURN: Final = Event("turn")

Step = tuple[Event, State]


@declared
class Protocol:
    """The rules of `dim.Dim` and `PRIORITIES`, and the states and events that follow from them."""

    matrix: HarmonyMatrix = part("harmony of the movements", HarmonyMatrix)
    order: str = word("which clique is preferred", ORDERS, default="size")
    gate: str = word("what may enter while others cross", GATES, default="clear")
    commit: str = word("when a vehicle commits", COMMITS, label="commit rule", default="stoppable")
    priorities: str = word("which lane comes first at a tie", PRIORITIES, default="fixed")
    closed: Takes[tuple[str, ...], Iterable[str]] = checked(
        "movements that no vehicle may take",
        lambda title, value: tuple(map(str, items(title, value, "movements"))),
        "movements such as a2", default=(),
    )  # fmt: skip

    def __post_init__(self) -> None:
        for movement in self.closed:
            self.matrix.index(movement)

    @property
    def start(self) -> State:
        """The empty junction."""
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
        """A vehicle comes to the front of a lane: at the yellow zone, or when another enters."""
        for lane, front in enumerate(state.fronts):
            if front is None:
                came = (*state.came, lane) if self.priorities == "waiting" else ()
                for manoeuvre in range(1, self.matrix.choices + 1):
                    if str(Movement(lane, manoeuvre)) in self.closed:
                        continue
                    after = self._put(state, lane, Front(manoeuvre, WAITING, False))
                    yield Event("arrive", lane, manoeuvre), after._replace(came=came)

    def moves(self, state: State) -> Iterator[Step]:
        """What the vehicles that are there can do."""
        paper = self.commit == "paper"
        for lane, front in enumerate(state.fronts):
            if front is None:
                continue
            manoeuvre, phase, goes = front
            if phase == WAITING and goes:
                what, to = ("roll", ROLLING) if paper else ("commit", COMMITTED)
                after = self._put(state, lane, Front(manoeuvre, to, True))
                yield Event(what, lane, manoeuvre), after
            elif phase == ROLLING:  # with the right of way, or no longer able to stop without it
                after = self._put(state, lane, Front(manoeuvre, COMMITTED, goes))
                yield Event("commit", lane, manoeuvre), after
            elif phase == COMMITTED and goes:
                yield Event("enter", lane, manoeuvre), self.entered(state, lane, manoeuvre)
                if not paper:  # behind a slow vehicle it may become able to stop again
                    after = self._put(state, lane, Front(manoeuvre, WAITING, True))
                    yield Event("slow", lane, manoeuvre), after
        for k, movement in enumerate(self.matrix.movements):
            if state.inside >> k & 1:
                yield Event("leave", *movement), self._left(state, k)
                yield from self.passes(state, k)

    def passes(self, state: State, k: int) -> Iterator[Step]:
        """All inside on a movement leave the way of one that is at the front of its lane.

        They may have done so before, but it only matters now; they leave ways in any order.
        """
        if self.gate != "passed":
            return
        rows, m, ahead = self._movements.rows, len(self._foes), self.in_way(state, k)
        for lane, front in enumerate(state.fronts):
            if front is not None and ahead >> (foe := rows[lane][front.manoeuvre]) & 1:
                passed = state.passed | 1 << k * m + foe
                yield Event("pass", *self._movements[k], foe), state._replace(passed=passed)

    def in_way(self, state: State, k: int) -> int:
        """The movements, as bits, in whose way those inside on a movement still are."""
        return self._foes[k] & ~(state.passed >> k * len(self._foes))

    def _left(self, state: State, k: int) -> State:
        """The last vehicle on a movement has left: what it passed, and what passed it, is over."""
        m, (lane, manoeuvre) = len(self._foes), self._movements[k]
        over = (1 << m) - 1 << k * m
        front = state.fronts[lane]
        if front is None or front.manoeuvre != manoeuvre:
            over |= sum(1 << foe * m + k for foe in range(m))
        return state._replace(inside=state.inside ^ 1 << k, passed=state.passed & ~over)

    def look(self, state: State) -> State:
        """All vehicles decide (Algorithm 1, lines 4 to 12).

        A committed vehicle goes. While vehicles cross, the gate "clear" leaves the rest as they
        are, and the others keep out those in conflict (under "passed", those in whose way one is).
        Of the rest, the best clique goes.
        """
        base, rows, bits = self.matrix.choices + 1, self._movements.rows, self._movements.bits
        there = [(lane, front) for lane, front in enumerate(state.fronts) if front is not None]
        committed = [rows[lane][it.manoeuvre] for lane, it in there if it.phase == COMMITTED]
        frozen = bool(state.inside or committed) and self.gate == "clear"
        barred = 0
        for k in range(len(self._foes)):
            barred |= self.in_way(state, k) if state.inside >> k & 1 else 0
        for k in committed:
            barred |= self._foes[k]
        case = 0
        for lane, front in there:
            if front.phase != COMMITTED and not barred & bits[lane][front.manoeuvre]:
                case += front.manoeuvre * base**lane
        table = _table(self.matrix, self.order, self.priorities, state.turn, state.came)
        chosen = 0 if frozen else table.lanes(case)
        fronts = list(state.fronts)
        for lane, (manoeuvre, phase, went) in there:
            goes = phase == COMMITTED or (went if frozen else bool(chosen >> lane & 1))
            fronts[lane] = Front(manoeuvre, phase, goes)
        decided = state.decided or (self.priorities == "rotating" and not frozen and case > 0)
        return state._replace(fronts=tuple(fronts), decided=decided)

    def conflict(self, state: State) -> tuple[Movement, Movement] | None:
        """Two conflicting movements inside at once, neither past the other, or None if safe."""
        movements = self.matrix.movements
        for k in reversed(range(len(movements))):
            if not state.inside >> k & 1:
                continue
            for foe in reversed(range(k)):
                ahead = state.inside & self.in_way(state, k)
                if ahead >> foe & self.in_way(state, foe) >> k & 1:
                    return movements[foe], movements[k]
        return None

    def entered(self, state: State, lane: int, manoeuvre: int) -> State:
        """The state after the front vehicle of a lane has entered."""
        after = self._put(state, lane, None)
        m, k = len(self._foes), self._movements.rows[lane][manoeuvre]
        return after._replace(
            passed=state.passed & ~((1 << m) - 1 << k * m),
            inside=state.inside | self._movements.bits[lane][manoeuvre],
            came=tuple(other for other in state.came if other != lane),
        )

    def _put(self, state: State, lane: int, front: Front | None) -> State:
        return state._replace(fronts=(*state.fronts[:lane], front, *state.fronts[lane + 1 :]))

    @cached_property
    def _movements(self) -> Movements:
        return self.matrix.movements

    @cached_property
    def _foes(self) -> tuple[int, ...]:
        """For each movement, the movements of other arms that conflict with it, as bits."""
        conflicts = ~self.matrix.values & self.matrix.movements.apart
        return tuple(sum(1 << k for k, foe in enumerate(row) if foe) for row in conflicts)


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
