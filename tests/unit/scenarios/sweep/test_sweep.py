"""Sweeps, and the statistics of their results."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import pandas as pd
import pytest

import minisim
from dim import Dim
from minisim.control import Command, Plan, Site, Unregulated, View
from minisim.errors import InputError, MinisimError
from scenarios import four_way, three_way
from scenarios.demo import METRICS, Tour, average, run_tour
from scenarios.recipe import Recipe
from scenarios.statistics import mean_interval
from scenarios.sweep import sweep
from scenarios.sweep.pool import workers
from scenarios.sweep.rows import MEASURED
from tests import ROOT


@dataclass(frozen=True)
class Broken:
    """A controller with a bug."""

    name: str = "broken"

    def start(self, site: Site) -> BrokenSession:
        return BrokenSession()


class BrokenSession:
    plan = Plan()

    def decide(self, view: View) -> Iterable[Command]:
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


def repeatable(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows without what every repetition measures anew."""
    return rows.drop(columns=list(MEASURED))


def experiments() -> list[Recipe]:
    return [
        Recipe(scenario(300, horizon=120), Dim(), seed)
        for scenario in (three_way, four_way)
        for seed in (1, 2)
    ]


def test_rows_are_the_flat_summaries_in_order() -> None:
    rows = sweep(experiments(), ThreadPoolExecutor(1))
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
    one = repeatable(sweep(experiments(), ThreadPoolExecutor(1)))
    pd.testing.assert_frame_equal(one, repeatable(sweep(experiments(), Backwards())))
    for jobs in (1, 2):
        pd.testing.assert_frame_equal(one, repeatable(sweep(experiments(), jobs=jobs)))


def test_default_is_a_pool_of_processes() -> None:
    script = (
        "from scenarios.recipe import Recipe\n"
        "from scenarios.sweep import sweep\n"
        "from scenarios import three_way\n"
        "from dim import Dim\n"
        "if __name__ == '__main__':\n"
        "    rows = sweep([Recipe(three_way(0, horizon=1), Dim())])\n"
        "    print(len(rows), rows['trips'].sum())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "0"]


def test_a_failed_run_is_a_row() -> None:
    crash = Recipe(four_way(300, horizon=600), Unregulated(), 1)
    bug = Recipe(four_way(300, horizon=60), Broken(), 1)
    good = Recipe(four_way(300, horizon=60), Dim(), 1)
    rows = sweep([crash, bug, good], workers(1))
    assert list(rows["controller"]) == ["unregulated", "broken", "dim"]
    assert "touched" in rows["error"][0]
    assert rows["error"][1] == "ZeroDivisionError: a bug"
    assert rows["error"].isna().tolist() == [False, False, True]
    assert rows["density"].tolist() == [300.0] * 3
    assert math.isnan(rows["trips"][0])


def test_progress_counts_every_run() -> None:
    calls: list[tuple[int, int]] = []
    sweep(experiments(), ThreadPoolExecutor(1), lambda done, total: calls.append((done, total)))
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_nothing_to_run() -> None:
    assert sweep([], ThreadPoolExecutor(1)).empty


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
    "wrong",
    [
        lambda: Recipe("four-way", Dim()),  # type: ignore[arg-type]
        lambda: Recipe(four_way(), "dim"),  # type: ignore[arg-type]
        lambda: Recipe(four_way(), Dim),  # type: ignore[arg-type]
        lambda: Recipe(four_way(), Dim(), -1),
        lambda: Recipe(four_way(), Dim(), 1.5),  # type: ignore[arg-type]
        lambda: sweep([four_way()], ThreadPoolExecutor(1)),  # type: ignore[list-item]
        lambda: sweep([], store="s.db"),  # type: ignore[arg-type]
        lambda: workers(0),
        lambda: Tour(seeds=1),
        lambda: Tour(densities=()),
        lambda: Tour(horizon=-1.0),
    ],
)
def test_bad_input(wrong: Any) -> None:
    with pytest.raises(InputError):
        wrong()


def test_what_a_controller_lacks_is_said() -> None:
    class Plain(NamedTuple):
        x: float

        def start(self, site: Site) -> BrokenSession:
            return BrokenSession()

    with pytest.raises(InputError, match=r"got Plain\(x=40.0\), which has no name$"):
        Recipe(four_way(), Plain(40.0))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"which is a class$"):
        Recipe(four_way(), Dim)  # type: ignore[arg-type]


# --- statistics ------------------------------------------------------------------------------


def test_half_widths_of_student_s_table() -> None:
    # Two-sided 95 %, e.g. Abramowitz & Stegun, table 26.10.
    for freedom, quantile in {1: 12.706, 2: 4.303, 4: 2.776, 9: 2.262, 30: 2.042}.items():
        _, half_width, size = mean_interval([*[0.0] * freedom, math.sqrt(freedom + 1.0)])
        # n values, all 0 but one √n, have variance 1.
        assert half_width * math.sqrt(size) == pytest.approx(quantile, abs=5e-4)


def test_mean_interval_by_hand() -> None:
    # Mean 3, s² = 10/4, so the half width is 2.776·√(2.5/5).
    interval = mean_interval([1, 2, 3, 4, 5])
    assert interval.mean == 3.0
    assert interval.half_width == pytest.approx(2.7764 * math.sqrt(0.5), abs=1e-4)
    assert str(interval) == "3.0 ± 2.0"


def test_mean_interval_of_one_value_has_no_width() -> None:
    interval = mean_interval([2.0])
    assert (interval.mean, interval.size) == (2.0, 1)
    assert math.isnan(interval.half_width)
    assert str(interval) == "2.0"


@pytest.mark.parametrize("values", [[], [1.0, math.nan], "12", [1, "2"]])
def test_mean_interval_refuses(values: Any) -> None:
    with pytest.raises(InputError):
        mean_interval(values)


# --- the tour --------------------------------------------------------------------------------


def test_average_is_over_seeds() -> None:
    rows = pd.DataFrame({
        "controller": ["dim", "dim", "x", "x"], "density": [150.0] * 4, "seed": [1, 2, 1, 2],
        "trips": [10, 12, 9, 9], "collisions": [0, 1, 0, 0],
        **{metric: [1.0, 3.0, 5.0, 5.0] for metric in METRICS},
    })  # fmt: skip
    points = average(rows)
    assert list(points["controller"]) == ["dim", "x"]
    assert list(points["trips"]) == [22, 18]
    assert list(points["collisions"]) == [1, 0]
    assert list(points["waiting_time_s"]) == [2.0, 5.0]
    # t(0.975, 1) = 12.706, s = √2, n = 2.
    assert points["waiting_time_s_ci95"][0] == pytest.approx(12.706, abs=1e-3)
    assert points["waiting_time_s_ci95"][1] == 0.0


def test_a_tour_that_fails_says_where() -> None:
    tour = Tour(densities=(300.0,), seeds=2, horizon=300.0, controllers=("unregulated",))
    with pytest.raises(MinisimError, match=r"2 of 2 runs failed.*unregulated, 300 .*seed 1"):
        run_tour(tour, 1, lambda done, total: None)
