"""A study: points that answer a question, and the rows of their runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from scenarios.recipe import Recipe
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.points import Point

if TYPE_CHECKING:
    import pandas as pd

#: Gives for each recipe its row of a sweep, or None where it was never run.
Find = Callable[[Sequence[Recipe]], Sequence[Mapping[str, Any] | None]]


@dataclass(frozen=True)
class Study:
    """Points that answer one question.

    Attributes:
        name: on the command line.
        question: in one line.
        points: without repetition.
        few: series -> most seeds, where a run costs too much for more.
        about_collisions: whether its figures show collisions, so that no list needs to.
    """

    name: str
    question: str
    points: tuple[Point, ...]
    few: Mapping[str, int] = field(default_factory=dict)
    about_collisions: bool = False

    def runs(
        self, seeds: int, horizon: float = 3600.0, points: Iterable[Point] | None = None
    ) -> list[tuple[Point, Recipe]]:
        """The seeds 1 … `seeds` of all points or some, seed by seed within each point."""
        return [
            (point, point.recipe(seed, horizon))
            for point in (self.points if points is None else points)
            for seed in range(1, min(seeds, self.few.get(point.series, seeds)) + 1)
        ]

    def chosen(self, effort: Effort) -> tuple[Point, ...]:
        """The points that an effort runs: all where none has one of its demands."""
        wanted = effort.densities
        some = tuple(p for p in self.points if wanted is None or p.density in wanted)
        return some or self.points

    def collect(self, effort: Effort, find: Find) -> Results:
        """Ask for every run.

        Args:
            effort: which points, seeds and horizon.
            find: gives the rows, by running the recipes or from a store. A study that goes by
                what it finds asks several times.
        """
        runs = self.runs(effort.seeds, effort.horizon, self.chosen(effort))
        rows = find([recipe for _, recipe in runs])
        return Results.of(
            self, effort, [(point, row) for (point, _), row in zip(runs, rows, strict=True)]
        )

    def most_runs(self, effort: Effort) -> int:
        """How many runs `collect` asks for, at most."""
        return len(self.runs(effort.seeds, effort.horizon, self.chosen(effort)))

    def extent(self, effort: Effort) -> str:
        """Which seeds and horizon an effort gives it, in words."""
        return f"the seeds 1 … {effort.seeds} over {effort.horizon:g} s"


class Runs(NamedTuple):
    """How many of a point's runs there are.

    Attributes:
        made: without failing.
        wanted: by the effort.
    """

    made: int
    wanted: int


@dataclass(frozen=True, eq=False)
class Results:
    """What is known about a study.

    Attributes:
        study: what was asked.
        effort: how much of it was.
        rows: one for each run that was made: the columns of a sweep, with those of its point.
        runs: of each point, in their order.
    """

    study: Study
    effort: Effort
    rows: pd.DataFrame
    runs: Mapping[Point, Runs]

    @classmethod
    def of(
        cls, study: Study, effort: Effort, asked: Sequence[tuple[Point, Mapping[str, Any] | None]]
    ) -> Results:
        """From each point that was asked for with the row that came, in order."""
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
    def missing(self) -> tuple[Point, ...]:
        """Points without a successful run."""
        return tuple(point for point, runs in self.runs.items() if not runs.made)

    @property
    def good(self) -> pd.DataFrame:
        """The rows of runs that did not fail."""
        return self.rows[self.rows["error"].isna()]

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of runs that failed."""
        return self.rows[self.rows["error"].notna()]
