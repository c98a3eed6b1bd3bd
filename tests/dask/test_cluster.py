"""Sweeps on a real Dask cluster: a scheduler and workers, each a process, over TCP."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest

from dim import Dim
from minisim.errors import ExecutorError, InputError
from scenarios import four_way
from scenarios.recipe import Recipe
from scenarios.sweep import sweep
from scenarios.sweep.cluster import Watched, cluster
from scenarios.sweep.store import Store
from tests import ROOT
from tests.builders import repeatable
from tests.unit.scenarios.cli.test_cli import Captured, fails, ok

pytest.importorskip("distributed", reason="needs the extra `dask`")

pytestmark = pytest.mark.dask

Processes = list[subprocess.Popen[bytes]]


def start(module: str, *arguments: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


@contextmanager
def stopping(*processes: subprocess.Popen[bytes]) -> Iterator[None]:
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait(timeout=20)


@contextmanager
def workers(address: str, count: int = 1) -> Iterator[Processes]:
    """Workers of one thread; without a nanny, so that a killed one stays dead."""
    options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--memory-limit", "0")
    processes = [start("dask_worker", address, *options) for _ in range(count)]
    with stopping(*processes):
        yield processes


@contextmanager
def running_scheduler(tmp_path: Path) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    file = tmp_path / "scheduler.json"
    process = start(
        "dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
        "--scheduler-file", str(file),
    )  # fmt: skip
    with stopping(process):
        deadline = time.monotonic() + 60
        while not file.exists() or not file.read_text():
            assert process.poll() is None, "the scheduler died"
            assert time.monotonic() < deadline
            time.sleep(0.05)
        yield json.loads(file.read_text())["address"], process


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    with running_scheduler(tmp_path) as (address, _):
        yield address


def recipes(count: int, horizon: float = 120.0) -> list[Recipe]:
    return [Recipe(four_way(300, horizon=horizon), Dim(), seed) for seed in range(count)]


def test_a_killed_worker_costs_nothing(scheduler: str, tmp_path: Path) -> None:
    todo = recipes(24, horizon=600.0)
    here = sweep(todo, jobs=1)
    with (
        workers(scheduler, 2) as processes,
        cluster(scheduler, patience=60) as executor,
        Store(tmp_path / "s.db") as store,
    ):

        def kill(done: int, total: int) -> None:
            if done == 5:
                processes[0].kill()

        there = sweep(todo, executor, kill, store=store)
        assert len(store) == len(todo)
        assert processes[0].wait(timeout=20) == -signal.SIGKILL
    pd.testing.assert_frame_equal(repeatable(here), repeatable(there))


def test_the_command_runs_there(scheduler: str, tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "two.toml"
    file.write_text("horizon = 60\nseeds = 2\n")
    arguments = ["sweep", str(file), "--scheduler", scheduler, "--out", str(tmp_path / "s.db")]
    with workers(scheduler), cluster(scheduler, patience=60):  # there is a worker now
        assert "2 runs in" in ok(capsys, *arguments)


def test_a_scheduler_without_workers_is_told(scheduler: str) -> None:
    with pytest.raises(InputError, match="has no workers"), cluster(scheduler, patience=0.5):
        pass


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("tcp://127.0.0.1:1", "Timed out"),
        ("tcp://127.0.0.1:99999", "with a port 1 … 65535"),
        *(
            (address, "an address has the form tcp://host:port")
            for address in ("nowhere", "tcp://127.0.0.1:port", "ftp://127.0.0.1:8786", "")
        ),
    ],
)
def test_no_scheduler_is_told(address: str, why: str, tmp_path: Path, capsys: Captured) -> None:
    file, store = tmp_path / "two.toml", tmp_path / "s.db"
    file.write_text("horizon = 60\nseeds = 2\n")
    began = time.monotonic()
    said = fails(capsys, "sweep", str(file), "--scheduler", address, "--out", str(store))
    assert time.monotonic() - began < 20
    assert said.startswith("minisim: no Dask scheduler at ")
    assert why in said
    assert not store.exists()


def test_a_lost_scheduler_leaves_what_was_done(tmp_path: Path) -> None:
    todo = recipes(12, horizon=1200.0)
    with (
        running_scheduler(tmp_path) as (address, process),
        workers(address),
        Store(tmp_path / "s.db") as store,
        cluster(address, patience=60) as executor,
    ):

        def kill(done: int, total: int) -> None:
            if done == 2:
                process.kill()

        with pytest.raises(ExecutorError, match=r"gave up .* of 12 runs; the others"):
            sweep(todo, executor, kill, store=store)
        assert 2 <= len(store) < len(todo)
        assert store.frame()["error"].isna().all()


class Silent(Executor):
    """It takes runs and never answers, as Dask does for results that were on their way."""

    def submit(self, function: object, /, *args: object, **options: object) -> Future[object]:
        return Future()


def test_runs_that_a_lost_scheduler_never_answers_are_given_up(tmp_path: Path) -> None:
    alive = [True]
    with (
        Store(tmp_path / "s.db") as store,
        Watched(Silent(), lambda: alive[0], patience=0.2) as executor,
    ):
        futures = [executor.submit(print) for _ in range(3)]
        time.sleep(0.4)
        assert not any(future.done() for future in futures)
        alive[0] = False
        with pytest.raises(ExecutorError, match="gave up 3 of 3 runs"):
            sweep(recipes(3), executor, store=store)
        assert all(future.cancelled() for future in futures)
