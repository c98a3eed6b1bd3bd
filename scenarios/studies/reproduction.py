"""Everything that figures and report are made from, run in one go and kept in a store."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from minisim.errors import choice
from scenarios.recipe import Recipe
from scenarios.studies.archive import Archive
from scenarios.studies.capacity import CASES, Search, capacities
from scenarios.studies.results import Effort, Find
from scenarios.studies.study import STUDIES
from scenarios.sweep.keys import key_of
from scenarios.sweep.pool import workers
from scenarios.sweep.rows import Row
from scenarios.sweep.runner import finished
from scenarios.sweep.store import Store

#: The search for capacities, which is no study: what it runs depends on what it finds.
CAPACITY = "capacity"
#: Everything that can be reproduced.
PARTS = (*STUDIES, CAPACITY)

#: Called with the runs of a study that are done, and their number.
Report = Callable[[int, int], None]


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is run.

    Attributes:
        effort: of every study.
        search: for capacities.
        parts: which of `PARTS`.

    Raises:
        InputError: an unknown part.
    """

    effort: Effort = field(default_factory=Effort)
    search: Search = field(default_factory=Search)
    parts: tuple[str, ...] = PARTS

    def __post_init__(self) -> None:
        for part in self.parts:
            choice("study", part, PARTS)

    @classmethod
    def of(
        cls, *, quick: bool = False, seeds: int | None = None, parts: Iterable[str] | None = None
    ) -> Plan:
        """The full plan or the smoke test; another number of seeds, or fewer parts, where given."""
        chosen = tuple(parts or PARTS)
        if quick:
            effort = Effort.quick(2 if seeds is None else seeds)
            return cls(effort=effort, search=Search.quick(), parts=chosen)
        return cls(effort=Effort() if seeds is None else Effort(seeds=seeds), parts=chosen)

    def archive(self, find: Find) -> Archive:
        """What figures are made from, wherever the runs are."""
        return Archive(find, self.effort, self.search)


@dataclass(frozen=True)
class Made:
    """What one call of `reproduce` did.

    Attributes:
        name: of the study, or "capacity".
        runs: that it consists of.
        hours: simulated by them.
        computed: how many were not in the store before.
        wall_s: time that it took.
        cpu_s: processor time of all its runs, whenever they were made.
        failed: rows of failed runs.
    """

    name: str
    runs: int
    hours: float
    computed: int
    wall_s: float
    cpu_s: float
    failed: tuple[Row, ...]


def reproduce(plan: Plan, store: Store, jobs: int, report: Report) -> list[Made]:
    """Run every study, then search for capacities; what the store has is not run again.

    Args:
        plan: how much.
        store: where the rows go.
        jobs: processes.
        report: of progress.

    Raises:
        FileError: the store cannot be written.
    """
    return [
        _capacity(plan, store, jobs, report)
        if part == CAPACITY
        else _study(part, plan, store, jobs, report)
        for part in plan.parts
    ]


def find_in(store: Store) -> Find:
    """Looks experiments up in a store: a failed or outdated run counts as none."""

    def find(experiments: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        keys = [key_of(experiment) for experiment in experiments]
        rows = store.valid(keys)
        return [rows.get(key) for key in keys]

    return find


def _study(name: str, plan: Plan, store: Store, jobs: int, report: Report) -> Made:
    experiments = [experiment for _, experiment in plan.effort.runs(STUDIES[name])]
    known = sum(row is not None for row in find_in(store)(experiments))
    began = time.monotonic()
    failed = []
    cpu = 0.0
    for done, (_, row) in enumerate(finished(experiments, jobs=jobs, store=store), start=1):
        report(done, len(experiments))
        cpu += row.get("cpu_s", 0.0)
        if row["error"] is not None:
            failed.append(row)
    return Made(
        name, len(experiments), len(experiments) * plan.effort.horizon / 3600.0,
        len(experiments) - known, time.monotonic() - began, cpu, tuple(failed),
    )  # fmt: skip


def _capacity(plan: Plan, store: Store, jobs: int, report: Report) -> Made:
    """Round by round: the demands of one depend on the results of the last."""
    search = plan.search
    rounds = search.steps.bit_length() - 1
    total = rounds * search.seeds * len(CASES)
    known = asked = 0
    cpu = 0.0
    failed: list[Row] = []
    began = time.monotonic()
    with workers(jobs) as executor:

        def run(experiments: Sequence[Recipe]) -> list[Row | None]:
            nonlocal known, asked, cpu
            known += sum(row is not None for row in find_in(store)(experiments))
            rows: dict[int, Row] = {}
            for k, row in finished(experiments, executor, store=store):
                rows[k] = row
                cpu += row.get("cpu_s", 0.0)
                report(asked + len(rows), total)
            asked += len(experiments)
            failed.extend(row for row in rows.values() if row["error"] is not None)
            return [rows[k] for k in range(len(experiments))]

        capacities(CASES, search, run)
    return Made(
        CAPACITY, asked, asked * search.horizon / 3600.0, asked - known,
        time.monotonic() - began, cpu, tuple(failed),
    )  # fmt: skip
