"""Many runs at once, in processes of our own or a caller's executor; one row each."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from minisim.errors import ExecutorError, InputError, instance, integer, plural, show
from minisim.results.asked import Asked
from scenarios.loading import metrics_named
from scenarios.recipe import Recipe
from scenarios.sweep.keys import content_of, key_of
from scenarios.sweep.pool import given, handed, pooled
from scenarios.sweep.rows import Row, failed, outcome_of
from scenarios.sweep.store import Store

if TYPE_CHECKING:
    import pandas as pd

#: Raised for runs that a caller's executor gave up.
GIVEN_UP = (BrokenExecutor, CancelledError)

Progress = Callable[[int, int], None]


def sweep(
    recipes: Iterable[Recipe],
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    jobs: int | None = None,
    store: Store | None = None,
    metrics: str | Iterable[Asked] = (),
) -> pd.DataFrame:
    """Run all recipes and return one row each, in their order.

    Args:
        recipes: what to run.
        executor: any `concurrent.futures.Executor`, such as
            `dask.distributed.Client.get_executor()`; it stays open. None means a pool of
            processes for this call, so a script needs `if __name__ == "__main__":`. Only the column
            `cpu_s` depends on the executor.
        progress: called in this process with the numbers of finished runs and of all runs.
        jobs: processes of the pool, one per core by default; 1 runs in this process.
        store: keeps each row as it comes; rows that it has are not computed again.
        metrics: columns besides the usual ones: names of `minisim.results.metrics.METRICS`,
            `Metric`s or functions of your own (for several processes in a module), `module:name`.

    Returns:
        What was run (`scenarios.sweep.rows.identity_of`); the keys of `Run.summary()`, nested
        ones joined by "_" (`lanes_a_trips`); `queue_growth`; `growing`
        (`scenarios.statistics.growing`); `arrivals`, equal for common arrivals; `cpu_s`;
        `version`; `error`, why a run failed; and `recipe` (`scenarios.sweep.keys.content_of`).

    Raises:
        InputError: not a `Recipe` or `Store`, or a controller or metric that cannot go to another
            process.
        FileError: the store cannot be written; what it has stays.
        ExecutorError: no process can be started, as in a script without that line; or your executor
            gave runs up, such as a cluster whose scheduler died. Finished runs are in the store.
            Without a store, the rows of the others say so.
    """
    import pandas as pd

    added = metrics_named(metrics)
    todo: list[Recipe] = []
    for recipe in recipes:
        instance("recipe", recipe, Recipe)
        todo.append(replace(recipe, metrics=(*recipe.metrics, *added)) if added else recipe)
    rows: dict[int, Row] = {}
    with closing(finished(todo, executor, jobs=jobs, store=store)) as results:
        for k, row in results:
            rows[k] = row
            if progress is not None:
                progress(len(rows), len(todo))
    return pd.DataFrame([rows[k] for k in range(len(todo))])


def finished(
    todo: Sequence[Recipe],
    executor: Executor | None = None,
    *,
    jobs: int | None = None,
    store: Store | None = None,
) -> Generator[tuple[int, Row]]:
    """Position and row of each run as it finishes, as for `sweep`; close it to give up."""
    jobs = integer("jobs", (os.cpu_count() or 1) if jobs is None else jobs, low=1, high=1024)
    missing = dict(enumerate(todo))
    if store is not None:
        instance("store (open it with `Store(path)`)", store, Store)
        keys = [key_of(recipe) for recipe in todo]
        valid = store.valid(keys)
        for k, key in enumerate(keys):
            if key in valid:
                del missing[k]
                yield k, valid[key]
    if executor is None:
        if min(jobs, len(missing)) > 1:
            _check_portable(missing.values())
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
            outcome.row["recipe"] = content_of(todo[k])
            if store is not None:
                store.put(todo[k], outcome)
            yield k, outcome.row
    if store is not None and lost:
        raise ExecutorError(
            f"the executor gave up {lost} of {plural(len(todo), 'run')}; the others are in "
            f"{store.path}, and the same sweep goes on from there"
        )


def _check_portable(recipes: Iterable[Recipe]) -> None:
    """Raise `InputError` for a controller or metric that cannot go to another process."""
    parts = {id(part): part for it in recipes for part in (it.controller, *it.metrics)}
    for part in parts.values():
        try:
            pickle.dumps(part)
        except (Exception, SystemExit) as error:  # a class of the caller's own may raise anything
            raise InputError(
                f"{show(part)} cannot go to other processes ({error}); put its class or function "
                "at the top of a module, or use one job"
            ) from error


def _warm(recipes: Iterable[Recipe], pool: Executor) -> None:
    """Let one process compile to disk, or all would compile when minisim is freshly installed.

    Compiled code depends on the class of the vehicle. A run that fails here fails again later.
    """
    for recipe in {type(it.scenario.profile.vehicle): it for it in recipes}.values():
        dt = recipe.scenario.profile.dt
        scenario = replace(recipe.scenario, horizon=dt, demand_time=None, warmup=0.0, recorded=None)
        try:
            tried = handed(pool, outcome_of, replace(recipe, scenario=scenario))
        except BrokenExecutor:
            return
        if isinstance(error := tried.exception(), ExecutorError):
            raise error
