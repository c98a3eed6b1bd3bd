"""Averages over seeds, paired differences, metrics of a caller and keys of recipes."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import pytest

from dim import Dim
from minisim.control import Plan
from minisim.errors import InputError
from minisim.results.metric import Metric
from minisim.results.metrics import MEANS
from minisim.results.run import Run
from scenarios import Scenario, five_way, four_way, from_bearings, three_way
from scenarios.recipe import Recipe
from scenarios.statistics import GROWTH_SCORE, mean_interval
from scenarios.sweep import sweep
from scenarios.sweep.cells import CELL, cells, differences, pairs, saturated
from scenarios.sweep.keys import RESULTS, canonical, key_of
from scenarios.sweep.rows import outcome_of
from scenarios.sweep.store import Store
from tests.builders import Fixed, free_flow

Floats = npt.NDArray[np.float64]


@pytest.mark.parametrize(
    ("scenario", "controller", "expected"),
    [
        (five_way(350), "dim", "growing"),  # the paper's own: lane e keeps queueing
        (five_way(350, profile="fair"), "dim:gate=harmonious", ""),
        (four_way(150), "dim", ""),
        (four_way(350), "fixed-time", ""),  # x = 0.96, with swings of 25 vehicles per cycle
        (four_way(500), "fixed-time", "growing"),
        (four_way(350, horizon=100), "dim", "too_short"),  # the road still fills
    ],
)
def test_real_runs(scenario: Scenario, controller: str, expected: str) -> None:
    rows = [outcome_of(Recipe(scenario, controller, seed)).row for seed in (1, 2)]
    (cell,) = cells(pd.DataFrame(rows)).to_dict("records")
    for word in ("growing", "too_short"):
        assert cell[word] is (word == expected)


@pytest.fixture(scope="module")
def rows() -> pd.DataFrame:
    todo = [
        Recipe(four_way(density, horizon=300), name, seed)
        for density in (150, 300)
        for name in ("dim", "dim:gate=harmonious", "unregulated")
        for seed in (1, 2, 3)
    ]
    return sweep(todo, jobs=1)


def test_cells_average_both_forms(rows: pd.DataFrame) -> None:
    found = cells(rows)
    names = ["dim", "dim:gate=harmonious", "unregulated"]
    assert found["density"].tolist() == [150] * 3 + [300] * 3
    assert found["controller"].tolist() == names * 2
    first = found.iloc[0]
    assert (first["runs"], first["failed"]) == (3, 0)
    for metric in (*MEANS, *(f"complete_{name}" for name in MEANS)):
        interval = mean_interval(rows[:3][metric].tolist())
        assert first[metric] == interval.mean
        assert first[f"{metric}_ci95"] == interval.half_width
        assert first[f"{metric}_pi95"] == pytest.approx(2 * interval.half_width)  # √(n+1), n = 3
    assert first["trips"] == rows[:3]["trips"].sum()
    assert set(CELL) < set(found.columns)
    last = found.iloc[-1]
    assert last["runs"] == 3 - last["failed"] < 3
    assert math.isnan(last["waiting_time_s"]) == (last["runs"] == 0)


def test_differences_are_of_pairs(rows: pd.DataFrame) -> None:
    found = differences(rows, "complete_waiting_time_s", "dim", "dim:gate=harmonious")
    assert found["density"].tolist() == [150, 300]
    assert found["pairs"].tolist() == [3, 3]
    means = rows[rows["density"] == 300].groupby("controller")["complete_waiting_time_s"].mean()
    expected = means["dim"] - means["dim:gate=harmonious"]
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
    with pytest.raises(InputError, match="had different arrivals"):
        differences(other, "waiting_time_s", "dim", "dim:gate=harmonious")
    with pytest.raises(InputError, match="unknown controller of these rows 'dmi'"):
        differences(rows, "waiting_time_s", "dmi", "dim")
    with pytest.raises(InputError, match="unknown metric 'wait'"):
        differences(rows, "wait", "dim", "dim:gate=harmonious")


def crossings_of(run: Run) -> int:
    """A caller's own metric: how often a vehicle passed the junction's entry."""
    return int(np.isfinite(run.columns.depart).sum())


def slowness(run: Run) -> Floats:
    """Another one: the share of each trip's time that is lost."""
    trips = run.columns
    return np.where(trips.travel_time > 0.0, trips.time_loss / trips.travel_time, np.nan)


OWN = (Metric("departures", crossings_of), Metric("slowness", slowness, per="trip"))


def test_an_own_metric_is_stored_averaged_and_compared(tmp_path: Path) -> None:
    what = four_way(300, horizon=180)
    todo = [Recipe(what, name, seed) for name in ("dim", "fixed-time") for seed in (1, 2)]
    with Store(tmp_path / "runs.db") as store:
        first = sweep(todo, jobs=1, store=store, metrics=["waiting_time_s", *OWN])
        again = sweep(todo, jobs=1, store=store, metrics=["waiting_time_s", *OWN])
        assert len(store) == 4, "the same runs have the same keys"
        sweep(todo, jobs=1, store=store)
        assert len(store) == 8, "runs that measure less are others"
    pd.testing.assert_frame_equal(first, again)
    summary = todo[0].run().summary(["waiting_time_s", *OWN])
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
    pair = lambda run: 1.0, lambda run: 2.0  # fmt: skip  # one name, one line
    assert key(pair[0]) == key(pair[0]) != key(pair[1])
    inner = [lambda run: max(x for x in (1, 2)), lambda run: max(x for x in (1, 3))]
    assert key(inner[0]) != key(inner[1])
    told = power(1.0)
    told.version = 2  # type: ignore[attr-defined]
    assert key(told) != key(power(1.0))


LIMIT = 1.0


def test_a_global_that_a_metric_reads_is_in_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = Recipe(four_way(), Dim(), metrics=(Metric("mine", lambda run: LIMIT),))
    before = key_of(recipe)
    monkeypatch.setattr(sys.modules[__name__], "LIMIT", 2.0)
    assert key_of(recipe) != before


@pytest.mark.parametrize(
    ("of", "message"),
    [
        (lambda run: "many", "metric 'mine' must give one finite number or None, got 'many'"),
        (lambda run: run.trips["wait"], "metric 'mine' raised KeyError: 'wait' (test_cells.py, "),
    ],
)
def test_a_metric_that_fails_is_a_failed_run(of: Callable[[Run], Any], message: str) -> None:
    todo = [Recipe(four_way(50, horizon=20), Dim(), 1)]
    (error,) = sweep(todo, jobs=1, metrics=[Metric("mine", of)])["error"]
    assert error.startswith(message)


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
    ("make", "density", "horizon", "profile", "controller", "wanted"),
    [
        (four_way, 300, 900, "paper", "dim", (275, 31, 5.91, 99.77, 6.88)),
        (three_way, 350, 900, "fair", "dim:gate=harmonious", (243, 29, 0.96, 75.65, -0.74)),
        (four_way, 250, 900, "fair", "fixed-time", (229, 30, 19.51, 95.20, 5.74)),
        (four_way, 250, 300, "as_run", "dim", (72, 25, 1.25, 53.52, 9.29)),
    ],
)
def test_changed_results_need_another_version(
    make: Any, density: int, horizon: int, profile: str, controller: str, wanted: tuple[float, ...]
) -> None:
    """Stores keep rows by version. When rows change, raise `RESULTS` and update these numbers."""
    scenario = make(density, horizon=horizon, profile=profile)
    row = outcome_of(Recipe(scenario, controller, 1, on_collision="record")).row
    times = ("waiting_time_s", "complete_travel_time_s", "queue_growth")
    found = [row[column] for column in ("trips", "unfinished", *times)]
    assert found == pytest.approx(wanted, abs=0.006), "raise scenarios.sweep.keys.RESULTS"
    assert RESULTS == 10


def quiet(trips: int) -> dict[str, int]:
    """Columns of three lanes with so many trips each, and no queue."""
    lanes = {f"lanes_{k}_{key}": 0 for k in "abc" for key in ("trips", "queue_growth")}
    return {"arms": 3, **lanes, **{f"lanes_{k}_trips": trips for k in "abc"}}


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
    row = {"trips": 100, "queue_growth": 100.0, **quiet(0), **free_flow(60.0), **run}
    assert saturated(pd.DataFrame([row])) is expected


def test_saturated_sums_over_runs_and_lanes() -> None:
    """`GROWTH_SCORE` standard deviations √(5/12 · trips); two runs have √2 times that."""
    limit = GROWTH_SCORE * math.sqrt(5.0 / 12.0 * 120)
    one = {"trips": 120, "queue_growth": 0.9 * limit, **quiet(40), **free_flow(60.0)}
    assert not saturated(pd.DataFrame([one]))
    assert saturated(pd.DataFrame([one, one]))
    lane = {**one, "queue_growth": 0.0, "lanes_c_queue_growth": 0.9 * limit}
    assert saturated(pd.DataFrame([lane])), "1/√3 of the junction's limit is a lane's"


def refused(todo: Sequence[Recipe], first: str, second: str, told: str) -> None:
    found = sweep(todo, jobs=1)
    with pytest.raises(InputError, match=told):
        cells(found)
    with pytest.raises(InputError, match=told):
        differences(found, "complete_travel_time_s", first, second)


@pytest.mark.parametrize("shift", [0, 3], ids=["the same seeds", "other seeds"])
def test_two_controllers_of_one_name_are_not_one_cell(shift: int) -> None:
    scenario = four_way(100, horizon=10)
    todo = [
        Recipe(scenario, Fixed(Plan(period=float(k))), seed + shift * k, label="fixed")
        for k in (1, 2)
        for seed in (1, 2, 3)
    ]
    told = "different controllers or scenarios are called fixed on four-way at 100 veh/h/lane"
    refused([*todo, Recipe(scenario, Dim(), 1)], "fixed", "dim", told)


def test_two_junctions_of_one_name_are_not_one_cell() -> None:
    todo = [
        Recipe(from_bearings(bearings, 100, horizon=10), who, seed)
        for bearings in ((0, 90, 180, 270), (0, 80, 180, 270))
        for who in (Dim(), Dim(gate="harmonious"))
        for seed in (1, 2, 3)
    ]
    refused(todo, "dim", "dim:gate=harmonious", "are called dim on custom at 100 veh/h/lane")


def test_a_run_counts_once() -> None:
    todo = [Recipe(four_way(100, horizon=10), Dim(), seed) for seed in (1, 2, 2)]
    with pytest.raises(InputError, match=r"dim on four-way .* has several runs of seed 2"):
        cells(sweep(todo, jobs=1))
    frame = pd.DataFrame({
        "who": ["x", "x", "y"], "m": 1.0, "where": 1, "seed": 1, "arrivals": "same", "error": None,
    })  # fmt: skip
    with pytest.raises(InputError, match="x has several runs of one seed with equal where"):
        pairs(frame, "m", "who", ("x", "y"), ["where"])


def test_recorded_arrivals_that_differ_by_seed_are_one_cell() -> None:
    plain = four_way(200, horizon=120)
    days = {seed: replace(plain, recorded=plain.arrivals(seed)) for seed in (1, 2, 3)}
    controllers = Dim(), Dim(gate="harmonious")
    todo = [Recipe(day, who, seed) for who in controllers for seed, day in days.items()]
    rows = sweep(todo, jobs=1)
    mean = np.mean([day.density for day in days.values()])
    found = cells(rows)
    assert found["runs"].tolist() == [3, 3]
    assert found["density"].tolist() == pytest.approx([mean, mean])
    (gap,) = differences(rows, "travel_time_s", *(who.name for who in controllers))["pairs"]
    assert gap == 3
    low = [Recipe(day, Dim(), 1) for day in days.values()]
    assert cells(sweep(low, jobs=1))["runs"].tolist() == [1, 1, 1], "one seed, three demands"
