"""All cases of 3, 4, 5 (and 6) arms, and that the checks can fail."""

from __future__ import annotations

from collections import defaultdict
from types import SimpleNamespace
from typing import Any

import networkx as nx
import pytest

from dim import DecisionTable, HarmonyMatrix, explain
from dim.decision import maximal_cliques
from dim.proofs.verification import (
    Analysis,
    Case,
    analyse,
    brute_force,
    most_cliques,
    node_orders,
    preferred,
)  # fmt: skip
from minisim.errors import InputError
from minisim.junction.movements import Movement
from scenarios import regular

#: Cases by arms: n^n − 1 (the paper's 255 for 4).
CASES = {3: 26, 4: 255, 5: 3124, 6: 46655}

#: Moon & Moser (1965): the most cliques that n nodes can have.
BOUND = {3: 3, 4: 4, 5: 6, 6: 9}

#: In how many cases lanes first chooses a smaller clique than size first, by an implementation
#: that shares no code with ours (the authors', run on their matrices).
SMALLER = {3: 1, 4: 26, 5: 508}


def matrix_of(n: int) -> HarmonyMatrix:
    site = regular(n).site()
    return HarmonyMatrix.from_geometry(site.intersection, site.vehicle)


def check(analysis: Analysis, n: int) -> None:
    assert analysis.cases == CASES[n]
    assert {claim.cases for claim in analysis.claims} == {CASES[n]}
    assert sum(analysis.sizes.values()) == sum(analysis.ties.values()) == CASES[n]
    assert analysis.most_tied == BOUND[n] == most_cliques(n)
    assert sum(count for _, count in analysis.worst.values()) == analysis.ties[BOUND[n]]
    for size, (movements, _) in analysis.worst.items():
        tied = explain(movements, analysis.matrix).tied
        assert (len(tied), len(tied[0])) == (BOUND[n], size)


@pytest.mark.parametrize("n", [3, 4, 5, pytest.param(6, marks=pytest.mark.slow)])
def test_every_claim_holds_in_every_case(n: int) -> None:
    told: list[tuple[int, int]] = []
    matrix = HarmonyMatrix.paper(n) if n < 6 else matrix_of(n)
    analysis = analyse(matrix, progress=lambda *done: told.append(done))
    assert analysis.holds, [claim for claim in analysis.claims if not claim.holds]
    check(analysis, n)
    assert told == [(case, CASES[n]) for case in [*range(256, CASES[n], 256), CASES[n]]]


@pytest.mark.parametrize("n", [3, 4])
def test_every_claim_holds_with_types_told_apart(n: int) -> None:
    site = regular(n, fleet="car:0.5,bus:0.5", lane_width=3.5).site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.fleet, by_type=True)
    analysis = analyse(matrix)
    assert analysis.cases == (2 * (n - 1) + 1) ** n - 1
    assert analysis.holds, [claim for claim in analysis.claims if not claim.holds]


@pytest.mark.parametrize("n", [3, 4])
def test_lanes_first_is_not_always_the_largest(n: int) -> None:
    analysis = analyse(HarmonyMatrix.paper(n), "lanes")
    false = {claim.name: claim.failures for claim in analysis.claims if not claim.holds}
    assert false == {"largest": SMALLER[n]}
    check(analysis, n)
    by_lanes, by_size = (DecisionTable(analysis.matrix, order) for order in ("lanes", "size"))
    differing = [m for m in by_size if by_lanes.decide(m) != by_size.decide(m)]
    for claim in analysis.claims:
        assert claim.example == (None if claim.holds else min(differing, key=len))


@pytest.mark.parametrize("order", ["size", "lanes"])
def test_the_claims_hold_with_given_priorities(order: str) -> None:
    analysis = analyse(HarmonyMatrix.paper(4), order, (2, 3, 1, 0))
    assert analysis.priorities == (2, 3, 1, 0)
    assert {c.name for c in analysis.claims if not c.holds} <= {"largest"}
    assert analysis.holds == (order == "size")


def test_a_closed_movement_must_exist() -> None:
    """Of the 26 cases of three arms, those without a1 remain: 2 · 3 · 3 − 1."""
    assert analyse(HarmonyMatrix.paper(3), closed=["a1"]).cases == 17
    with pytest.raises(InputError, match="no movement 'a3'"):
        analyse(HarmonyMatrix.paper(3), closed=["a3"])


def test_ties_of_the_papers_255_cases() -> None:
    analysis = analyse(HarmonyMatrix.paper(4))
    assert analysis.tied == 130
    assert analysis.ties == {1: 125, 2: 88, 3: 36, 4: 6}
    worst = {size: count for size, (_, count) in analysis.worst.items()}
    assert worst == {1: 4, 2: 2}  # no two in harmony, and a ring


def test_the_papers_worst_case() -> None:
    """A, C left and B, D "straight(3)": with 3 all are in harmony; with 2, straight, four cliques
    tie, but they are AB, AC, BD, CD, not the ring ABCD of the paper's figure."""
    matrix = HarmonyMatrix.paper(4)
    assert len(explain(["a1", "b3", "c1", "d3"], matrix).cliques[0]) == 4
    explanation = explain(["a1", "b2", "c1", "d2"], matrix)
    names = [" ".join(map(str, clique)) for clique in explanation.tied]
    assert names == ["a1 b2", "a1 c1", "b2 d2", "c1 d2"]
    assert explanation.right_of_way == explanation.tied[0]


def test_the_tie_break_in_the_papers_words() -> None:
    """[A,B], [B,C], [C,D], [D,A]: "contain the highest priority lane A, and after A, B"."""
    ring = (0b0011, 0b0110, 0b1100, 0b1001)
    assert preferred(ring, (0, 1, 2, 3)) == (0b0011,)
    assert preferred(ring, (2, 3, 0, 1)) == (0b1100,)
    assert preferred((0b0111, 0b1011), (3, 2, 1, 0)) == (0b1011,)


def test_the_cliques_of_every_graph_are_those_that_networkx_finds() -> None:
    """Of up to 7 nodes; and no graph has more of them than Moon and Moser say."""
    most: dict[int, int] = defaultdict(int)
    for graph in nx.graph_atlas_g()[1:]:
        matrix: Any = SimpleNamespace(harmony=lambda a, b, g=graph: g.has_edge(a.origin, b.origin))
        found = maximal_cliques(tuple(Movement(lane, 1) for lane in graph), matrix)
        lanes = [tuple(m.origin for m in clique) for clique in found]
        assert sorted(lanes) == sorted(tuple(sorted(clique)) for clique in nx.find_cliques(graph))
        most[len(graph)] = max(most[len(graph)], len(found))
    assert dict(most) == {k: most_cliques(k) for k in range(1, 8)}


def test_orders() -> None:
    four = tuple(Movement(lane, 1) for lane in range(4))
    assert len(set(node_orders(four, 4))) == 24
    around = list(node_orders(four, 6))
    assert len(set(around)) == 8
    assert {order[0] for order in around} == set(four)
    a, b, c, d = four
    assert around[:4] == [(a, b, c, d), (a, d, c, b), (b, c, d, a), (b, a, d, c)]


WRONG = {
    "exists": lambda right, case: 0,
    "harmony": lambda right, case: 0b1111 if case == 64 * 2 + 16 * 2 + 4 * 2 + 2 else right,
    "largest": lambda right, case: right & -right,
    "maximal": lambda right, case: right & (right - 1) or right,
    "priority": lambda right, case: 0b1000 if case >= 64 else right,
    "unique": lambda right, case: 0b1000 if case >= 64 else right,
}


@pytest.mark.parametrize("claim", WRONG)
def test_a_wrong_table_is_found(claim: str) -> None:
    table = DecisionTable(HarmonyMatrix.paper(4))
    right = table.lanes
    table.lanes = lambda case: WRONG[claim](right(case), case)  # type: ignore[assignment]
    checked = Case(table)
    answers = [
        checked.check(case, movements, brute_force(movements, table.matrix))
        for case, movements in enumerate(table, start=1)
    ]
    index = list(Case.CLAIMS).index(claim)
    assert not all(answer[index] for answer in answers)


def test_answers_that_depend_on_the_order_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first of the largest that are found, as in the paper: it is not unanimous."""
    monkeypatch.setattr("dim.proofs.verification.choose", lambda cliques, *_: max(cliques, key=len))
    analysis = analyse(HarmonyMatrix.paper(4))
    assert [claim.name for claim in analysis.claims if not claim.holds] == ["order"]
