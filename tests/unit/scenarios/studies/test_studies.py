"""Studies: what they run, and what is known of their runs."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from dim import Dim, Mixed
from scenarios import studies
from scenarios.controllers import RIVALS
from scenarios.paper import SERIES, Cell, controller_of, scenario
from scenarios.recipe import Recipe
from scenarios.studies import NAMES, SEARCHES, study_named
from scenarios.studies.capacity import CapacityStudy
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.points import ControllerPoint, fair
from scenarios.studies.shared.study import Results
from scenarios.sweep.keys import key_of
from tests.builders import synthetic_find, synthetic_row


def test_every_module_is_a_named_study_with_a_section_of_its_figures() -> None:
    modules = {file.stem for file in Path(studies.__path__[0]).glob("[a-z]*.py")}
    assert modules == {studies.module_name(name) for name in NAMES}
    for name in NAMES:
        assert study_named(name).name == name
        assert isinstance(study_named(name), CapacityStudy) == (name in SEARCHES)
        assert import_module(f"figures.studies.{studies.module_name(name)}").SECTION.items


@pytest.mark.parametrize("name", ["text", "as-run"])
def test_the_paper_s_grid_is_700_hours(name: str) -> None:
    """4 controllers × 5 densities × 3 splits on 4 arms, DIM × 5 on 3 and 5 arms, 10 seeds."""
    points = study_named(name).points
    assert len(points) == len(set(points)) == 4 * 5 * 3 + 2 * 5
    runs = study_named(name).runs(10)
    assert len({key_of(recipe) for _, recipe in runs}) == len(runs)
    assert len(runs) == 700 - 7 * sum(c.series in study_named(name).few for c in points)


def test_priorities_by_inflow_where_the_text_has_them() -> None:
    """The highest is that "with the maximum incoming traffic": a and c, then b and d."""
    wanted = ControllerPoint("paper", "dim", "dim:priorities=inflow", 4, "4:1:4:1", 200.0)
    assert wanted in study_named("text").points
    recipe = wanted.recipe(1)
    assert isinstance(recipe.controller, Dim)
    assert recipe.controller.ranks(recipe.scenario.site()) == (0, 2, 1, 3)


def test_the_as_run_study_runs_what_ran() -> None:
    """Discrepancies 10 to 14; tests/unit/scenarios/test_paper.py has the details."""
    points = [point for point in study_named("as-run").points if point.arms == 4]
    for name, series in SERIES.items():
        for point in (point for point in points if point.series == series):
            cell = Cell(point.split, int(point.density), 4, name)
            recipe = point.recipe(1)
            assert (recipe.scenario, recipe.controller) == (scenario(*cell), controller_of(*cell))


def test_all_controllers_of_a_study_share_their_arrivals() -> None:
    same = [c for c in study_named("fair").points if c.density == 200.0]
    assert [c.series for c in same] == list(RIVALS)
    runs = [c.recipe(3, 120.0) for c in same]
    assert len({(recipe.scenario, recipe.seed) for recipe in runs}) == 1
    assert len({key_of(recipe) for recipe in runs}) == len(runs)


def test_the_humans_study_tells_its_shares_apart() -> None:
    study = study_named("humans")
    assert len(study.points) == len(set(study.points)) == 4 * (2 * 11 + 1)
    runs = study.runs(2)
    assert len({(e.name, e.scenario.density, e.seed) for _, e in runs}) == len(runs)
    shares = {c.humans: c.recipe(1).driven for c in study.points if c.series == "dim"}
    assert shares[0.0] == Dim()
    assert shares[0.4] == Mixed(Dim(), 0.4)
    assert fair("dim", 4, 150.0, 0.4).where == "40% humans, 4 arms, balanced"


def test_results_say_what_is_missing() -> None:
    study = study_named("gate")
    effort = Effort(seeds=2, horizon=120.0)

    def row_of(recipe: Recipe) -> Mapping[str, Any] | None:
        if recipe.label == "dim":
            return synthetic_row(recipe)
        return None if recipe.seed == 1 else {**synthetic_row(recipe), "error": "broken"}

    results = study.collect(effort, lambda asked: [*map(row_of, asked)])
    wanted = {point: (2 if point.series == "dim" else 0, 2) for point in results.runs}
    assert results.runs == wanted
    assert results.rows["error"].notna().sum() == 2 * len(study.points) // 3
    assert len(results.good) == 2 * len(study.points) // 3
    assert study.collect(effort, lambda asked: [None] * len(asked)).good.empty


def test_efforts_choose_points_and_seeds() -> None:
    quick = Effort.of(quick=True, seeds=3)
    assert quick.seeds == 3
    assert {point.density for point in study_named("fair").chosen(quick)} == {150.0, 350.0}
    assert Effort.of() == Effort()
    few = study_named("as-run").collect(Effort(seeds=5, horizon=60.0), synthetic_find).good
    assert few.groupby("series")["seed"].nunique().to_dict() == {
        "dim": 5, "fixed-time": 5, "adaptive": 5, "v2ic": 3,
    }  # fmt: skip


@pytest.mark.parametrize("name", ["text", "as-run", "fair", "humans"])
def test_a_verdict_without_runs_says_how_to_make_them(name: str) -> None:
    study, effort = study_named(name), Effort()
    assert study.verdict is not None
    said = study.verdict(Results.of(study, effort, [(point, None) for point in study.points]))
    assert effort.command(name) in said


def test_the_optimum_study_has_a_schedule_beside_the_rivals_and_time_for_every_vehicle() -> None:
    study = study_named("optimum")
    assert {point.series for point in study.points} == {"schedule", *RIVALS}
    for point in study.points[:: len(study.points) // 7]:
        recipe = point.recipe(2, 1000.0)
        assert recipe.name == point.series
        assert (recipe.scenario.until, recipe.scenario.horizon) == (500.0, 2100.0)
    assert len(study.runs(10)) == 12 * 10 * (1 + len(RIVALS))
