"""Results of studies for figures and reports, looked up when first needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from minisim.errors import MinisimError, plural
from scenarios.studies import study_named
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.points import Point
from scenarios.studies.shared.study import Find, Results, Runs
from scenarios.sweep.keys import key_of

if TYPE_CHECKING:
    from scenarios.recipe import Recipe
    from scenarios.sweep.store import Store


class MissingRunsError(MinisimError):
    """A figure needs runs that are not there."""


def find_in(store: Store | None) -> Find:
    """Look up runs in a store; failed and outdated runs do not count."""

    def find(recipes: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        if store is None:
            return [None] * len(recipes)
        keys = [*map(key_of, recipes)]
        return [*map(store.valid(keys).get, keys)]

    return find


class Archive:
    """The results of studies, by name."""

    def __init__(self, find: Find, effort: Effort) -> None:
        self.effort = effort
        self.study = cache(lambda name: study_named(name).collect(effort, find))

    def need(self, *names: str) -> tuple[Results, ...]:
        """The results of these studies; `MissingRunsError` if none has a run."""
        results = tuple(map(self.study, names))
        if names and all(each.good.empty for each in results):
            extent = results[0].study.extent(self.effort)
            raise MissingRunsError(
                f"the store has no run of {' or '.join(names)} with {extent}; make them with: "
                f"{self.effort.command(*names)}"
            )
        return results


def missing_note(*results: Results, wanted: Callable[[Point], bool] = lambda _: True) -> str:
    """What a figure of the `wanted` points shows and what it lacks, in small print."""
    effort = results[0].effort
    runs = {
        f"{point.series} ({each.study.name}, {point.where}, {point.density:g})": count
        for each in results
        for point, count in each.runs.items()
        if wanted(point)
    }
    fewer = [f"{name} has {n.made}" for name, n in runs.items() if 0 < n.made < n.wanted]
    missing = [name for name, count in runs.items() if not count.made]
    shown = 1 if fewer and missing else 3  # there is room for two lines
    horizon = min(effort.horizon, *(each.study.longest for each in results))
    text = f"{effort.warning}{_extent([*runs.values()])}, {horizon:g} s each."
    if fewer:
        text += f"  Fewer runs: {_listed(fewer, shown)}."
    if missing:
        text += f"  Not drawn, since there is no run: {_listed(missing, shown)}."
    return text


def _extent(runs: Sequence[Runs]) -> str:
    """The seeds per case, and how many runs there are if some are missing."""
    seeds = sorted({count.wanted for count in runs})
    span = f"{seeds[0]} to {seeds[-1]} seeds" if len(seeds) > 1 else plural(seeds[0], "seed")
    made, wanted = (sum(counts) for counts in zip(*runs, strict=True))
    return span if made == wanted else f"{made} of {plural(wanted, 'run')} ({span} per case)"


def _listed(texts: Sequence[str], shown: int) -> str:
    more = f"; and {len(texts) - shown} more" if len(texts) > shown else ""
    return f"{'; '.join(texts[:shown])}{more}"
