"""Many runs at once: experiments over a caller's executor, one row each."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import (
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
)
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

from minisim.control import Controller
from minisim.errors import InputError, MinisimError, instance, integer, show
from scenarios.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Experiment:
    """One run to be made: what is simulated, who decides, and the seed."""

    scenario: Scenario
    controller: Controller
    seed: int = 0

    def __post_init__(self) -> None:
        instance("scenario", self.scenario, Scenario)
        if isinstance(self.controller, type) or not isinstance(self.controller, Controller):
            raise InputError(f"controller must be a Controller, got {show(self.controller)}")
        integer("seed", self.seed, low=0)


def sweep(
    experiments: Iterable[Experiment],
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Run all experiments and return one row each, in their order.

    The rows do not depend on the executor, nor on the number of its workers.

    Args:
        experiments: what to run.
        executor: any `concurrent.futures.Executor`, which stays open; None is a process pool over
            the cores (`workers`), as short-lived as the call. Its processes are spawned, so a
            script that sweeps needs the usual `if __name__ == "__main__":`.
        progress: called with the runs done and their number, in this process.

    Returns:
        The keys of `Run.summary()` as columns, nested ones joined by "_" (`lanes_a_trips`,
        `complete_waiting_time_s`), and `error`: why a run failed, missing where it did not.

    Raises:
        InputError: something other than an `Experiment`.
    """
    import pandas as pd

    todo = list(experiments)
    for experiment in todo:
        instance("experiment", experiment, Experiment)
    if executor is None:
        with workers(min(os.cpu_count() or 1, max(1, len(todo)))) as own:
            return sweep(todo, own, progress)
    with _uninterrupted():
        futures = [executor.submit(run_row, experiment) for experiment in todo]
    try:
        for done, _ in enumerate(as_completed(futures), start=1):
            if progress is not None:
                progress(done, len(futures))
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    rows = [_outcome(experiment, future) for experiment, future in zip(todo, futures, strict=True)]
    return pd.DataFrame(rows)


def workers(jobs: int) -> Executor:
    """An executor of `jobs` processes; with one job, a thread of this process.

    Processes are spawned: forking beside the threads of a progress bar can hang.
    """
    integer("jobs", jobs, low=1, high=1024)
    if jobs == 1:
        return ThreadPoolExecutor(1)
    # Ctrl-C reaches every process of the terminal; the answer of this one is enough.
    return ProcessPoolExecutor(
        jobs,
        mp_context=get_context("spawn"),
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    )


def run_row(experiment: Experiment) -> dict[str, Any]:
    """Run one experiment; a `MinisimError` becomes part of the row."""
    from minisim.simulation import simulate

    try:
        run = simulate(experiment.scenario, experiment.controller, experiment.seed)
    except MinisimError as error:
        return _failed(experiment, error)
    return {**dict(_flat(run.summary())), "error": None}


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


def _outcome(experiment: Experiment, future: Future[dict[str, Any]]) -> dict[str, Any]:
    """The row of a finished run, whatever ended it."""
    error = future.exception()
    return future.result() if error is None else _failed(experiment, error)


def _failed(experiment: Experiment, error: BaseException) -> dict[str, Any]:
    scenario = experiment.scenario
    kind = "" if isinstance(error, MinisimError) else f"{type(error).__name__}: "
    return {
        "controller": experiment.controller.name,
        "scenario": scenario.name,
        "profile": scenario.profile.name,
        "density": scenario.density,
        "seed": experiment.seed,
        "horizon_s": scenario.horizon,
        "error": f"{kind}{error}",
    }


def _flat(summary: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in summary.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}_")
        else:
            yield f"{prefix}{key}", value
