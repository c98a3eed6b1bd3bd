"""Which vehicles cross: one right of way, the same for all, from the participants' movements.

The participants are the nodes of a graph, with an edge where two movements are in harmony; the
members of a clique can cross at the same time (paper, "Decentralized Intersection Management"). If
there are several cliques, a total order of our own chooses among them, because vehicles that decide
alone must agree, and a graph library lists cliques in an arbitrary order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, reduce
from itertools import combinations, pairwise, product
from operator import and_, mul

import networkx as nx

from dim.harmony import HarmonyMatrix
from minisim.errors import InputError, choice, instance, integer, items, show
from minisim.junction.movements import ARM_NAMES, Movement

#: "size": the largest clique and, among equally large ones, the one with the higher-priority lanes
#: (as the paper words it). "lanes": of all maximal cliques, the one with the higher-priority lanes
#: (as in its published runs).
ORDERS = ("size", "lanes")

#: `DecisionTable.complete` refuses more cases than this: 7 arms have 823,542, 8 arms 17 million.
MAX_CASES = 1_000_000

Movements = tuple[Movement, ...]


def lane_ranks(priorities: Iterable[int] | None, n: int) -> tuple[int, ...]:
    """Rank of each of n lanes, 0 first, by default in order; raises `InputError` for others."""
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

    Args:
        movements: those of the participants, at most one per lane, in any order.
        matrix: harmony of the movements.
        order: "size" or "lanes", see `ORDERS`.
        priorities: rank of each lane, 0 first; by default the lanes' own order.

    Returns:
        The movements that may cross, by lane; empty only when there are no participants.

    Raises:
        InputError: unknown movement or order, two movements of one lane, or priorities that are
            not a permutation of the lanes.
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
    cliques = sorted(
        maximal_cliques(participants, matrix), key=lambda clique: _key(clique, order, ranks)
    )
    largest = max(map(len, cliques))
    tied = tuple(clique for clique in cliques if len(clique) == largest)
    return Explanation(
        participants=participants,
        edges=_edges(participants, matrix),
        cliques=tuple(cliques),
        tied=tied,
        right_of_way=cliques[0],
        reason=_reason(participants, cliques, tied, order, ranks),
    )


class DecisionTable:
    """The decision for every case: the paper's "generated offline, queried online".

    A case says what the front vehicle of each lane wants, with 0 for a lane that has none; n^n − 1
    cases have at least one vehicle. A case is written as the integer Σ manoeuvre·n^lane, so every
    integer 1 … n^n − 1 is a case and 0 is the empty junction. An entry is computed with networkx
    when it is first asked for, and kept. Right of way is an integer with bit i set for lane i.

    Attributes:
        matrix, order, priorities: what the table was made from, as in `decide`.
        lanes: case -> lanes with the right of way; the case is not checked.
        admitted: (case, crossing) -> the case without the participants that conflict with any of
            the movements in `crossing`, an integer with bit k set for the k-th movement. Movements
            of one lane follow each other and are not in conflict.
        surely: (case, unknown, crossing) -> of the lanes that `crossing` admits, those that have
            the right of way whatever the participants on the lanes in `unknown` (bit i for lane i)
            do; the case leaves these participants out.

    Raises:
        InputError: unknown order, or priorities that are not a permutation of the lanes.
    """

    def __init__(
        self,
        matrix: HarmonyMatrix,
        order: str = "size",
        priorities: Sequence[int] | None = None,
    ) -> None:
        instance("matrix", matrix, HarmonyMatrix)
        self.matrix = matrix
        self.order = choice("order", order, ORDERS)
        self.priorities = lane_ranks(priorities, matrix.n)
        self.lanes = cache(self._solve)
        self.admitted = lru_cache(maxsize=1 << 16)(self._admit)
        self.surely = lru_cache(maxsize=1 << 16)(self._agree)

    def case(self, movements: Iterable[Movement | str]) -> int:
        """The case of these participants; raises `InputError` as `decide` does."""
        participants = _participants(movements, self.matrix)
        return sum(m.manoeuvre * self.matrix.n**m.origin for m in participants)

    def participants(self, case: int) -> Movements:
        """The movements of a case, by lane; raises `InputError` for any other integer."""
        n = self.matrix.n
        case = integer("case", case, low=0, high=len(self))
        digits = ((lane, case // n**lane % n) for lane in range(n))
        return tuple(Movement(lane, manoeuvre) for lane, manoeuvre in digits if manoeuvre)

    def decide(self, movements: Iterable[Movement | str]) -> Movements:
        """The right of way, looked up; the same answer and errors as `decide`."""
        case = self.case(movements)
        lanes = self.lanes(case)
        return tuple(m for m in self.participants(case) if lanes >> m.origin & 1)

    def __len__(self) -> int:
        """Number of cases with at least one participant, n^n − 1."""
        return int(self.matrix.n**self.matrix.n) - 1

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

    def _admit(self, case: int, crossing: int) -> int:
        matrix = self.matrix
        occupied = [m for k, m in enumerate(matrix.movements) if crossing >> k & 1]

        def free(movement: Movement) -> bool:
            return all(
                other.origin == movement.origin or matrix.harmony(movement, other)
                for other in occupied
            )

        return self.case(m for m in self.participants(case) if free(m))

    def _agree(self, case: int, unknown: int, crossing: int) -> int:
        n = self.matrix.n
        digits = [n**lane for lane in range(n) if unknown >> lane & 1]
        possible = (
            case + sum(map(mul, manoeuvres, digits))
            for manoeuvres in product(range(1, n), repeat=len(digits))
        )
        return reduce(and_, (self.lanes(self.admitted(c, crossing)) for c in possible))


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
    """All maximal cliques, in no reliable order; each sorted by lane."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(m.origin for m in participants)
    graph.add_edges_from((a.origin, b.origin) for a, b in _edges(participants, matrix))
    by_lane = {m.origin: m for m in participants}
    return [tuple(by_lane[lane] for lane in sorted(c)) for c in nx.find_cliques(graph)]


def _key(clique: Movements, order: str, ranks: tuple[int, ...]) -> tuple[int, list[int]]:
    """A total order of maximal cliques: none contains another, so no two have equal ranks."""
    size = -len(clique) if order == "size" else 0
    return size, sorted(ranks[m.origin] for m in clique)


def choose(cliques: list[Movements], order: str, ranks: tuple[int, ...]) -> Movements:
    """The preferred one of the `maximal_cliques`, whatever order they come in."""
    return min(cliques, key=lambda clique: _key(clique, order, ranks), default=())


def _reason(
    participants: Movements,
    cliques: list[Movements],
    tied: tuple[Movements, ...],
    order: str,
    ranks: tuple[int, ...],
) -> str:
    chosen, n = cliques[0], len(ranks)
    names = " ".join(map(str, chosen))
    lanes = " ".join(ARM_NAMES[lane] for lane in sorted(range(n), key=ranks.__getitem__))
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
        return f"{names} is the only clique of {len(chosen)}, the largest size."
    return (
        f"{len(tied)} cliques tie at the largest size, {len(chosen)}; "
        f"{names} holds the highest-priority lanes among them (priority {lanes})."
    )
