"""The runs behind a comparison: every cell with every seed in both hosts."""

from __future__ import annotations

import importlib.metadata
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

from minisim.errors import MinisimError
from minisim.results.trajectories import LANE, MANOEUVRE, SPEED, TIME, VEHICLE, S
from scenarios.crossval.cases import Case
from scenarios.crossval.comparison import (
    Divergence,
    Pair,
    agreement,
    compare,
    first_divergence,
    first_parting,
)
from scenarios.crossval.outcome import Outcome, kept_file, read_outcome, write_outcome
from scenarios.crossval.results import Failure, Film, Result
from scenarios.recipe import Host
from scenarios.sweep.pool import given, pooled, processes

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run, ScenarioLike

HOSTS: Final = ("minisim", "sumo")

#: Recorded before the departure of the first trip that differs, and after its arrival [s].
BEFORE, AFTER = 30.0, 5.0

Progress = Callable[[int, int], None]
Task = TypeVar("Task")
Answer = TypeVar("Answer")


def crossvalidate(
    cases: Sequence[Case],
    seeds: Sequence[int],
    executor: Executor | None = None,
    progress: Progress | None = None,
    folder: Path | None = None,
    *,
    jobs: int = 1,
) -> list[Result]:
    """Run every case with every seed in both hosts, and compare.

    A run that fails becomes a `Failure` of its case. Replays have one run: their arrivals are not
    drawn.

    Args:
        cases, seeds: what to run.
        executor: runs it; None is a pool of processes, in which a run whose process dies is tried
            once more.
        progress: called with the number of runs done and of all.
        folder: where SUMO's runs are kept and found again; None runs them all.
        jobs: processes of the pool.
    """
    runs = [
        [
            (case, host, seed, folder)
            for seed in (seeds if case.published is None else [0])
            for host in HOSTS
        ]
        for case in cases
    ]
    tasks = [run for of_case in runs for run in of_case]
    outcomes = iter(_gather(_run, tasks, executor, jobs, progress))
    return [
        _result(case, {run[1:3]: next(outcomes) for run in of_case})
        for case, of_case in zip(cases, runs, strict=True)
    ]


def film(
    results: Sequence[Result],
    executor: Executor | None = None,
    progress: Progress | None = None,
    *,
    jobs: int = 1,
) -> list[Result]:
    """Add the trajectories around the first trip that differs, from a second, shorter run."""
    tasks = [
        (result.case, host, result.divergence)
        for result in results
        if result.divergence is not None
        for host in HOSTS
    ]
    frames = iter(_gather(_record, tasks, executor, jobs, progress))
    return [
        result if result.divergence is None else _filmed(result, next(frames), next(frames))
        for result in results
    ]


class _Excerpt:
    """The first seconds of a scenario, with its own arrivals and demand (a `ScenarioLike`)."""

    def __init__(self, scenario: ScenarioLike, horizon: float) -> None:
        self._scenario, self.horizon, self.warmup = scenario, horizon, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._scenario, name)


def _run(task: tuple[Case, str, int, Path | None]) -> Outcome:
    case, host, seed, folder = task
    if folder is None or host != HOSTS[1]:
        return _outcome(case, host, seed)
    file = kept_file(folder, case, seed, importlib.metadata.version("libsumo"))
    kept = read_outcome(file)
    if kept is None:
        kept = _outcome(case, host, seed)
        write_outcome(file, kept)
    return kept


def _outcome(case: Case, host: str, seed: int) -> Outcome:
    try:
        run = case.recipe(seed).run(_host(host))
    except MinisimError as error:
        return Outcome(error=str(error))
    return Outcome(run.counted, len(run.collisions), run.host.get("sumo", ""))


def _record(task: tuple[Case, str, Divergence]) -> pd.DataFrame:
    case, host, divergence = task
    end = min(divergence.end + AFTER, case.scenario.horizon)
    window = (max(0.0, divergence.depart - BEFORE), end)
    simulate = _host(host)

    def excerpt(scenario: ScenarioLike, *rest: Any, **options: Any) -> Run:
        return simulate(_Excerpt(scenario, end), *rest, **options)

    run = case.recipe(divergence.seed).run(excerpt, record="all", record_window=window)
    return run.trajectories[[TIME, VEHICLE, LANE, MANOEUVRE, S, SPEED]]


def _host(name: str) -> Host:
    if name == "minisim":
        from minisim.simulation import simulate

        return simulate
    from minisim.sumo import simulate as simulate_in_sumo

    return simulate_in_sumo


def _gather(
    function: Callable[[Task], Answer],
    tasks: Sequence[Task],
    executor: Executor | None,
    jobs: int,
    progress: Progress | None,
) -> list[Answer | BaseException]:
    """The function's answers in the order of the tasks; in place of one, what was raised."""
    todo = dict(enumerate(tasks))
    if executor is None:
        # A process also where there is one: a thread could not be ended amid an hour in SUMO.
        results = pooled(function, todo, jobs, pool_of=processes)
    else:
        results = given(function, todo, executor)
    answers: dict[int, Answer | BaseException] = {}
    with closing(results):
        for k, answer in results:
            answers[k] = answer
            if progress is not None:
                progress(len(answers), len(tasks))
    return [answers[k] for k in range(len(tasks))]


def _result(case: Case, outcomes: dict[tuple[str, int], Outcome | BaseException]) -> Result:
    ended = {
        run: Outcome(error=_reason(made)) if isinstance(made, BaseException) else made
        for run, made in outcomes.items()
    }
    both = [
        (seed, ended[HOSTS[0], seed], made) for (h, seed), made in ended.items() if h == HOSTS[1]
    ]
    pairs = tuple(
        Pair(seed, ours.trips, theirs.trips)
        for seed, ours, theirs in both
        if ours.trips is not None and theirs.trips is not None
    )
    return Result(
        case=case,
        pairs=pairs,
        rows=tuple(compare(pairs, case.scenario.intersection.n)) if pairs else (),
        agreement=agreement(pairs) if pairs else math.nan,
        collisions=(sum(o.collisions for _, o, _ in both), sum(o.collisions for _, _, o in both)),
        failures=tuple(
            Failure(host, seed, made.error) for (host, seed), made in ended.items() if made.error
        ),
        sumo=next((made.sumo for made in ended.values() if made.sumo), ""),
        divergence=first_divergence(pairs[0]) if pairs else None,
    )


def _filmed(
    result: Result, minisim: pd.DataFrame | BaseException, sumo: pd.DataFrame | BaseException
) -> Result:
    if isinstance(minisim, BaseException) or isinstance(sumo, BaseException):
        made = dict(zip(HOSTS, (minisim, sumo), strict=True))
        failed = tuple(
            Failure(host, result.pairs[0].seed, f"recording again: {_reason(error)}")
            for host, error in made.items()
            if isinstance(error, BaseException)
        )
        return replace(result, failures=result.failures + failed)
    parting = first_parting(minisim, sumo)
    movement = ""
    if parting is not None:
        who = minisim[minisim[VEHICLE] == parting.vehicle].iloc[0]
        movement = f"{who[LANE]}{who[MANOEUVRE]}"
    return replace(result, film=Film(minisim, sumo, parting, movement))


def _reason(error: BaseException) -> str:
    kind = "" if isinstance(error, MinisimError) else f"{type(error).__name__}: "
    return f"{kind}{error}"
