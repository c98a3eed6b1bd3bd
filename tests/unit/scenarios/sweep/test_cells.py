"""Averages over seeds, paired differences, prediction intervals and growing queues."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from dim import Dim
from minisim.errors import InputError
from minisim.results.metrics import AVERAGED, Metric, queue_growth
from minisim.results.run import Run
from minisim.simulation import simulate
from scenarios import Scenario, five_way, four_way, three_way
from scenarios.controllers import controller_named
from scenarios.recipe import Recipe
from scenarios.statistics import (
    GROWTH_SCORE,
    growing,
    mean_interval,
    prediction_interval,
)
from scenarios.sweep import sweep
from scenarios.sweep.cells import CELL, cells, differences, pairs, saturated
from scenarios.sweep.keys import RESULTS, canonical, key_of
from scenarios.sweep.rows import outcome_of
from scenarios.sweep.store import Store
from tests.builders import free_flow

Floats = npt.NDArray[np.float64]


def test_prediction_interval_by_hand() -> None:
    # Mean 3, s² = 10/4, t(0.975, 4) = 2.776 (Abramowitz & Stegun, table 26.10).
    interval = prediction_interval([1, 2, 3, 4, 5])
    assert interval.mean == 3.0
    assert interval.half_width == pytest.approx(2.7764 * math.sqrt(2.5 * 1.2), abs=1e-4)
    assert math.isnan(prediction_interval([1.0]).half_width)
    with pytest.raises(InputError):
        prediction_interval([])


def test_prediction_interval_holds_the_next_value_as_often_as_it_says() -> None:
    draws = np.random.default_rng(7).normal(10, 3, size=(2000, 6))
    inside = 0
    for *known, new in draws.tolist():
        mean, half_width, _ = prediction_interval(known)
        inside += abs(new - mean) <= half_width
    # Binomial(2000, 0.95): sd 9.7; four of them are a false alarm of 6e-5.
    assert inside == pytest.approx(1900, abs=39)


# --- growing queues --------------------------------------------------------------------------


def test_queue_growth_by_hand() -> None:
    # Quarters of 10 s. Second, [10, 20): the first trip is there for 5 s. Last, [30, 40): the
    # second for 10 s, the third for 4 s, the fourth not yet.
    demand = np.array([0.0, 25.0, 36.0, 40.0])
    leave = np.array([15.0, math.inf, math.inf, math.inf])
    assert queue_growth(demand, leave, 40.0) == pytest.approx(1.4 - 0.5)


def md1(rng: np.random.Generator, load: float, horizon: float = 3600.0) -> tuple[Floats, Floats]:
    """An hour of an M/D/1 queue with 350 arrivals on average: demand and leaving times."""
    demand = np.sort(rng.uniform(0.0, horizon, rng.poisson(350)))
    service = load * horizon / 350
    leave = np.empty_like(demand)
    last = 0.0
    for k, time in enumerate(demand.tolist()):
        last = max(time, last) + service
        leave[k] = last
    return demand, np.where(leave <= horizon, leave, math.inf)


def flagged(load: float, runs: int = 200) -> int:
    rng = np.random.default_rng(11)
    hours = [md1(rng, load) for _ in range(runs)]
    return sum(growing(queue_growth(*hour, 3600.0), len(hour[0])) for hour in hours)


def test_an_md1_queue_grows_above_its_capacity_only() -> None:
    assert flagged(0.5) == 0
    assert flagged(0.9) == 0
    assert flagged(0.95) <= 2, "0.2 % each: 3 of 200 have a chance of 1 %"
    assert flagged(1.3) > 150, "88 % each"


def test_growth_is_the_surplus() -> None:
    # Far above capacity: the queue grows by λ − μ, for half the horizon between the two windows.
    rng = np.random.default_rng(5)
    grown = [queue_growth(*md1(rng, 1.5), 3600.0) for _ in range(50)]
    surplus = 350 * (1 - 1 / 1.5) / 2
    # The sd of one is √(5/12·350) = 12.1.
    assert np.mean(grown) == pytest.approx(surplus, abs=4 * 12.1 / math.sqrt(50))


def test_a_free_walk_varies_as_stated() -> None:
    # Arrivals and independent departures of a rate λ each: a walk of variance 2λ a second.
    rng = np.random.default_rng(3)
    rate, end, grown = 0.2, 3600.0, []
    for _ in range(400):
        demand = np.sort(rng.uniform(0, end, rng.poisson(rate * end)))
        leave = np.sort(rng.uniform(0, end, rng.poisson(rate * end)))
        # Negative presences are what makes it free: only the difference of counts matters.
        size = min(len(demand), len(leave))
        surplus = demand[size:], np.full(len(demand) - size, math.inf)
        paired = (
            np.concatenate([demand[:size], surplus[0]]),
            np.concatenate([leave[:size], surplus[1]]),
        )
        late = leave[size:]
        count = present(paired[0], end) - present(np.concatenate([leave[:size], late]), end)
        grown.append(count)
    expected = 2 * 5 / 12 * rate * end
    # The variance of a variance of 400 normal values: sd √(2/399) = 7 %.
    assert np.var(grown, ddof=1) == pytest.approx(expected, rel=4 * 0.071)


def present(times: Floats, end: float) -> float:
    """Growth of the number of events so far: what `queue_growth` says when nobody leaves."""
    return queue_growth(times, np.full(len(times), math.inf), end)


@pytest.mark.parametrize(
    ("scenario", "controller", "expected"),
    [
        (five_way(350), "dim", True),  # the paper's own: lane e keeps queueing
        (five_way(350, profile="fair"), "dim:gate=harmonious", False),
        (four_way(150), "dim", False),
        (four_way(350), "fixed-time", False),  # x = 0.96, with swings of 25 vehicles a cycle
        (four_way(500), "fixed-time", True),
    ],
)
def test_real_runs(scenario: Scenario, controller: str, expected: bool) -> None:
    rows = [outcome_of(Recipe(scenario, controller_named(controller), seed)).row for seed in (1, 2)]
    (cell,) = cells(pd.DataFrame(rows)).to_dict("records")
    assert cell["growing"] is expected


def test_a_road_that_still_fills_says_nothing_of_queues() -> None:
    row = outcome_of(Recipe(four_way(350, horizon=100), Dim(), 1)).row
    (cell,) = cells(pd.DataFrame([row])).to_dict("records")
    assert row["queue_growth"] > 0.0
    assert cell["too_short"]
    assert not cell["growing"]


# --- cells -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    todo = [
        Recipe(four_way(density, horizon=300), controller_named(name), seed)
        for density in (150, 300)
        for name in ("dim", "dim:gate=harmonious", "unregulated")
        for seed in (1, 2, 3)
    ]
    return sweep(todo, jobs=1)


def test_cells_average_both_forms(rows: pd.DataFrame) -> None:
    found = cells(rows)
    assert list(zip(found["density"], found["controller"], strict=True))[:2] == [
        (150, "dim"), (150, "dim:gate=harmonious"),
    ]  # fmt: skip
    first = found.iloc[0]
    group = rows[:3]
    assert (first["runs"], first["failed"]) == (3, 0)
    for metric in AVERAGED:
        interval = mean_interval(group[metric].tolist())
        assert first[metric] == interval.mean
        assert first[f"{metric}_ci95"] == interval.half_width
        assert first[f"{metric}_pi95"] == pytest.approx(2 * interval.half_width)  # √(n+1), n = 3
    assert first["trips"] == group["trips"].sum()
    assert set(CELL) < set(found.columns)


def test_a_cell_of_failures_has_no_means(rows: pd.DataFrame) -> None:
    last = cells(rows).iloc[-1]
    assert last["controller"] == "unregulated"
    assert last["failed"] > 0
    assert last["runs"] == 3 - last["failed"]
    assert math.isnan(last["waiting_time_s"]) == (last["runs"] == 0)


def test_differences_are_of_pairs(rows: pd.DataFrame) -> None:
    found = differences(rows, "complete_waiting_time_s", "dim", "dim:gate=harmonious")
    assert found["density"].tolist() == [150, 300]
    assert found["pairs"].tolist() == [3, 3]
    values = rows[rows["density"] == 300].set_index(["controller", "seed"])[
        "complete_waiting_time_s"
    ]
    expected = (values["dim"] - values["dim:gate=harmonious"]).mean()
    assert found["difference"][1] == pytest.approx(expected)
    assert found["difference"][1] > 0, "the harmonious gate lets more in"


def test_pairs_cancel_what_they_share() -> None:
    shared = np.random.default_rng(1).normal(0, 100, 8)
    frame = pd.DataFrame({
        "who": ["x"] * 8 + ["y"] * 8, "m": [*(shared + 5), *shared[::-1]], "where": 1,
        "seed": [*range(8), *range(7, -1, -1)], "arrivals": "same", "error": None,
    })  # fmt: skip
    found = pairs(frame, "m", "who", ("x", "y"), ["where"])
    assert found == {(1,): pytest.approx([5.0] * 8)}


def test_differences_need_common_arrivals(rows: pd.DataFrame) -> None:
    other = rows.copy()
    other.loc[other["controller"] == "dim", "arrivals"] = "others"
    with pytest.raises(InputError, match="did not meet the same arrivals"):
        differences(other, "waiting_time_s", "dim", "dim:gate=harmonious")
    with pytest.raises(InputError, match="unknown controller of these rows 'dmi'"):
        differences(rows, "waiting_time_s", "dmi", "dim")
    with pytest.raises(InputError, match="unknown metric 'wait'"):
        differences(rows, "wait", "dim", "dim:gate=harmonious")


def crossings_of(run: Run) -> int:
    """A caller's own metric: how often a vehicle passed the junction's entry."""
    return int(np.isfinite(run.columns.depart).sum())


def slowness(run: Run) -> Floats:
    """Another one: seconds a trip has lost over those that it drove."""
    return np.where(
        run.columns.travel_time > 0.0, run.columns.time_loss / run.columns.travel_time, np.nan
    )


OWN = (Metric("departures", crossings_of), Metric("slowness", slowness, per="trip"))


def test_an_own_metric_is_stored_averaged_and_compared(tmp_path: Path) -> None:
    todo = [
        Recipe(four_way(200, horizon=120), controller_named(name), seed)
        for name in ("dim", "fixed-time")
        for seed in (1, 2)
    ]
    with Store(tmp_path / "runs.db") as store:
        first = sweep(todo, jobs=1, store=store, metrics=["waiting_time_s", *OWN])
        again = sweep(todo, jobs=1, store=store, metrics=["waiting_time_s", *OWN])
        assert len(store) == 4, "the same runs have the same keys"
        sweep(todo, jobs=1, store=store)
        assert len(store) == 8, "runs that measure less are others"
    pd.testing.assert_frame_equal(first, again)
    run = simulate(todo[0].scenario, todo[0].controller, 1)
    summary = run.summary(["waiting_time_s", *OWN])
    for name in ("departures", "slowness", "slowness_p95", "waiting_time_s_max"):
        assert first[name][0] == summary[name]
    assert first["lanes_a_slowness"][0] == summary["lanes"]["a"]["slowness"]
    assert first["complete_slowness"][0] == summary["complete"]["slowness"]
    averages = cells(first)
    for name in ("departures", "slowness", "complete_slowness", "slowness_p95"):
        assert averages[name][0] == pytest.approx(first[name][:2].mean())
        assert averages[f"{name}_ci95"].notna().all()
    (gap,) = differences(first, OWN[1], "dim", "fixed-time").to_dict("records")
    expected = first["slowness"][:2].mean() - first["slowness"][2:].mean()
    assert gap["difference"] == pytest.approx(expected)


def test_the_code_of_an_own_metric_is_part_of_the_key() -> None:
    def one(run: Run) -> float:
        return 1.0

    def key(of: Callable[[Run], float]) -> str:
        return key_of(Recipe(four_way(), Dim(), metrics=(Metric("mine", of),)))

    def power(k: float) -> Callable[[Run], float]:
        return lambda run: k

    assert key(one) == key(one)
    assert key(power(1.0)) == key(power(1.0)) != key(power(2.0)), "what it encloses counts"
    first, second = (
        lambda run: 1.0,
        lambda run: 2.0,
    )
    assert key(first) != key(second)
    told = power(1.0)
    told.version = 2  # type: ignore[attr-defined]
    assert key(told) != key(power(1.0))


def test_a_metric_that_gives_the_wrong_thing_is_a_failed_run() -> None:
    wrong = Metric("mine", lambda run: "many")
    todo = [Recipe(four_way(50, horizon=20), Dim(), 1)]
    (error,) = sweep(todo, jobs=1, metrics=[wrong])["error"]
    assert error == "metric 'mine' must give one finite number or None, got 'many'"


# --- experiments -----------------------------------------------------------------------------


def test_equal_numbers_are_one_experiment() -> None:
    assert key_of(Recipe(four_way(350), Dim())) == key_of(Recipe(four_way(350.0), Dim()))
    assert canonical(2**60 + 1) != canonical(2**60)
    assert canonical({"b": 1, "a": (2, None)}) == canonical({"a": [2.0, None], "b": 1.0})
    assert canonical(frozenset({2, 1})) == canonical(frozenset({1, 2}))
    assert canonical(np.array([1, 2])) != canonical(np.array([1.0, 2.0]))


@pytest.mark.parametrize("odd", [len, object(), Dim, b"bytes", 1j])
def test_what_has_no_canonical_form(odd: object) -> None:
    with pytest.raises(InputError, match="cannot be stored"):
        canonical(odd)


@pytest.mark.parametrize(
    ("scenario", "controller", "expected"),
    [
        (four_way(300, horizon=900), "dim", (273, 30, 2.33, 95.61, 8.65)),
        (
            three_way(350, horizon=900, profile="fair"),
            "dim:gate=harmonious",
            (253, 15, 0.99, 77.94, 7.12),
        ),
        (
            four_way(250, horizon=900, profile="fair"),
            "fixed-time",
            (227, 29, 18.72, 93.82, 5.36),
        ),
        (four_way(250, horizon=300, profile="as_run"), "dim", (73, 5, 1.79, 68.88, -8.59)),
    ],
)
def test_whoever_changes_results_raises_their_version(
    scenario: Scenario, controller: str, expected: tuple[float, ...]
) -> None:
    """Stores keep rows by version: one that gives other rows needs another `RESULTS`.

    The numbers are what these runs gave under `RESULTS` = 3, no more; put in what they give now.
    """
    recipe = controller_named(controller, scenario.profile)
    row = outcome_of(Recipe(scenario, recipe, 1, on_collision="record")).row
    columns = (
        "trips", "unfinished", "waiting_time_s", "complete_travel_time_s", "queue_growth",
    )  # fmt: skip
    found = [row[column] for column in columns]
    assert found == pytest.approx(expected, abs=0.006), "raise scenarios.sweep.keys.RESULTS"
    assert RESULTS == 3


# --- growing queues -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        ({}, True),
        ({"horizon_s": 240.0}, True),
        ({"horizon_s": 239.0}, False),  # four times 60 s
        ({"horizon_s": 150.0, "travel_time_s": None}, True),  # 30 s of what was driven
        ({"horizon_s": 119.0, "travel_time_s": None}, False),
    ],
)
def test_roads_that_fill_are_no_growing_queue(run: Mapping[str, Any], expected: bool) -> None:
    quiet = {f"lanes_{k}_{key}": 0 for k in "abc" for key in ("trips", "queue_growth")}
    row = {"arms": 3, "trips": 100, "queue_growth": 100.0, **quiet, **free_flow(60.0), **run}
    assert saturated(pd.DataFrame([row])) is expected


def test_saturated_sums_over_runs_and_lanes() -> None:
    """`GROWTH_SCORE` standard deviations √(5/12 · trips); two runs have √2 times that."""
    limit = GROWTH_SCORE * math.sqrt(5.0 / 12.0 * 120)
    quiet = {
        f"lanes_{k}_{key}": v for k in "abc" for key, v in (("trips", 40), ("queue_growth", 0))
    }
    one = {"arms": 3, "trips": 120, "queue_growth": 0.9 * limit, **quiet, **free_flow(60.0)}
    assert not saturated(pd.DataFrame([one]))
    assert saturated(pd.DataFrame([one, one]))
    lane = {**one, "queue_growth": 0.0, "lanes_c_queue_growth": 0.9 * limit}
    assert saturated(pd.DataFrame([lane])), "1/√3 of the junction's limit is a lane's"
