"""Movements and their indices, and that no other room counts them by hand."""

from __future__ import annotations

import ast
import pickle
from pathlib import Path

import numpy as np
import pytest

from minisim.errors import InputError
from minisim.junction.movements import Movement, movements_of

ROOT = Path(__file__).parents[4]
ROOMS = ("minisim", "dim", "baselines", "scenarios", "figures")

#: Expressions with which an index, a lane, a manoeuvre or an exit would be worked out by hand.
BY_HAND = [
    "lane * (n - 1) + manoeuvre - 1",
    "vehicle.lane * self._manoeuvres + vehicle.manoeuvre - 1",
    "lane * 3 + manoeuvre - 1",
    "first + me.manoeuvre - 1",
    "lane * (site.intersection.n - 1)",
    "path // (self.n - 1)",
    "path % per_lane + 1",
    "path % (len(lanes) - 1) + 1",
    "path_of // manoeuvres",
    "(lane + manoeuvre) % n",
    "(m.origin + m.manoeuvre) % self.n",
    "1 << manoeuvre - 1",
    "np.repeat(np.arange(n), n - 1)",
    "[(i, j) for i in range(n) for j in range(1, n)]",
]


@pytest.mark.parametrize("n", [3, 4, 5, 12])
def test_the_tables_agree_with_each_other(n: int) -> None:
    movements = movements_of(n)
    assert len(movements) == n * (n - 1)
    for k, movement in enumerate(movements):
        lane, manoeuvre = movement
        assert movements.number(movement) == movements.number(movements.names[k]) == k
        assert movements.index_of[lane, manoeuvre] == movements.rows[lane][manoeuvre] == k
        assert (movements.origins[k], movements.manoeuvres[k]) == (lane, manoeuvre)
        assert movements.exits[k] == range(n)[lane - n + manoeuvre]
        assert movements.bits[lane][manoeuvre] == 1 << k
        assert k in movements.of_lane(lane)
    assert (movements.index_of[:, 0] == -1).all()
    for lane in range(n):
        assert movements.bits[lane][0] == sum(1 << k for k in movements.of_lane(lane))
    assert (movements.apart == (movements.origins[:, None] != movements.origins)).all()


def test_there_is_one_object_for_an_arm_count_and_it_is_read_only() -> None:
    assert pickle.loads(pickle.dumps(movements_of(4))) is movements_of(4)
    with pytest.raises(ValueError, match="read-only"):
        movements_of(4).index_of[0, 1] = 7


@pytest.mark.parametrize(
    "wrong", [Movement(0, 0), Movement(3, 1), "a3", "", None, ["a1"], np.eye(2)]
)
def test_an_unknown_movement_is_refused(wrong: object) -> None:
    with pytest.raises(InputError, match="lane a … c and a manoeuvre 1 … 2, such as a1"):
        movements_of(3).number(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("text", BY_HAND)
def test_arithmetic_on_indices_is_recognised(text: str) -> None:
    assert by_hand(text)


@pytest.mark.parametrize(
    "text",
    ["rows[lane][manoeuvre]", "case += manoeuvre * n**lane", "range(1, n)", "turns % n", "k - 1"],
)
def test_other_arithmetic_is_not(text: str) -> None:
    assert not by_hand(text)


def test_nothing_outside_the_junction_room_works_indices_out_by_hand() -> None:
    hits = [
        f"{file.relative_to(ROOT)}:{line}"
        for room in ROOMS
        for file in sorted((ROOT / room).rglob("*.py"))
        if file.parent != ROOT / "minisim" / "junction"
        for line in by_hand(file.read_text(encoding="utf-8"))
    ]
    assert hits == [], "use minisim.junction.movements.Movements"


def by_hand(source: str) -> list[int]:
    """Lines with such arithmetic."""
    return sorted({
        node.lineno for node in ast.walk(ast.parse(source))
        if (isinstance(node, ast.BinOp) and _counts(node))
        or (isinstance(node, ast.Call) and _repeats(node))
        or (isinstance(node, ast.ListComp | ast.GeneratorExp | ast.SetComp) and _lists(node))
    })  # fmt: skip


def _counts(node: ast.BinOp) -> bool:
    if isinstance(node.op, ast.Mult | ast.Mod | ast.FloorDiv):
        # By the number of manoeuvres a lane, or the arm of a lane and a manoeuvre.
        sum_ = isinstance(node.left, ast.BinOp) and "manoeuvre" in ast.unparse(node.left)
        return (
            _per_lane(node.left) or _per_lane(node.right) or (isinstance(node.op, ast.Mod) and sum_)
        )
    text = ast.unparse(node)
    adds_to_manoeuvre = isinstance(node.op, ast.Sub) and isinstance(node.left, ast.BinOp)
    shifts_by_one = isinstance(node.op, ast.LShift) and isinstance(node.right, ast.BinOp)
    return (adds_to_manoeuvre or shifts_by_one) and text.endswith("manoeuvre - 1")


def _per_lane(node: ast.expr) -> bool:
    text = ast.unparse(node)
    if isinstance(node, ast.BinOp):
        return text.endswith(("n - 1", "arms - 1", "lanes) - 1", "lanes - 1"))
    return text.endswith(("manoeuvres", "per_lane"))


def _repeats(node: ast.Call) -> bool:
    return ast.unparse(node.func).endswith("repeat") and any(map(_per_lane, node.args))


def _lists(node: ast.ListComp | ast.GeneratorExp | ast.SetComp) -> bool:
    loops = [ast.unparse(loop.iter) for loop in node.generators]
    return len(loops) == 2 and loops[1].startswith("range(1, ") and loops[0].startswith("range(")
