"""Which vehicles cross: one right of way, the same for all, from the participants' movements.

The participants are the nodes of a graph, with an edge between two movements in harmony; a clique
can cross at the same time (paper, "Decentralized Intersection Management"). Vehicles that decide
alone must agree, and graph libraries list cliques in any order, so a total order of ours chooses.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, reduce
from itertools import combinations, pairwise, product
from operator import and_

from dim.harmony import HarmonyMatrix
from minisim.errors import InputError, choice, instance, integer, items, show
from minisim.junction.movements import ARM_NAMES, Movement

#: "size": the largest clique and, among equals, the one with the higher-priority lanes (as the
#: paper words it). "lanes": of all maximal cliques, the one with those (as in its published runs).
ORDERS = ("size", "lanes")

MAX_CASES = 1_000_000  #: more are not tried: 7 arms have 823,542 cases, 8 arms 17 million

Movements = tuple[Movement, ...]


def lane_ranks(priorities: Iterable[int] | None, n: int) -> tuple[int, ...]:
    """Rank of each of n lanes, 0 first, by default in order; may raise `InputError`."""
    if priorities is None:
        return tuple(range(n))
    given = items("priorities", priorities, "lane ranks")
    ranks = tuple(integer("lane rank", rank, low=0) for rank in given)
    if sorted(ranks) != list(range(n)):
        raise InputError(
            f"priorities of {n} lanes are the ranks 0 … {n - 1}, each once, got {show(ranks)}"
        )
    return ranks


def decide(
    movements: Iterable[Movement | str],
    matrix: HarmonyMatrix,
    order: str = "size",
    priorities: Sequence[int] | None = None,
) -> Movements:
    """The right of way among participants: a pure function of the set of their movements.

    There is at most one participant per lane. `order` is one of `ORDERS`; `priorities` are the
    ranks of the lanes, 0 first, by default in their own order.

    Returns the movements that may cross, by lane; empty only without participants. Raises
    `InputError` for an unknown movement or order, two movements of one lane, or wrong priorities.
    """
    participants = _participants(movements, matrix)
    choice("order", order, ORDERS)
    ranks = lane_ranks(priorities, matrix.n)
    return choose(maximal_cliques(participants, matrix), order, ranks)


@dataclass(frozen=True)
class Explanation:
    """A decision and how it came about, for teaching."""

    participants: Movements  # by lane
    edges: tuple[tuple[Movement, Movement], ...]  # pairs in harmony
    cliques: tuple[Movements, ...]  # all maximal ones, the preferred one first
    tied: tuple[Movements, ...]  # those of the largest size, in the same order
    right_of_way: Movements  # the first of `cliques`
    reason: str  # in one sentence


def explain(
    movements: Iterable[Movement | str],
    matrix: HarmonyMatrix,
    order: str = "size",
    priorities: Sequence[int] | None = None,
) -> Explanation:
    """`decide`, with the graph and all that was chosen from; `InputError` without participants."""
    participants = _participants(movements, matrix)
    if not participants:
        raise InputError("a decision needs at least one participant, such as a1")
    choice("order", order, ORDERS)
    ranks = lane_ranks(priorities, matrix.n)
    found = maximal_cliques(participants, matrix)
    cliques = tuple(sorted(found, key=lambda clique: _key(clique, order, ranks)))
    largest = max(map(len, cliques))
    tied = tuple(clique for clique in cliques if len(clique) == largest)
    reason = _reason(participants, cliques, tied, order, ranks)
    edges = _edges(participants, matrix)
    return Explanation(participants, edges, cliques, tied, cliques[0], reason)


class DecisionTable:
    """The decision for every case: the paper's "generated offline, queried online".

    A case is what the front vehicle of each lane wants, 0 for none, written as the integer
    Σ manoeuvre·n^lane. So every integer 1 … n^n − 1 is a case, and 0 is the empty junction. An
    entry is computed when first asked for, and kept. Bit i of a right of way is set for lane i.
    A matrix that tells types apart has c manoeuvres per lane, and c + 1 takes the place of n.

    Attributes:
        matrix, order, priorities: what the table was made from, as in `decide`.
        lanes: case -> lanes with the right of way; the case is not checked.
        admitted: (case, crossing, barred) -> the case without the participants that conflict with
            any movement in `crossing` (bit k for the k-th), or whose own is in `barred` (default
            none). Movements of one lane follow each other and are not in conflict.
        surely: (case, unknown, crossing, barred) -> of the lanes that are admitted, those that
            have the right of way whatever the participants on the lanes in `unknown` do (bit i for
            lane i; with types, Σ (1 + type)·(1 + types)^lane); the case leaves these participants
            out.

    Raises `InputError`: unknown order, or priorities that are not a permutation of the lanes.
    """

    def __init__(
        self, matrix: HarmonyMatrix, order: str = "size", priorities: Sequence[int] | None = None
    ) -> None:
        instance("matrix", matrix, HarmonyMatrix)
        self.matrix, self.base = matrix, matrix.choices + 1
        self.order = choice("order", order, ORDERS)
        self.priorities = lane_ranks(priorities, matrix.n)
        self.lanes = cache(self._solve)
        self.admitted = lru_cache(maxsize=1 << 16)(self._admit)
        self.surely = lru_cache(maxsize=1 << 16)(self._agree)

    def case(self, movements: Iterable[Movement | str]) -> int:
        """The case of these participants; raises `InputError` as `decide` does."""
        participants = _participants(movements, self.matrix)
        return sum(m.manoeuvre * self.base**m.origin for m in participants)

    def participants(self, case: int) -> Movements:
        """The movements of a case, by lane; raises `InputError` for any other integer."""
        base = self.base
        case = integer("case", case, low=0, high=len(self))
        digits = ((lane, case // base**lane % base) for lane in range(self.matrix.n))
        return tuple(Movement(lane, manoeuvre) for lane, manoeuvre in digits if manoeuvre)

    def decide(self, movements: Iterable[Movement | str]) -> Movements:
        """The right of way, looked up; the same answer and errors as `decide`."""
        case = self.case(movements)
        lanes = self.lanes(case)
        return tuple(m for m in self.participants(case) if lanes >> m.origin & 1)

    def __len__(self) -> int:
        """Number of cases with at least one participant, n^n − 1 without types."""
        return int(self.base**self.matrix.n) - 1

    def __iter__(self) -> Iterator[Movements]:
        """The participants of every case, from case 1 on."""
        return (self.participants(case) for case in range(1, len(self) + 1))

    def complete(self) -> None:
        """Compute every entry now; raises `InputError` if there are too many (from 8 arms)."""
        if len(self) > MAX_CASES:
            raise InputError(
                f"{self.matrix.n} arms have {len(self)} cases, too many to compute in advance "
                f"(at most {MAX_CASES}); entries are computed when they are asked for"
            )
        for case in range(1, len(self) + 1):
            self.lanes(case)

    def _solve(self, case: int) -> int:
        chosen = decide(self.participants(case), self.matrix, self.order, self.priorities)
        return sum(1 << m.origin for m in chosen)

    def _admit(self, case: int, crossing: int, barred: int = 0) -> int:
        matrix = self.matrix
        occupied = [m for k, m in enumerate(matrix.movements) if crossing >> k & 1]
        return self.case(
            m
            for m in self.participants(case)
            if not barred >> matrix.index(m) & 1
            and all(m.origin == other.origin or matrix.harmony(m, other) for other in occupied)
        )

    def _agree(self, case: int, unknown: int, crossing: int, barred: int = 0) -> int:
        turns, base = self.matrix.n - 1, self.matrix.types + 1
        kinds = ((lane, unknown // base**lane % base) for lane in range(self.matrix.n))
        options = [
            [manoeuvre * self.base**lane for manoeuvre in range((k - 1) * turns + 1, k * turns + 1)]
            for lane, k in kinds if k
        ]  # fmt: skip
        possible = (case + sum(several) for several in product(*options))
        return reduce(and_, (self.lanes(self.admitted(c, crossing, barred)) for c in possible))


@lru_cache(maxsize=1024)
def decision_table(
    matrix: HarmonyMatrix, order: str = "size", priorities: tuple[int, ...] | None = None
) -> DecisionTable:
    """The table of these rules, one for all runs of a process."""
    return DecisionTable(matrix, order, priorities)


def _participants(movements: Iterable[Movement | str], matrix: HarmonyMatrix) -> Movements:
    """The movements by lane, checked."""
    instance("matrix", matrix, HarmonyMatrix)
    given = items("participants", movements, "movements such as a1, b2", ordered=False)
    participants = sorted(matrix.movements[matrix.index(m)] for m in given)
    for one, other in pairwise(participants):
        if one.origin == other.origin:
            raise InputError(
                f"one participant per lane: lane {ARM_NAMES[one.origin]} has {one} and {other}"
            )
    return tuple(participants)


def _edges(participants: Movements, matrix: HarmonyMatrix) -> tuple[tuple[Movement, Movement], ...]:
    return tuple(pair for pair in combinations(participants, 2) if matrix.harmony(*pair))


def maximal_cliques(participants: Movements, matrix: HarmonyMatrix) -> list[Movements]:
    """All maximal cliques, in no reliable order; each sorted by lane.

    Source: Bron & Kerbosch 1973, Communications of the ACM 16:575, algorithm 457, version 2, but
    with the first node as the pivot. A set of nodes is an integer: bit k for participant k.
    """
    near = [0] * len(participants)
    for (j, one), (k, other) in combinations(enumerate(participants), 2):
        if matrix.harmony(one, other):
            near[j] |= 1 << k
            near[k] |= 1 << j

    def grown(clique: int, more: int, done: int) -> Iterator[int]:
        """The cliques with nodes of `more`, which can all be added; with `done` they are known."""
        if not more | done:
            yield clique
            return
        todo = more & ~near[_first(more | done)]
        while todo:
            k = _first(todo)
            yield from grown(clique | 1 << k, more & near[k], done & near[k])
            todo, more, done = todo & ~(1 << k), more & ~(1 << k), done | 1 << k

    found = grown(0, (1 << len(participants)) - 1, 0) if participants else ()
    return [
        tuple(sorted(m for k, m in enumerate(participants) if clique >> k & 1)) for clique in found
    ]


def _first(nodes: int) -> int:
    """The lowest bit that is set."""
    return (nodes & -nodes).bit_length() - 1


def _key(clique: Movements, order: str, ranks: tuple[int, ...]) -> tuple[int, list[int]]:
    """A total order of maximal cliques: none contains another, so no two have equal ranks."""
    size = -len(clique) if order == "size" else 0
    return size, sorted(ranks[m.origin] for m in clique)


def choose(cliques: list[Movements], order: str, ranks: tuple[int, ...]) -> Movements:
    """The preferred one of the `maximal_cliques`, whatever order they come in."""
    return min(cliques, key=lambda clique: _key(clique, order, ranks), default=())


def _reason(
    participants: Movements,
    cliques: tuple[Movements, ...],
    tied: tuple[Movements, ...],
    order: str,
    ranks: tuple[int, ...],
) -> str:
    names = " ".join(map(str, cliques[0]))
    lanes = " ".join(ARM_NAMES[ranks.index(rank)] for rank in range(len(ranks)))
    if len(participants) == 1:
        return f"{names} is alone."
    if len(cliques) == 1:
        return f"{names} are all in harmony."
    if order == "lanes":
        return (
            f"{names} holds the highest-priority lanes of all {len(cliques)} maximal cliques "
            f"(priority {lanes}), whatever their size."
        )
    if len(tied) == 1:
        return f"{names} is the only clique of {len(cliques[0])}, the largest size."
    return (
        f"{len(tied)} cliques tie at the largest size, {len(cliques[0])}; "
        f"{names} holds the highest-priority lanes among them (priority {lanes})."
    )
