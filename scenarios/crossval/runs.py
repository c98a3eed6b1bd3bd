"""The runs behind a comparison: every cell with every seed in both hosts."""

from __future__ import annotations

import importlib.metadata
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeVar

import numpy as np

from minisim.errors import MinisimError
from minisim.files import make_folder, replacing
from minisim.results.trajectories import LANE, MANOEUVRE, SPEED, TIME, VEHICLE, S
from minisim.results.trips import Trips
from scenarios.crossval.cases import Case
from scenarios.crossval.comparison import Divergence, Pair, first_parting
from scenarios.crossval.results import Failure, Result
from scenarios.recipe import Host
from scenarios.sweep.keys import description_of, digest_of, results_version
from scenarios.sweep.pool import pooled, processes

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run, ScenarioLike

#: Host -> the module of its `simulate`, imported when needed.
HOSTS: Final = {"minisim": "minisim.simulation", "sumo": "minisim.sumo"}

#: Time recorded before the departure of the first trip that differs and after its arrival [s].
BEFORE, AFTER = 30.0, 5.0

Progress = Callable[[int, int], None]
Task = TypeVar("Task")
Answer = TypeVar("Answer")


class _Outcome(NamedTuple):
    """The result of a run; `sumo` is the version of SUMO, empty for minisim."""

    trips: Trips
    collisions: int
    sumo: str


def crossvalidate(
    cases: Sequence[Case], seeds: Sequence[int], jobs: int = 1, progress: Progress | None = None,
    folder: Path | None = None,
) -> list[Result]:  # fmt: skip
    """Run every case with every seed in both hosts, and compare.

    A run that fails becomes a `Failure` of its case; one whose process dies is tried once more.
    A replay is run once, since its arrivals are not drawn. There are `jobs` processes; `progress`
    is called with the number of finished runs and the total. SUMO's runs, which take nearly all the
    time, are stored in `folder`/sumo and reused from there.
    """
    runs = [
        [(case, host, seed, folder) for seed in (seeds if case.published is None else [0])
         for host in HOSTS]
        for case in cases
    ]  # fmt: skip
    outcomes = iter(_gather(_run, [*chain.from_iterable(runs)], jobs, progress))
    return [
        _result(case, {(host, seed): next(outcomes) for _, host, seed, _ in tasks})
        for case, tasks in zip(cases, runs, strict=True)
    ]


def film(done: Sequence[Result], jobs: int = 1, progress: Progress | None = None) -> list[Result]:
    """Add where the hosts part ways, from a shorter second run around the first differing trip."""
    apart = [(result.case, result.divergence) for result in done if result.divergence]
    tasks = [(case, host, divergence) for case, divergence in apart for host in HOSTS]
    frames = iter(_gather(_record, tasks, jobs, progress))
    return [_parted(it, next(frames), next(frames)) if it.divergence else it for it in done]


class _Excerpt:
    """The first seconds of a scenario, with its own arrivals and demand (a `ScenarioLike`)."""

    def __init__(self, scenario: ScenarioLike, horizon: float) -> None:
        self._scenario, self.horizon, self.warmup = scenario, horizon, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._scenario, name)


def _run(task: tuple[Case, str, int, Path | None]) -> _Outcome:
    case, host, seed, folder = task
    recipe = case.recipe(seed)
    file = None
    if folder is not None and host == "sumo":
        version = importlib.metadata.version("libsumo")
        key = digest_of("\n".join([description_of(recipe), results_version(), version]))
        file = folder / "sumo" / f"{key[:24]}.npz"
        if stored := _read(file):
            return stored
    run = recipe.run(_host(host))
    trips = run.counted.columns
    outcome = _Outcome(trips, len(run.collisions), run.host.get("sumo", ""))
    if file is not None:
        make_folder(file.parent)
        kept = {"collisions": outcome.collisions, "sumo": outcome.sumo, **trips._asdict()}
        with replacing(file) as part:
            np.savez_compressed(part, **kept)
    return outcome


def _read(file: Path) -> _Outcome | None:
    """A stored run; None if it is missing or incomplete."""
    try:
        with np.load(file, allow_pickle=False) as data:
            columns = {name: data[name] for name in Trips._fields}
            columns |= {name: float(columns[name]) for name in ("end", "start")}
            return _Outcome(Trips(**columns), int(data["collisions"]), str(data["sumo"]))
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return None


def _record(task: tuple[Case, str, Divergence]) -> pd.DataFrame:
    case, host, divergence = task
    end = min(divergence.end + AFTER, case.scenario.horizon)
    window = (max(0.0, divergence.depart - BEFORE), end)

    def excerpt(scenario: ScenarioLike, *rest: Any, **options: Any) -> Run:
        return _host(host)(_Excerpt(scenario, end), *rest, **options)

    run = case.recipe(divergence.seed).run(excerpt, record="all", record_window=window)
    return run.trajectories[[TIME, VEHICLE, LANE, MANOEUVRE, S, SPEED]]


def _host(name: str) -> Host:
    simulate: Host = importlib.import_module(HOSTS[name]).simulate
    return simulate


def _gather(
    function: Callable[[Task], Answer], tasks: Sequence[Task], jobs: int, progress: Progress | None
) -> list[Answer | BaseException]:
    """The function's answers in the order of the tasks, or the exception that a task raised."""
    answers: dict[int, Answer | BaseException] = {}
    # Processes even with one job: a thread could not be stopped during an hour in SUMO.
    with closing(pooled(function, dict(enumerate(tasks)), jobs, pool_of=processes)) as results:
        for k, answer in results:
            answers[k] = answer
            if progress is not None:
                progress(len(answers), len(tasks))
    return [answers[k] for k in range(len(tasks))]


def _result(case: Case, outcomes: Mapping[tuple[str, int], _Outcome | BaseException]) -> Result:
    good = {run: made for run, made in outcomes.items() if not isinstance(made, BaseException)}
    ours, theirs = ({seed: it for (host, seed), it in good.items() if host == one} for one in HOSTS)
    both = [seed for seed in ours if seed in theirs]
    collisions = [sum(made.collisions for made in host.values()) for host in (ours, theirs)]
    return Result(
        case, tuple(Pair(seed, ours[seed].trips, theirs[seed].trips) for seed in both),
        (collisions[0], collisions[1]), _failures(outcomes),
        sumo=next((made.sumo for made in theirs.values()), ""),
    )  # fmt: skip


def _parted(
    result: Result, minisim: pd.DataFrame | BaseException, sumo: pd.DataFrame | BaseException
) -> Result:
    if isinstance(minisim, BaseException) or isinstance(sumo, BaseException):
        seed = result.pairs[0].seed
        failed = _failures({("minisim", seed): minisim, ("sumo", seed): sumo}, "recording again: ")
        return replace(result, failures=result.failures + failed)
    return replace(result, parting=first_parting(minisim, sumo))


def _failures(made: Mapping[tuple[str, int], object], doing: str = "") -> tuple[Failure, ...]:
    failures = []
    for (host, seed), error in made.items():
        if isinstance(error, BaseException):
            kind = "" if isinstance(error, MinisimError) else f"{type(error).__name__}: "
            failures.append(Failure(host, seed, f"{doing}{kind}{error}"))
    return tuple(failures)
