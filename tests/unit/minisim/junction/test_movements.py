"""Movements and their indices, and that no other room counts them by hand."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from minisim.errors import InputError
from minisim.junction.movements import Movement, movements_of

ROOT = Path(__file__).parents[4]
ROOMS = ("minisim", "dim", "baselines", "scenarios", "figures")

#: By-hand arithmetic: a factor of n − 1, a lane and a manoeuvre added up, a lone list of movements.
PATTERN = re.compile(
    r"(\*|//|%) ?(\(?[\w.]*\b(n|arms|len\(lanes\)) - 1\)|[\w.]*(manoeuvres|per_lane)\b)"
    r"|manoeuvre\) ?%|(\+|<<) [\w.]*manoeuvre - 1|repeat\(.*n - 1|for \w+ in range\(1, \w+\)\]"
)

#: Expressions that it must find.
BY_HAND = (
    "lane * (site.intersection.n - 1)", "path % (len(lanes) - 1) + 1", "path_of // manoeuvres",
    "(m.origin + m.manoeuvre) % self.n", "1 << manoeuvre - 1", "np.repeat(np.arange(n), n - 1)",
    "[(i, j) for i in range(n) for j in range(1, n)]",
)  # fmt: skip


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
    assert (movements.index_of[:, 0] == -1).all()
    for lane, row in enumerate(movements.rows):
        assert movements.bits[lane][0] == sum(1 << k for k in row[1:])
    assert (movements.apart == (movements.origins[:, None] != movements.origins)).all()


def test_there_is_one_object_for_an_arm_count_and_it_is_read_only() -> None:
    assert pickle.loads(pickle.dumps(movements_of(4))) is movements_of(4)
    with pytest.raises(ValueError, match="read-only"):
        movements_of(4).index_of[0, 1] = 7


@pytest.mark.parametrize(
    "wrong",
    [
        Movement(0, 0), Movement(3, 1), Movement(-1, 1), "a3", "", "a", "a0", "A1", "a1 ", "a²",
        None, ["a1"], np.eye(2),
    ],
)  # fmt: skip
def test_an_unknown_movement_is_refused(wrong: object) -> None:
    with pytest.raises(InputError, match="lane a … c and a manoeuvre 1 … 2, such as a1"):
        movements_of(3).number(wrong)  # type: ignore[arg-type]


def test_arithmetic_on_indices_is_recognised() -> None:
    assert all(map(PATTERN.search, BY_HAND))
    for other in ("rows[lane][manoeuvre]", "case += manoeuvre * n**lane", "turns % n", "k - 1"):
        assert not PATTERN.search(other)


def test_only_the_junction_room_works_out_indices_by_hand() -> None:
    hits = [
        f"{file.relative_to(ROOT)}:{number}"
        for room in ROOMS
        for file in sorted((ROOT / room).rglob("*.py"))
        if file.parent != ROOT / "minisim" / "junction"
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
        if PATTERN.search(line)
    ]
    assert hits == [], "use minisim.junction.movements.Movements"
