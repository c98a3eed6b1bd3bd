"""The paper's grid as its published runs were made."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from scenarios.paper import BASELINE_GRID, GRID, SERIES, Cell, controller_of, scenario
from scenarios.recipe import Recipe
from scenarios.studies.shared.study import Study


class PublishedPoint(NamedTuple):
    """A published run, also where that is not what its label says.

    Attributes:
        series: its controller, by our name.
        arms: of the junction.
        split: of the inflow over the lanes.
        density: mean inflow a lane [veh/h].
    """

    series: str
    arms: int
    split: str
    density: float

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed; collisions are counted, for some published rules have them."""
        name = {ours: theirs for theirs, ours in SERIES.items()}[self.series]
        cell = Cell(self.split, int(self.density), self.arms, name)
        return Recipe(
            replace(scenario(*cell), horizon=horizon), controller_of(*cell), seed,
            label=self.series, on_collision="record",
        )  # fmt: skip

    @property
    def where(self) -> str:
        """What tells it from other points of its series, but for the demand."""
        return f"{self.arms} arms, {self.split}"


STUDY = Study(
    "as-run",
    "What do the rules and vehicles that produced the published numbers give?",
    tuple(
        PublishedPoint(SERIES[cell.controller], cell.arms, cell.split, float(cell.density))
        for cell in (*GRID, *BASELINE_GRID)
    ),
    # The published V2I-C decides every 0.01 s and costs some 20 s of CPU a simulated hour, a
    # hundred times a signal; its runs differ little.
    {"v2ic": 3},
)
