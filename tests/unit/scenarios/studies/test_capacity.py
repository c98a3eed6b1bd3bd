"""Capacity by bisection."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from baselines import FixedTime
from minisim.errors import InputError
from scenarios import four_way
from scenarios.recipe import Recipe
from scenarios.studies.capacity import STUDY, Capacity, CapacityStudy, capacities, grows
from scenarios.studies.shared.effort import Effort, Search
from scenarios.studies.shared.points import fair
from scenarios.studies.shared.study import Find
from scenarios.sweep.rows import outcome_of
from tests.builders import capacity_of, synthetic_find


def of_dim(arms: int = 4) -> CapacityStudy:
    return replace(STUDY, points=(fair("dim", arms, 0.0),))


def searched(study: CapacityStudy, search: Search, find: Find) -> list[Capacity]:
    return capacities(study.collect(Effort(search=search), find))


@pytest.mark.parametrize("arms", [3, 6])
def test_bisection_finds_the_capacity_of_the_rows(arms: int) -> None:
    search = Search(step=10.0, seeds=2)
    results = of_dim(arms).collect(Effort(search=search), synthetic_find)
    (capacity,) = capacities(results)
    # A row grows by more than 2 % of its arrivals from 1/0.98 of its capacity on.
    assert capacity.interval.mean == pytest.approx(capacity_of("dim", arms) / 0.98, abs=10.0)
    assert len(results.rows) == of_dim(arms).most_runs(results.effort) == 2 * 7


def test_capacity_says_no_more_than_the_search_knows() -> None:
    for brackets, text in (
        (((390.0, 400.0), (390.0, 400.0)), "395 ± 5"),  # equal seeds, rounded by the search
        # t(0.975, 1)·s/√2 = 12.706·5 for two values 10 apart, and the 5 of the rounding.
        (((390.0, 400.0), (400.0, 410.0)), "400 ± 69"),
        (((390.0, 400.0),), "395"),
        (((0.0, 200.0), (200.0, 400.0)), "< 400"),
        (((600.0, math.inf), (400.0, 600.0)), "> 400"),
        (((600.0, math.inf), (0.0, 200.0)), "–"),
    ):
        assert str(Capacity("dim", 4, brackets)) == text
    with pytest.raises(InputError, match="the capacity of dim on 4 arms"):
        _ = Capacity("dim", 4, ((0.0, 200.0),)).interval


@pytest.mark.parametrize(("growth", "text"), [(1.0, "< 200"), (0.0, "> 600")])
def test_capacity_beyond_the_search(growth: float, text: str) -> None:
    def find(asked: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        row = {"queue_growth": growth * 100.0, "trips": 100, "error": None}
        return [{**row, "seed": recipe.seed} for recipe in asked]

    (capacity,) = searched(of_dim(), Effort.of(quick=True).search, find)
    assert str(capacity) == text


def test_capacity_of_runs_that_fail_is_missing() -> None:
    asked: list[int] = []

    def broken(recipes: Sequence[Recipe]) -> list[None]:
        asked.append(len(recipes))
        return [None] * len(recipes)

    assert searched(of_dim(), Search(seeds=2), broken) == []
    assert asked == [2, 0, 0, 0, 0, 0, 0], "a lost point is not asked for again"


def test_a_search_has_a_power_of_two_of_steps() -> None:
    with pytest.raises(InputError, match="steps must be a power of two, got 100"):
        Search(steps=100)


def test_the_queue_at_a_signal_grows_above_what_it_serves_when_saturated() -> None:
    """Against the trips in an hour in which far more come than leave (Webster: s·g/C)."""

    def row_at(density: float) -> Mapping[str, Any]:
        scenario = four_way(density, profile="fair")
        return outcome_of(Recipe(scenario, FixedTime(greens=(8.0,) * 4), 1)).row

    flood = row_at(800.0)
    served = (flood["trips"] - flood["unfinished"]) / 4.0
    # The first 80 s pass before a vehicle has left; growth of 2 % still counts as served.
    capacity = 1.02 * served / (1.0 - 80.0 / 3600.0)
    # Three standard deviations below and above (module docstring of `capacity`).
    assert [grows(row_at(share * capacity)) for share in (0.87, 1.13)] == [False, True]


def test_growth_is_a_share_of_arrivals() -> None:
    assert not grows({"queue_growth": 10.0, "trips": 1000})
    assert grows({"queue_growth": 10.1, "trips": 1000})
