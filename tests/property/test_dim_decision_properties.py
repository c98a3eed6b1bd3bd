"""The decision on random harmony matrices, not only on those of real junctions."""

from __future__ import annotations

import itertools
from random import Random

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from dim import DecisionTable, HarmonyMatrix, decide, explain
from dim.decision import ORDERS
from minisim.junction.movements import Movement


@st.composite
def matrices(draw: st.DrawFn) -> HarmonyMatrix:
    """Any symmetric 0/1 matrix without harmony in a lane, 3 … 7 arms, sparse to dense."""
    n = draw(st.integers(3, 7))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    upper = np.triu(rng.random((n * (n - 1),) * 2) < draw(st.floats(0.0, 1.0)), 1)
    lane = np.repeat(np.arange(n), n - 1)
    return HarmonyMatrix(n, (upper | upper.T) & (lane[:, None] != lane[None, :]))


Case = tuple[HarmonyMatrix, list[Movement], str, tuple[int, ...]]


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A matrix, participants in random order, an order and priorities."""
    matrix = draw(matrices())
    wishes = draw(st.lists(st.integers(0, matrix.n - 1), min_size=matrix.n, max_size=matrix.n))
    participants = [Movement(lane, j) for lane, j in enumerate(wishes) if j]
    ranks = draw(st.permutations(range(matrix.n)))
    order = draw(st.sampled_from(ORDERS))
    return matrix, draw(st.permutations(participants)), order, tuple(ranks)


@given(cases())
def test_the_right_of_way_is_a_best_maximal_clique(case: Case) -> None:
    matrix, participants, order, ranks = case
    chosen = decide(participants, matrix, order, ranks)
    assert set(chosen) <= set(participants)
    assert bool(chosen) == bool(participants)
    assert all(matrix.harmony(a, b) for a, b in itertools.combinations(chosen, 2))
    outside = set(participants) - set(chosen)
    assert not any(all(matrix.harmony(m, other) for other in chosen) for m in outside)
    if participants and order == "lanes":  # the highest-priority lane present always goes
        first = min(participants, key=lambda m: ranks[m.origin])
        assert first in chosen
    if participants:
        explained = explain(participants, matrix, order, ranks)
        assert len(chosen) <= len(explained.tied[0])
        assert explained.right_of_way == chosen
    assert DecisionTable(matrix, order, ranks).decide(participants) == chosen
    assert decide(sorted(participants), matrix, order, ranks) == chosen


@given(cases(), st.randoms(use_true_random=False))
def test_that_some_go_first_does_not_change_which_go_with_them(case: Case, random: Random) -> None:
    """Why the gate "harmonious" needs no wake-up when a vehicle commits (dim.controller).

    Some movements cross, also of the participants' own lanes. When some of the chosen then cross
    too and block their lanes, the rest is the best of those still admitted.
    """
    matrix, participants, order, ranks = case
    table = DecisionTable(matrix, order, ranks)
    crossing = set(random.sample(matrix.movements, random.randint(0, 3)))

    def chosen(waiting: set[Movement], crossing: set[Movement]) -> set[Movement]:
        occupied = sum(1 << matrix.index(m) for m in crossing)
        lanes = table.lanes(table.admitted(table.case(waiting), occupied))
        return {m for m in waiting if lanes >> m.origin & 1}

    before = chosen(set(participants), crossing)
    gone = {m for m in sorted(before) if random.random() < 0.5}
    assert chosen(set(participants) - gone, crossing | gone) == before - gone


@given(cases(), st.integers(min_value=0), st.data())
def test_with_unknown_intents_those_go_that_go_in_every_case_that_may_be_meant(
    case: Case, hidden: int, data: st.DataObject
) -> None:
    """Also beside up to three crossing vehicles."""
    matrix, movements, order, ranks = case
    assume(matrix.n <= 5)  # (n−1)^n cases are compared
    table = DecisionTable(matrix, order, ranks)
    known = [m for m in movements if not hidden >> m.origin & 1]
    unknown = sorted({m.origin for m in movements} - {m.origin for m in known})
    inside = data.draw(st.lists(st.sampled_from(matrix.movements), max_size=3))
    goes = []
    for wishes in itertools.product(range(1, matrix.n), repeat=len(unknown)):
        meant = [*known, *map(Movement, unknown, wishes)]
        admitted = [
            m for m in meant
            if all(m.origin == other.origin or matrix.harmony(m, other) for other in inside)
        ]  # fmt: skip
        goes.append({m.origin for m in decide(admitted, matrix, order, ranks)})
    crossing = sum({1 << matrix.index(m) for m in inside})
    lanes = table.surely(table.case(known), sum(1 << lane for lane in unknown), crossing)
    assert lanes == sum(1 << lane for lane in set.intersection(*goes))
