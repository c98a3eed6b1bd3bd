"""A study: points that answer a question, and the results of their runs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from scenarios.recipe import Recipe
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.points import Point

if TYPE_CHECKING:
    import pandas as pd

#: Gives the row of each recipe, or None if it was never run.
Find = Callable[[Sequence[Recipe]], Sequence[Mapping[str, Any] | None]]

#: Column of `with_total_delay`.
TOTAL_DELAY = "total_delay_s"


@dataclass(frozen=True)
class Study:
    """Points that answer one question."""

    name: str  # on the command line
    question: str  # in one line
    points: tuple[Point, ...]  # each once
    #: Series -> most seeds, if more would cost too much
    few: Mapping[str, int] = field(default_factory=dict)
    #: Answers the question from the results, in a few sentences for the head of the report.
    verdict: Callable[[Results], str] | None = None
    about_collisions: bool = False  # its figures show them, so the report does not list them
    longest: float = math.inf  # most simulated time of a run, if more would cost too much [s]

    def runs(
        self, seeds: int, horizon: float = 3600.0, points: Sequence[Point] = ()
    ) -> list[tuple[Point, Recipe]]:
        """The runs with seeds 1 … `seeds` of `points`, or of all points, point by point."""
        return [
            (point, point.recipe(seed, min(horizon, self.longest)))
            for point in points or self.points
            for seed in range(1, min(seeds, self.few.get(point.series, seeds)) + 1)
        ]

    def chosen(self, effort: Effort) -> tuple[Point, ...]:
        """The points with the effort's demands; all points if none has one of them."""
        return tuple(p for p in self.points if p.density in (effort.densities or ())) or self.points

    def collect(self, effort: Effort, find: Find) -> Results:
        """Ask `find` for the rows of all runs: several times if the study searches."""
        runs = self.runs(effort.seeds, effort.horizon, self.chosen(effort))
        points, recipes = zip(*runs, strict=True)
        return Results.of(self, effort, [*zip(points, find(recipes), strict=True)])

    def most_runs(self, effort: Effort) -> int:
        """The most runs that `collect` asks for."""
        return len(self.runs(effort.seeds, effort.horizon, self.chosen(effort)))

    def extent(self, effort: Effort) -> str:
        """The seeds and the horizon, in words."""
        return f"the seeds 1 … {effort.seeds} over {min(effort.horizon, self.longest):g} s"


class Runs(NamedTuple):
    """How many runs of a point succeeded, and how many the effort wants."""

    made: int
    wanted: int


@dataclass(frozen=True, eq=False)
class Results:
    """What is known about a study."""

    study: Study
    effort: Effort  # how much of it was asked for
    rows: pd.DataFrame  # one per run made: the columns of a sweep and those of its point
    runs: Mapping[Point, Runs]  # of each point, in order

    @classmethod
    def of(
        cls, study: Study, effort: Effort, asked: Sequence[tuple[Point, Mapping[str, Any] | None]]
    ) -> Results:
        """The results, from pairs of a point and the row of its run, in order."""
        import pandas as pd

        rows = [{**row, **point._asdict()} for point, row in asked if row is not None]
        columns = None if rows else [*study.points[0]._asdict(), "seed", "error"]
        wanted = Counter(point for point, _ in asked)
        made = Counter(point for point, row in asked if row is not None and not row["error"])
        return cls(
            study, effort, pd.DataFrame(rows, columns=columns),
            {point: Runs(made[point], count) for point, count in wanted.items()},
        )  # fmt: skip

    @property
    def good(self) -> pd.DataFrame:
        """The rows of runs that did not fail."""
        return self.rows[self.rows["error"].isna()]


def with_total_delay(rows: pd.DataFrame) -> pd.DataFrame:
    """Add `total_delay_s`: mean time loss on the road plus mean departure delay, both complete.

    Unlike SUMO's total delay, it includes vehicles that have not arrived or not even departed.
    """
    lost, late = rows["complete_time_loss_s"], rows["complete_depart_delay_s"]
    return rows.assign(total_delay_s=lost.astype(float) + late.astype(float))
