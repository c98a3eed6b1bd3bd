"""Many runs at once: experiments over processes or a caller's executor, one row each."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import islice
from multiprocessing import get_context, parent_process
from queue import SimpleQueue
from typing import TYPE_CHECKING

from minisim.errors import instance, integer
from scenarios.sweep.experiment import Experiment, Outcome, Row, failed, run_experiment
from scenarios.sweep.store import Store

if TYPE_CHECKING:
    import pandas as pd

Progress = Callable[[int, int], None]

#: Runs that a pool of ours has in hand, per worker: one that runs and one that is next.
IN_HAND = 2


def sweep(
    experiments: Iterable[Experiment],
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    jobs: int | None = None,
    store: Store | None = None,
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

    Returns:
        What was run (`Experiment.identity`), the keys of `Run.summary()`, nested ones joined by
        "_" (`lanes_a_trips`, `complete_waiting_time_s`), `queue_growth` and `growing`
        (`scenarios.statistics`), `arrivals` (alike for common arrivals), `cpu_s`, `version`, and
        `error`: why a run failed, missing where it did not.

    Raises:
        InputError: something other than an `Experiment`, or jobs beside an executor.
        FileError: the store cannot be written; what it has stays.
    """
    import pandas as pd

    todo = list(experiments)
    rows: dict[int, Row] = {}
    with closing(finished(todo, executor, jobs=jobs, store=store)) as results:
        for k, row in results:
            rows[k] = row
            if progress is not None:
                progress(len(rows), len(todo))
    return pd.DataFrame([rows[k] for k in range(len(todo))])


def finished(
    experiments: Iterable[Experiment],
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
        instance("experiment", experiment, Experiment)
    if jobs is None:
        jobs = os.cpu_count() or 1
    integer("jobs", jobs, low=1, high=1024)
    missing = dict(enumerate(todo))
    if store is not None:
        keys = [experiment.key for experiment in todo]
        valid = store.valid(keys)
        for k, key in enumerate(keys):
            if key in valid:
                del missing[k]
                yield k, valid[key]
    with closing(_own(missing, jobs) if executor is None else _given(missing, executor)) as runs:
        for k, outcome in runs:
            if store is not None:
                store.put(todo[k], outcome)
            yield k, outcome.row


def workers(jobs: int) -> Executor:
    """An executor of `jobs` processes; with one job, a thread of this process."""
    integer("jobs", jobs, low=1, high=1024)
    return ThreadPoolExecutor(1) if jobs == 1 else _processes(jobs)


def _processes(jobs: int) -> ProcessPoolExecutor:
    """A pool of spawned processes: forking beside the threads of a progress bar can hang."""
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_begin_worker)


def _begin_worker() -> None:
    # Ctrl-C reaches every process of the terminal; the answer of the parent is enough.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A killed parent tells its workers nothing: they would wait for work for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


Runs = Generator[tuple[int, Outcome]]
Todo = Mapping[int, Experiment]


def _given(todo: Todo, executor: Executor) -> Runs:
    """Run in a caller's executor: everything is handed over at once."""
    left = dict(todo)
    reason: BaseException = BrokenExecutor("the executor takes no runs")
    for k, result in _results(executor, todo, len(todo)):
        experiment = left.pop(k)
        if isinstance(result, BaseException):
            reason = result
            yield k, failed(experiment, result)
        else:
            yield k, result
    for k, experiment in left.items():
        yield k, failed(experiment, reason)


def _own(todo: Todo, jobs: int) -> Runs:
    """Run in pools of our own.

    When a worker dies, its pool is lost with all runs in hand, and nobody can tell which of them
    it was. They are then tried once more, one at a time, which tells; the others go on in a fresh
    pool.
    """
    left = dict(todo)
    cold = True
    while left:
        suspects: dict[int, Experiment] = {}
        with workers(min(jobs, len(left))) as pool:
            if cold:
                _warm(pool, left.values())
                cold = False
            for k, result in _results(pool, left, IN_HAND * jobs):
                if isinstance(result, BrokenExecutor):
                    suspects[k] = left[k]
                else:
                    experiment = left.pop(k)
                    yield k, _outcome(experiment, result)
        while suspects:
            with _processes(1) as alone:
                for k, result in _results(alone, suspects, 1):
                    del suspects[k]
                    yield k, _outcome(left.pop(k), result)


def _outcome(experiment: Experiment, result: Outcome | BaseException) -> Outcome:
    return failed(experiment, result) if isinstance(result, BaseException) else result


def _results(
    executor: Executor, todo: Todo, in_hand: int
) -> Iterator[tuple[int, Outcome | BaseException]]:
    """Results as they come, with at most `in_hand` runs handed over at a time.

    Ends early when the executor breaks: with at least one `BrokenExecutor`, and one for each run
    that it had.
    """
    done: SimpleQueue[int] = SimpleQueue()
    running: dict[int, Future[Outcome]] = {}
    # Since what is done leaves `todo` of the caller.
    waiting = iter(list(todo.items()))
    broken = False

    def hand_over(count: int) -> Iterator[tuple[int, BaseException]]:
        for k, experiment in islice(waiting, count):
            try:
                with _uninterrupted():
                    running[k] = executor.submit(run_experiment, experiment)
            except BrokenExecutor as error:
                yield k, error
                return
            # k=k keeps this k, not the loop's last; mypy cannot infer such a default.
            running[k].add_done_callback(lambda _, k=k: done.put(k))  # type: ignore[misc]

    try:
        for refused in hand_over(in_hand):
            broken = True
            yield refused
        while running:
            k = done.get()
            result = _result(running.pop(k))
            broken = broken or isinstance(result, BrokenExecutor)
            if not broken:
                # Before the row is stored, so that no worker waits for the disk.
                for refused in hand_over(1):
                    broken = True
                    yield refused
            yield k, result
    finally:
        for future in running.values():
            future.cancel()


def _result(future: Future[Outcome]) -> Outcome | BaseException:
    """What a finished run left, whatever ended it."""
    if future.cancelled():
        return CancelledError("the executor gave the run up")
    return future.exception() or future.result()


def _warm(pool: Executor, experiments: Iterable[Experiment]) -> None:
    """Compile once for all processes: one of them compiles to disk before the others start.

    Without it, every process of a fresh installation would compile for itself, at the same time.
    What is compiled depends on the vehicle. A run that fails here will tell why when its turn
    comes.
    """
    for experiment in {type(e.scenario.profile.vehicle): e for e in experiments}.values():
        scenario = replace(experiment.scenario, horizon=experiment.scenario.profile.dt)
        try:
            with _uninterrupted():
                tried = pool.submit(run_experiment, replace(experiment, scenario=scenario))
        except BrokenExecutor:
            return
        tried.exception()


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Put Ctrl-C off, and keep it from processes that are started meanwhile."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
