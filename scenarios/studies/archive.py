"""What figures and reports are made from: the results of studies, looked up when first needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

from minisim.errors import MinisimError
from scenarios.studies.capacity import CASES, Capacity, Search, capacities
from scenarios.studies.results import Effort, Find, Results, Runs, collect
from scenarios.studies.study import AnyCase, Case, study_named

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


class MissingRunsError(MinisimError):
    """A figure needs runs that nobody has made."""


class Archive:
    """The results that a store holds.

    Args:
        find: where the runs are.
        effort: how many runs a case.
        search: how capacity was looked for.
    """

    def __init__(self, find: Find, effort: Effort, search: Search) -> None:
        self.effort = effort
        self.search = search
        self.study: Callable[[str], Results] = cache(self._collect)
        self._find = find

    def _collect(self, name: str) -> Results:
        return collect(study_named(name), self.effort, self._find)

    def capacities(self) -> tuple[list[Capacity], list[Case]]:
        """Every capacity that is known, and the cases of which it is not.

        Raises:
            MissingRunsError: none is known.
        """
        found, missing = capacities(CASES, self.search, self._find)
        if not found:
            raise MissingRunsError(
                f"the store has no search for capacities with the seeds 1 … {self.search.seeds} "
                f"over {self.search.horizon:g} s; make it with: "
                f"{make_command(self.effort, 'capacity')}"
            )
        return found, missing

    def need(self, *names: str) -> tuple[Results, ...]:
        """The results of studies.

        Raises:
            MissingRunsError: none of them has a run; says how to make them.
        """
        found = tuple(self.study(name) for name in names)
        if all(results.good.empty for results in found):
            raise MissingRunsError(
                f"the store has no run of {' or '.join(names)} with the seeds 1 … "
                f"{self.effort.seeds} over {self.effort.horizon:g} s; make them with: "
                f"{make_command(self.effort, *names)}"
            )
        return found


def make_command(effort: Effort, *names: str) -> str:
    """The command that makes an effort's runs of studies."""
    only = "".join(f" --only {name}" for name in names)
    quick = " --quick" if effort.densities is not None else ""
    return f"minisim reproduce{only}{quick} --seeds {effort.seeds}"


def smoke_test(effort: Effort) -> str:
    """A warning where only some demands were run, and for minutes; empty otherwise."""
    return "" if effort.densities is None else "Smoke test, which means nothing: "


def missing_note(results: Iterable[Results], wanted: Callable[[AnyCase], bool]) -> str:
    """What a figure shows and what it lacks, in small print.

    Args:
        results: drawn.
        wanted: whether a case belongs to the figure.
    """
    found = tuple(results)
    effort = found[0].effort
    runs = {
        (results.study.name, case): count
        for results in found
        for case, count in results.runs.items()
        if wanted(case)
    }
    fewer = [
        f"{_named(*key)} has {count.found}"
        for key, count in runs.items()
        if 0 < count.found < count.wanted
    ]
    missing = [_named(*key) for key, count in runs.items() if not count.found]
    shown = 1 if fewer and missing else 3  # there is room for two lines
    text = f"{smoke_test(effort)}{_extent(runs.values())}, {effort.horizon:g} s each."
    if fewer:
        text += f"  Fewer runs: {_listed(fewer, shown)}."
    if missing:
        text += f"  Not drawn, for there is no run: {_listed(missing, shown)}."
    return text


def _extent(runs: Iterable[Runs]) -> str:
    """How many runs there are: seeds a case, or runs of those wanted where some are missing."""
    known = list(runs)
    seeds = sorted({count.wanted for count in known})
    span = f"{seeds[0]} to {seeds[-1]} seeds" if len(seeds) > 1 else f"{seeds[0]} seeds"
    there, asked = sum(count.found for count in known), sum(count.wanted for count in known)
    return span if there == asked else f"{there} of {asked} runs ({span} a case)"


def _named(study: str, case: AnyCase) -> str:
    return f"{case.series} ({study}, {case.where}, {case.density:g})"


def _listed(texts: Sequence[str], shown: int) -> str:
    """The first ones, and how many more there are."""
    more = f"; and {len(texts) - shown} more" if len(texts) > shown else ""
    return f"{'; '.join(texts[:shown])}{more}"
