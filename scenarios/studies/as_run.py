"""The paper's grid, run the way the published runs were made."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from scenarios.paper import BASELINE_GRID, GRID, SERIES, Cell, controller_of, scenario
from scenarios.recipe import Recipe
from scenarios.studies.shared.paper_comparison import agreement
from scenarios.studies.shared.study import Study


class PublishedPoint(NamedTuple):
    """A published run, even if it is not what its label says; fields as in `ControllerPoint`."""

    series: str
    arms: int
    split: str
    density: float

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed. Collisions are counted: some published rules have them."""
        name = {ours: theirs for theirs, ours in SERIES.items()}[self.series]
        cell = Cell(self.split, int(self.density), self.arms, name)
        return Recipe(
            replace(scenario(*cell), horizon=horizon), controller_of(*cell), seed,
            label=self.series, on_collision="record",
        )  # fmt: skip

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""
        return f"{self.arms} arms, {self.split}"


STUDY = Study(
    "as-run",
    "What do the rules and vehicles behind the published numbers give?",
    tuple(
        PublishedPoint(SERIES[cell.controller], cell.arms, cell.split, float(cell.density))
        for cell in (*GRID, *BASELINE_GRID)
    ),
    # It decides every 0.01 s, so that an hour costs some 20 s of CPU, and its runs differ little.
    {"v2ic": 3},
    agreement,
)
