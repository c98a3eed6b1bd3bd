"""The decision: the paper's example, and the offline table (all cases: tests/verification)."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
import pytest

from dim import DecisionTable, HarmonyMatrix, decide, explain
from dim.decision import ORDERS, decision_table
from minisim.errors import InputError
from minisim.junction.movements import Movement
from scenarios import three_way
from tests.builders import python


def text(movements: Iterable[Movement]) -> str:
    return " ".join(map(str, movements))


@pytest.mark.parametrize("order", ORDERS)
def test_the_table_and_the_function_agree(order: str) -> None:
    matrix, ranks = HarmonyMatrix.paper(4), (2, 0, 3, 1)
    table = DecisionTable(matrix, order, ranks)
    for participants in table:
        assert table.decide(participants) == decide(participants, matrix, order, ranks)


def test_the_papers_example() -> None:
    explanation = explain(["a1", "b2", "c2", "d2"], HarmonyMatrix.paper(4))
    assert text(explanation.participants) == "a1 b2 c2 d2"
    assert [text(edge) for edge in explanation.edges] == ["a1 b2", "a1 c2", "b2 d2"]
    assert [text(clique) for clique in explanation.tied] == ["a1 b2", "a1 c2", "b2 d2"]
    assert explanation.cliques == explanation.tied
    assert text(explanation.right_of_way) == "a1 b2"
    assert explanation.reason == (
        "3 cliques tie at the largest size, 2; a1 b2 holds the highest-priority lanes among them "
        "(priority a b c d)."
    )


@pytest.mark.parametrize(
    ("movements", "order", "priorities", "chosen", "reason"),
    [
        ("c3", "size", None, "c3", "c3 is alone."),
        ("a1 b1 c1 d1", "size", None, "a1 b1 c1 d1", "a1 b1 c1 d1 are all in harmony."),
        ("a2 b2", "size", None, "a2", "2 cliques tie at the largest size, 1; a2 holds"),
        ("a2 b2", "size", (3, 2, 1, 0), "b2", "b2 holds .* \\(priority d c b a\\)"),
        ("a2 b1 d2", "size", None, "b1 d2", "b1 d2 is the only clique of 2, the largest size"),
        ("a2 b1 d2", "lanes", None, "a2", "a2 holds the .* all 2 maximal cliques .*, whatever"),
        ("a1 b2 c2 d2", "lanes", (2, 3, 1, 0), "b2 d2", "priority d c a b"),
        ("a1 b2 c2 d2", "size", (1, 3, 0, 2), "a1 c2", "priority c a d b"),
    ],
)
def test_choice_and_reason(
    movements: str, order: str, priorities: tuple[int, ...] | None, chosen: str, reason: str
) -> None:
    matrix = HarmonyMatrix.paper(4)
    explanation = explain(movements.split(), matrix, order, priorities)
    assert text(explanation.right_of_way) == chosen
    assert explanation.cliques[0] == explanation.right_of_way
    assert decide(movements.split(), matrix, order, priorities) == explanation.right_of_way
    assert re.search(reason, explanation.reason)


def test_without_participants_no_vehicle_goes() -> None:
    matrix = HarmonyMatrix.paper(3)
    assert decide([], matrix) == ()
    assert DecisionTable(matrix).lanes(0) == 0
    assert DecisionTable(matrix).decide([]) == ()
    with pytest.raises(InputError, match=r"needs at least one participant, such as a1$"):
        explain([], matrix)


ANSWERS = """
from itertools import product
from dim import DecisionTable, HarmonyMatrix, decide
matrix = HarmonyMatrix.paper(4)
for order in ("size", "lanes"):
    table = DecisionTable(matrix, order)
    for digits in product(range(4), repeat=4):
        # A set of strings: its order depends on the hash seed, the answers must not.
        participants = {f"{'abcd'[lane]}{j}" for lane, j in enumerate(digits) if j}
        print(*table.decide(participants), *decide(participants, matrix, order))
"""


def test_answers_do_not_depend_on_the_hash_seed() -> None:
    seeds = ("0", "1", "20240229")
    (answers,) = {python("-c", ANSWERS, PYTHONHASHSEED=seed).stdout for seed in seeds}
    assert answers.count("\n") == 2 * 4**4


def test_cases_are_the_integers_from_one() -> None:
    table = DecisionTable(HarmonyMatrix.paper(3))
    cases = list(table)
    assert len(cases) == len(set(cases)) == len(table) == 26
    for number, participants in enumerate(cases, start=1):
        assert table.case(participants) == number
        assert table.participants(number) == participants
    assert table.case(["b2", "a1"]) == 1 + 2 * 3
    assert table.participants(0) == ()


def test_an_entry_is_computed_once_and_kept() -> None:
    table = DecisionTable(HarmonyMatrix.paper(4))
    case = table.case(["a1", "b2", "c2", "d2"])
    assert table.lanes(case) == 0b0011
    table.lanes(case)
    assert table.lanes.cache_info().misses == 1
    table.complete()
    assert table.lanes.cache_info().currsize == 255
    table.complete()
    assert table.lanes.cache_info().misses == 255


def test_tables_are_shared() -> None:
    matrix = HarmonyMatrix.paper(4)
    same = HarmonyMatrix(4, np.array(matrix.values))
    assert decision_table(matrix, "size") is decision_table(same, "size")
    assert decision_table(matrix, "lanes") is not decision_table(matrix, "size")


def test_a_table_of_many_arms_is_filled_on_demand_only() -> None:
    free = np.ones((56, 56), dtype=int)
    lane = np.arange(56) // 7
    free[lane[:, None] == lane[None, :]] = 0
    table = DecisionTable(HarmonyMatrix(8, free))
    assert len(table) == 8**8 - 1
    assert text(table.decide(["a1", "h7", "c2"])) == "a1 c2 h7"
    with pytest.raises(InputError, match="8 arms have 16777215 cases"):
        table.complete()


@pytest.mark.parametrize(
    ("movements", "message"),
    [
        (["a1", "a2"], "one participant per lane: lane a has a1 and a2"),
        (["b1", "b1"], "lane b has b1 and b1"),
        (["e1"], "no movement 'e1'"),
        ([5], "no movement 5"),
        ([10**5000], "no movement a int too large"),
        ("a1", "^participants must be a sequence of movements such as a1, b2"),
    ],
)
def test_participants_are_checked(movements: object, message: str) -> None:
    matrix = HarmonyMatrix.paper(4)
    for function in (decide, explain):
        with pytest.raises(InputError, match=message):
            function(movements, matrix)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=message):
        DecisionTable(matrix).case(movements)  # type: ignore[arg-type]


def test_other_arguments_are_checked() -> None:
    matrix = HarmonyMatrix.paper(4)
    with pytest.raises(InputError, match=r"unknown order 'sise'.*did you mean 'size'"):
        decide(["a1"], matrix, "sise")
    with pytest.raises(InputError, match="unknown order"):
        DecisionTable(matrix, "first")
    with pytest.raises(InputError, match="matrix must be a HarmonyMatrix"):
        DecisionTable("paper")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="matrix must be a HarmonyMatrix"):
        decide(["a1"], 4)  # type: ignore[arg-type]
    for case in (-1, 256, 1.0, "1"):
        with pytest.raises(InputError, match="case must be an integer 0 … 255"):
            DecisionTable(matrix).participants(case)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("priorities", "message"),
    [
        ((0, 1, 2, 2), r"priorities of 4 lanes are .* 0 … 3, each once, got \(0, 1, 2, 2\)$"),
        ((0, 1, 2, 3, 4), "priorities of 4 lanes"),
        ("abcd", "priorities must be a sequence of lane ranks"),
        (4, "priorities must be a sequence of lane ranks"),
        ((-1, 0, 1, 2), "lane rank must be an integer of at least 0, got -1"),
        ((0.0, 1, 2, 3), "lane rank must be an integer"),
    ],
)
def test_priorities_are_a_permutation_of_the_lanes(priorities: object, message: str) -> None:
    with pytest.raises(InputError, match=f"^{message}"):
        decide(["a1"], HarmonyMatrix.paper(4), "size", priorities)  # type: ignore[arg-type]


def test_an_unknown_intent_of_a_known_type() -> None:
    """The bus on lane a may want anything, but stays a bus."""
    site = three_way(fleet="car:0.5,bus:0.5", lane_width=3.5).site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.fleet, by_type=True)
    table = DecisionTable(matrix)
    others = [Movement(1, 2), Movement(2, 3)]  # a car and a bus
    unknown = 2 * 3**0
    every = [table.lanes(table.case([Movement(0, j), *others])) for j in (3, 4)]
    assert table.surely(table.case(others), unknown, 0) == every[0] & every[1]
