"""Run a study and keep its rows in a store."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from scenarios.recipe import Recipe
from scenarios.studies import study_named
from scenarios.studies.shared.archive import find_in
from scenarios.studies.shared.effort import Effort
from scenarios.sweep.rows import Row
from scenarios.sweep.runner import finished
from scenarios.sweep.store import Store


@dataclass(frozen=True)
class Made:
    """What one call of `reproduce` did for a study."""

    name: str  # of the study
    runs: int  # all of its runs
    hours: float  # simulated by them
    computed: int  # runs that were not in the store before
    wall_s: float  # time that the call took
    cpu_s: float  # processor time of all runs, whenever they were made
    failed: tuple[Row, ...]  # rows of failed runs


def reproduce(
    name: str, effort: Effort, store: Store, jobs: int, progress: Callable[[int, int], None]
) -> Made:
    """Run a study in `jobs` processes. The store keeps the rows, and its runs are not made again.

    `progress` is called with the number of runs done and the most there can be. Raises `FileError`.
    """
    study = study_named(name)
    total = study.most_runs(effort)
    known, hours = 0, 0.0
    rows: list[Row] = []
    began = time.monotonic()

    def run(recipes: Sequence[Recipe]) -> list[Row]:
        nonlocal known, hours
        known += sum(row is not None for row in find_in(store)(recipes))
        hours += sum(recipe.scenario.horizon for recipe in recipes) / 3600.0
        made: dict[int, Row] = {}
        for k, row in finished(recipes, jobs=jobs, store=store):
            made[k] = row
            progress(len(rows) + len(made), total)
        given = [made[k] for k in range(len(recipes))]
        rows.extend(given)
        return given

    study.collect(effort, run)
    return Made(
        name, len(rows), hours, len(rows) - known, time.monotonic() - began,
        sum(row.get("cpu_s", 0.0) for row in rows),
        tuple(row for row in rows if row["error"] is not None),
    )  # fmt: skip
