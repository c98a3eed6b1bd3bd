"""The runs of a study, found among all that was ever simulated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from minisim.errors import integer, number, numbers
from scenarios.recipe import Recipe
from scenarios.studies.study import AnyCase, Study

if TYPE_CHECKING:
    import pandas as pd

#: Gives for each experiment its row of a sweep, or None where it was never run.
Find = Callable[[Sequence[Recipe]], Sequence[Mapping[str, Any] | None]]


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is simulated for a study.

    Attributes:
        seeds: runs a case, the seeds 1 … `seeds`.
        horizon: of each run [s].
        densities: only cases with these demands [veh/h/lane], in studies that have such; None
            is all.
    """

    seeds: int = 10
    horizon: float = 3600.0
    densities: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        integer("seeds", self.seeds, low=2, high=10_000)
        number("horizon [s]", self.horizon, above=0)
        if self.densities is not None:
            object.__setattr__(self, "densities", numbers("densities", self.densities))

    @classmethod
    def quick(cls, seeds: int = 2) -> Effort:
        """A smoke test: the same cases at two demands, some minutes each."""
        return cls(seeds=seeds, horizon=150.0, densities=(150.0, 350.0))

    def cases(self, study: Study) -> tuple[AnyCase, ...]:
        """The cases of a study that are run: all where none has one of the demands."""
        chosen = self.densities
        found = tuple(case for case in study.cases if chosen is None or case.density in chosen)
        return found or study.cases

    def runs(self, study: Study) -> list[tuple[AnyCase, Recipe]]:
        """The runs of a study, seed by seed within each case."""
        return study.runs(self.seeds, self.horizon, self.cases(study))


class Runs(NamedTuple):
    """How many of a case's runs there are.

    Attributes:
        found: that did not fail.
        wanted: by the effort.
    """

    found: int
    wanted: int


@dataclass(frozen=True, eq=False)
class Results:
    """What is known about a study.

    Attributes:
        study: what was asked.
        effort: how much of it was.
        rows: one a run found: the columns of a sweep, with those of its case.
        runs: of each case, in their order.
    """

    study: Study
    effort: Effort
    rows: pd.DataFrame
    runs: Mapping[AnyCase, Runs]

    @property
    def missing(self) -> tuple[AnyCase, ...]:
        """Cases without a successful run."""
        return tuple(case for case, runs in self.runs.items() if not runs.found)

    @property
    def good(self) -> pd.DataFrame:
        """The rows of runs that did not fail."""
        return self.rows[self.rows["error"].isna()]

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of runs that failed."""
        return self.rows[self.rows["error"].notna()]


def collect(study: Study, effort: Effort, find: Find) -> Results:
    """Look up every run of a study.

    Args:
        study: whose cases.
        effort: which of them, with which seeds and horizon.
        find: where to look.
    """
    import pandas as pd

    runs = effort.runs(study)
    found = find([experiment for _, experiment in runs])
    rows = [
        {**row, **case._asdict()}
        for (case, _), row in zip(runs, found, strict=True)
        if row is not None
    ]
    columns = None if rows else [*study.cases[0]._asdict(), "seed", "error"]
    wanted = Counter(case for case, _ in runs)
    good = Counter(
        case
        for (case, _), row in zip(runs, found, strict=True)
        if row is not None and not row["error"]
    )
    return Results(
        study,
        effort,
        pd.DataFrame(rows, columns=columns),
        {case: Runs(good[case], count) for case, count in wanted.items()},
    )
