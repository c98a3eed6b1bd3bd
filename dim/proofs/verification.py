"""Every case that can arise at a junction, checked one by one against brute force.

The paper argues that each of the 255 cases of 4 arms has one solution, the same for every vehicle
("Deadlock Analysis"). Here all cases of any matrix are tried, and the decision is compared with
one that is found from the subsets of the participants, without a graph library.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import permutations
from operator import or_
from typing import NamedTuple

from dim.agent import Agent, Rules
from dim.decision import MAX_CASES, DecisionTable, Movements, choose, maximal_cliques
from dim.harmony import HarmonyMatrix
from dim.perception import Percept
from minisim.errors import InputError

#: Up to this number of arms, the participants are listed in every order (120 per case with 5 arms);
#: beyond it, only as each would list them: itself first, then the others around, either way.
ALL_ORDERS = 5

Lanes = int  #: a set of lanes, bit i for lane i
Progress = Callable[[int, int], object]  #: called with the number of cases done and the total


class Cliques(NamedTuple):
    """The cliques of a case that no other participant can join, and the largest of them."""

    maximal: tuple[Lanes, ...]
    largest: tuple[Lanes, ...]


@dataclass(frozen=True)
class Claim:
    """One statement about every case."""

    name: str
    statement: str
    cases: int  # number of cases in which it was tried
    failures: int  # number of cases in which it is false
    example: Movements | None  # the first false case with the fewest participants

    @property
    def holds(self) -> bool:
        """Whether it is true in every case."""
        return self.failures == 0


@dataclass(frozen=True)
class Analysis:
    """The result of all n^n − 1 cases of a matrix, by the rules of `dim.decide`."""

    matrix: HarmonyMatrix
    order: str
    priorities: tuple[int, ...]
    cases: int
    claims: tuple[Claim, ...]
    sizes: Mapping[int, int]  #: cases by the number of vehicles that may go
    ties: Mapping[int, int]  #: cases by the number of cliques of the largest size
    #: That size -> the first of the cases with the most such cliques, and how many such cases.
    worst: Mapping[int, tuple[Movements, int]]

    @property
    def n(self) -> int:
        """Number of arms."""
        return self.matrix.n

    @property
    def holds(self) -> bool:
        """Whether every claim is true."""
        return all(claim.holds for claim in self.claims)

    @property
    def tied(self) -> int:
        """Number of cases in which cliques tie."""
        return sum(cases for cliques, cases in self.ties.items() if cliques > 1)

    @property
    def most_tied(self) -> int:
        """The largest number of cliques that tie."""
        return max(self.ties)


def analyse(
    matrix: HarmonyMatrix,
    order: str = "size",
    priorities: Sequence[int] | None = None,
    closed: Iterable[str] = (),
    progress: Progress | None = None,
) -> Analysis:
    """Try all cases (20 s for 6 arms) but those with a movement that is `closed`, such as "a2".

    `order` and `priorities` are those of `dim.Dim`. Raises `InputError` as `DecisionTable`, for a
    movement that does not exist, and from 8 arms on.
    """
    table = DecisionTable(matrix, order, priorities)
    n, total = matrix.n, len(table)
    if total > MAX_CASES:
        raise InputError(f"{n} arms have {total} cases, too many to try all (at most {MAX_CASES})")
    checks = Case(table)
    failures: Counter[str] = Counter()
    examples: dict[str, Movements] = {}
    sizes: Counter[int] = Counter()
    ties: Counter[int] = Counter()
    worst: dict[int, tuple[Movements, int]] = {}
    tried, shut = 0, {str(matrix.movements[matrix.index(it)]) for it in closed}
    for case, movements in enumerate(table, start=1):
        if progress is not None and (case % 256 == 0 or case == total):
            progress(case, total)
        if not shut.isdisjoint(map(str, movements)):
            continue
        tried += 1
        cliques = brute_force(movements, matrix)
        for name, holds in zip(Case.CLAIMS, checks.check(case, movements, cliques), strict=True):
            if not holds:
                failures[name] += 1
                examples[name] = min(examples.get(name, movements), movements, key=len)
        sizes[table.lanes(case).bit_count()] += 1
        tied, size = len(cliques.largest), cliques.largest[0].bit_count()
        if tied > max(ties, default=0):
            worst = {}
        ties[tied] += 1
        if tied == max(ties):
            first, count = worst.get(size, (movements, 0))
            worst[size] = first, count + 1
    claims = tuple(
        Claim(name, text, tried, failures[name], examples.get(name))
        for name, text in Case.CLAIMS.items()
    )
    return Analysis(
        matrix, table.order, table.priorities, tried, claims,
        dict(sorted(sizes.items())), dict(sorted(ties.items())), dict(sorted(worst.items())),
    )  # fmt: skip


def brute_force(movements: Movements, matrix: HarmonyMatrix) -> Cliques:
    """The cliques among k participants (at most one per lane), from all 2^k subsets of them.

    Nothing of `dim.decision` is used, so that it can be compared with this.
    """
    k = len(movements)
    rows = [matrix.index(m) for m in movements]
    friends = [sum(1 << j for j in range(k) if matrix.values[i, rows[j]]) for i in rows]
    clique = [True] * (1 << k)
    for subset in range(1, 1 << k):
        rest = subset & (subset - 1)
        lowest = (subset ^ rest).bit_length() - 1
        clique[subset] = clique[rest] and rest & ~friends[lowest] == 0

    def lanes(subset: int) -> Lanes:
        return sum(1 << m.origin for j, m in enumerate(movements) if subset >> j & 1)

    maximal = tuple(
        lanes(subset)
        for subset in range(1, 1 << k)
        if clique[subset]
        and not any(clique[subset | 1 << j] for j in range(k) if not subset >> j & 1)
    )
    most = max(map(int.bit_count, maximal), default=0)
    return Cliques(maximal, tuple(found for found in maximal if found.bit_count() == most))


def preferred(cliques: Iterable[Lanes], by_priority: Sequence[int]) -> tuple[Lanes, ...]:
    """Which tied cliques the paper's wording prefers, with the lanes by priority.

    "The clique with the highest priority lanes" holds the first lane, if any does, then the second…
    """
    left = tuple(cliques)
    for lane in by_priority:
        left = tuple(clique for clique in left if clique >> lane & 1) or left
    return left


def node_orders(movements: Movements, n: int) -> Iterator[Movements]:
    """Orders in which participants at a junction of n arms may list each other (`ALL_ORDERS`)."""
    if n <= ALL_ORDERS:
        yield from permutations(movements)
        return
    for k in range(len(movements)):
        own = movements[k:] + movements[:k]
        yield own
        yield own[:1] + own[:0:-1]


class Case:
    """The checks of each case, by the rules of one table of decisions."""

    #: Name -> statement, in the order in which `check` answers.
    CLAIMS: Mapping[str, str] = {
        "exists": "a vehicle may go",
        "harmony": "all that may go are in harmony, and take part",
        "largest": "no larger set of participants is in harmony",
        "maximal": "no other participant could go with them",
        "unique": "the tie-break leaves one clique, and it is the decision",
        "priority": "it holds the highest-priority lane of all cliques that tie",
        "unanimous": "every participant answers for itself as the decision says",
        "order": "it is the same in whatever order the participants are listed",
    }

    def __init__(self, table: DecisionTable) -> None:
        n = table.matrix.n
        self.table = table
        self.by_priority = tuple(sorted(range(n), key=table.priorities.__getitem__))
        self._agents = tuple(Agent(lane, lane, Rules(table)) for lane in range(n))
        self._same_order: dict[tuple[Lanes, tuple[int, ...]], bool] = {}

    def check(self, case: int, movements: Movements, cliques: Cliques) -> tuple[bool, ...]:
        """Whether each claim is true in a case."""
        decision = self.table.lanes(case)
        present = sum(1 << m.origin for m in movements)
        candidates = cliques.largest if self.table.order == "size" else cliques.maximal
        offered = reduce(or_, candidates)
        first = next((lane for lane in self.by_priority if offered >> lane & 1), 0)
        return (
            decision != 0,
            decision & ~present == 0 and any(decision & ~c == 0 for c in cliques.maximal),
            decision.bit_count() == cliques.largest[0].bit_count(),
            decision in cliques.maximal,
            preferred(candidates, self.by_priority) == (decision,),
            bool(decision >> first & 1),
            self._agents_say(case, movements) == decision,
            self._same_in_any_order(movements, decision),
        )

    def _agents_say(self, case: int, movements: Movements) -> Lanes:
        """The lanes whose agents go, each asked on its own, while no vehicle crosses."""
        lanes = tuple(m.origin for m in movements)
        percept = Percept(participants=lanes, crossing=(), case=case, occupied=0)
        return sum(1 << lane for lane in lanes if self._agents[lane].decide(percept))

    def _same_in_any_order(self, movements: Movements, decision: Lanes) -> bool:
        """Whether the graph, built in every order, gives the decision; once for each graph."""
        matrix, table = self.table.matrix, self.table
        rows = [matrix.index(m) for m in movements]
        edges = tuple(int(matrix.values[i, j]) for i in rows for j in rows)
        graph = sum(1 << m.origin for m in movements), edges
        if graph not in self._same_order:
            chosen = (
                choose(maximal_cliques(order, matrix), table.order, table.priorities)
                for order in node_orders(movements, matrix.n)
            )
            decisions = {sum(1 << m.origin for m in clique) for clique in chosen}
            self._same_order[graph] = decisions == {decision}
        return self._same_order[graph]


def most_cliques(k: int) -> int:
    """The most maximal cliques that any graph of k ≥ 1 nodes can have.

    Moon & Moser, "On cliques in graphs", Israel J. Math. 3 (1965): 3^(k/3), or as close to it as
    groups of 2, 3 and 4 nodes can come. All cliques of that graph have one size, so they tie.
    """
    if k < 2:
        return 1
    last = {0: 3, 1: 4, 2: 2}[k % 3]
    return int(last * 3 ** ((k - last) // 3))
