"""Sweeps: rows, executors, failures and what is refused."""

from __future__ import annotations

import math
from collections.abc import Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import pandas as pd
import pytest

import minisim
from dim import Dim
from minisim.control import Command, Unregulated, View
from minisim.errors import InputError
from minisim.results.metric import Metric
from scenarios import four_way, three_way
from scenarios.recipe import Recipe
from scenarios.sweep import sweep
from scenarios.sweep.pool import workers
from tests.builders import Scripted, python, repeatable


def broken(view: View) -> Iterable[Command]:
    raise ZeroDivisionError("a bug")


class Backwards(Executor):
    """Runs what was submitted only when the first result is asked for, the last one first."""

    def __init__(self) -> None:
        self.submitted: list[tuple[Future[Any], Any, Any]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.submitted.append((future, fn, args))
        if len(self.submitted) == 4:
            for waiting, call, given in reversed(self.submitted):
                waiting.set_result(call(*given))
        return future


def recipes() -> list[Recipe]:
    return [
        Recipe(scenario(300, horizon=120), Dim(), seed)
        for scenario in (three_way, four_way)
        for seed in (1, 2)
    ]


def test_rows_are_the_flat_summaries_in_order() -> None:
    calls: list[tuple[int, int]] = []
    rows = sweep(recipes(), ThreadPoolExecutor(1), lambda *counts: calls.append(counts))
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert list(rows["scenario"]) == ["three-way", "three-way", "four-way", "four-way"]
    assert list(rows["seed"]) == [1, 2, 1, 2]
    summary = minisim.simulate(four_way(300, horizon=120), Dim(), seed=2).summary()
    last = rows.iloc[3]
    assert last["waiting_time_s"] == summary["waiting_time_s"]
    assert last["lanes_d_trips"] == summary["lanes"]["d"]["trips"]
    assert last["complete_travel_time_s"] == summary["complete"]["travel_time_s"]
    assert math.isnan(rows.iloc[0]["lanes_d_trips"]), "three arms have no lane d"
    assert rows["error"].isna().all()


def test_rows_do_not_depend_on_the_executor() -> None:
    one = repeatable(sweep(recipes(), ThreadPoolExecutor(1)))
    pd.testing.assert_frame_equal(one, repeatable(sweep(recipes(), Backwards())))
    for jobs in (1, 2):
        pd.testing.assert_frame_equal(one, repeatable(sweep(recipes(), jobs=jobs)))


def test_default_is_a_pool_of_processes() -> None:
    script = (
        "from scenarios import three_way\n"
        "from scenarios.recipe import Recipe\n"
        "from scenarios.sweep import sweep\n"
        "if __name__ == '__main__':\n"
        "    rows = sweep([Recipe(three_way(0, horizon=1), 'dim')])\n"
        "    print(len(rows), rows['trips'].sum())\n"
    )
    assert python("-c", script).stdout.split() == ["1", "0"]


def test_a_failed_run_is_a_row() -> None:
    who = Unregulated(), Scripted(broken, name="broken"), Dim()
    rows = sweep([Recipe(four_way(300, horizon=600), it, 1) for it in who], workers(1))
    assert list(rows["controller"]) == ["unregulated", "broken", "dim"]
    assert "touched" in rows["error"][0]
    assert rows["error"][1].startswith("controller 'broken' at 0.0 s: test_sweep.py, line ")
    assert rows["error"][1].endswith("ZeroDivisionError: a bug")
    assert rows["error"].isna().tolist() == [False, False, True]
    assert rows["density"].tolist() == [300.0] * 3
    assert math.isnan(rows["trips"][0])


def test_interrupt_cancels_what_has_not_begun() -> None:
    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with workers(1) as executor:
        many = [Recipe(four_way(300, horizon=120), Dim(), seed) for seed in range(50)]
        with pytest.raises(KeyboardInterrupt):
            sweep(many, executor, interrupt)
        after = executor.submit(int)
        assert after.result(timeout=5) == 0, "the executor is free, and not at seed 49"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: sweep([four_way()]), "recipe must be a Recipe"),  # type: ignore[list-item]
        (lambda: sweep([], store="s.db"), "store .* must be a Store"),  # type: ignore[arg-type]
        (lambda: sweep([], jobs=0), "jobs must be an integer 1"),
        (lambda: workers(0), "jobs must be an integer 1"),
    ],
)
def test_bad_input(wrong: Any, message: str) -> None:
    assert sweep([], ThreadPoolExecutor(1)).empty
    with pytest.raises(InputError, match=message):
        wrong()


def test_what_other_processes_cannot_have_is_said_before_anything_runs() -> None:
    @dataclass(frozen=True)
    class Local(Unregulated):
        pass

    two = [Recipe(three_way(0, horizon=1), Dim(), seed) for seed in (1, 2)]
    metric = Metric("mine", lambda run: 1.0)
    with pytest.raises(InputError, match=r"'mine'.* cannot go to other processes .*use one job"):
        sweep(two, jobs=2, metrics=[metric])
    assert sweep(two, jobs=1, metrics=[metric])["mine"].tolist() == [1.0, 1.0]
    with pytest.raises(InputError, match=r"Local.* cannot go to other processes"):
        sweep([*two, Recipe(three_way(0, horizon=1), Local())], jobs=2)
