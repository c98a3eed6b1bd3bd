"""Many runs at once: experiments over processes or a caller's executor, one row each."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from minisim.errors import ExecutorError, instance, integer
from minisim.results.metrics import Metric, asked_metrics
from scenarios.recipe import Recipe
from scenarios.sweep.keys import key_of
from scenarios.sweep.pool import given, handed, pooled
from scenarios.sweep.rows import Row, failed, outcome_of
from scenarios.sweep.store import Store

if TYPE_CHECKING:
    import pandas as pd

#: What a run left that a caller's executor never finished.
GIVEN_UP = (BrokenExecutor, CancelledError)

Progress = Callable[[int, int], None]


def sweep(
    experiments: Iterable[Recipe],
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    jobs: int | None = None,
    store: Store | None = None,
    metrics: Iterable[str | Metric] = (),
) -> pd.DataFrame:
    """Run all experiments and return one row each, in their order.

    The rows do not depend on the executor, nor on the number of its workers, but for the columns
    `MEASURED`.

    Args:
        experiments: what to run.
        executor: any `concurrent.futures.Executor`, which stays open, such as
            `dask.distributed.Client.get_executor()`; None is a pool of processes, as short-lived
            as the call. They are spawned, so a script that sweeps needs the usual
            `if __name__ == "__main__":`.
        progress: called with the runs done and their number, in this process.
        jobs: processes of the pool, one a core unless told; 1 runs in this process.
        store: rows go there as they come, and those that it holds are not computed again.
        metrics: columns besides the usual: names of `minisim.results.metrics.METRICS`, or
            `Metric`s of your own. With several processes, the function of an own one must be in
            a module that they can import.

    Returns:
        What was run (`scenarios.sweep.rows.identity_of`), the keys of `Run.summary()`, nested
        ones joined by "_" (`lanes_a_trips`, `complete_waiting_time_s`), `queue_growth`, `growing`
        (`scenarios.statistics.growing`, which says when it means nothing), `arrivals` (alike for
        common arrivals), `cpu_s`, `version`, and `error`: why a run failed, missing where it did
        not.

    Raises:
        InputError: something other than a `Recipe` or a `Store`, or jobs beside an executor.
        FileError: the store cannot be written; what it has stays.
        ExecutorError: a caller's executor gave runs up, such as a cluster whose scheduler died;
            what was done is in the store. Without a store, their rows have it as an error.
    """
    import pandas as pd

    added = asked_metrics(metrics)
    todo = [with_metrics(experiment, added) for experiment in experiments]
    rows: dict[int, Row] = {}
    with closing(finished(todo, executor, jobs=jobs, store=store)) as results:
        for k, row in results:
            rows[k] = row
            if progress is not None:
                progress(len(rows), len(todo))
    return pd.DataFrame([rows[k] for k in range(len(todo))])


def with_metrics(recipe: Recipe, metrics: Iterable[str | Metric]) -> Recipe:
    """The recipe with more metrics; raises `InputError` as it does."""
    instance("experiment", recipe, Recipe)
    return replace(recipe, metrics=(*recipe.metrics, *metrics))


def finished(
    experiments: Iterable[Recipe],
    executor: Executor | None = None,
    *,
    jobs: int | None = None,
    store: Store | None = None,
) -> Generator[tuple[int, Row]]:
    """Position and row of each experiment as it is done; what the store has comes first.

    Arguments and errors are those of `sweep`. Close it to give up.
    """
    todo = list(experiments)
    for experiment in todo:
        instance("experiment", experiment, Recipe)
    if jobs is None:
        jobs = os.cpu_count() or 1
    integer("jobs", jobs, low=1, high=1024)
    if store is not None:
        instance("store (open it with `Store(path)`)", store, Store)
    missing = dict(enumerate(todo))
    if store is not None:
        keys = [key_of(experiment) for experiment in todo]
        valid = store.valid(keys)
        for k, key in enumerate(keys):
            if key in valid:
                del missing[k]
                yield k, valid[key]
    if executor is None:
        results = pooled(outcome_of, missing, jobs, begin=partial(_warm, list(missing.values())))
    else:
        results = given(outcome_of, missing, executor)
    lost = 0
    with closing(results):
        for k, result in results:
            given_up = executor is not None and isinstance(result, GIVEN_UP)
            if store is not None and given_up:
                lost += 1
                continue
            outcome = failed(todo[k], result) if isinstance(result, BaseException) else result
            if store is not None:
                store.put(todo[k], outcome)
            yield k, outcome.row
    if store is not None and lost:
        raise ExecutorError(
            f"the executor gave up {lost} of {len(todo)} runs; what was done is in {store.path}, "
            "and the same sweep goes on from there"
        )


def _warm(experiments: Iterable[Recipe], pool: Executor) -> None:
    """Compile once for all processes: one of them compiles to disk before the others start.

    Otherwise every process of a fresh installation would compile for itself, all at the same time.
    What is compiled depends on the vehicle. A run that fails here will tell why when its turn
    comes.
    """
    for experiment in {type(e.scenario.profile.vehicle): e for e in experiments}.values():
        scenario = replace(experiment.scenario, horizon=experiment.scenario.profile.dt, warmup=0.0)
        try:
            tried = handed(pool, outcome_of, replace(experiment, scenario=scenario))
        except BrokenExecutor:
            return
        tried.exception()
