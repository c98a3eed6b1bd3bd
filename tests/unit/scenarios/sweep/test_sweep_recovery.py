"""Sweeps whose processes die: workers, and the sweep itself, at any moment."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pandas as pd
import pytest

from dim import Dim
from scenarios import three_way
from scenarios.recipe import Recipe
from scenarios.sweep import sweep
from scenarios.sweep.file import read_experiments
from scenarios.sweep.keys import key_of
from scenarios.sweep.pool import pooled, processes
from scenarios.sweep.store import Store
from tests import ROOT
from tests.builders import Deadly, killing, python, repeatable, stored

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX's")

EMPTY = three_way(0, horizon=1)


def quick(count: int) -> list[Recipe]:
    return [Recipe(three_way(200, horizon=30), Dim(), seed) for seed in range(count)]


def test_only_the_run_that_kills_its_worker_every_time_fails(tmp_path: Path) -> None:
    once, always = (Recipe(EMPTY, Deadly(name)) for name in (str(tmp_path / "killed"), ""))
    good = [*quick(3), once, *quick(6)[3:]]
    with Store(tmp_path / "s.db") as store:
        rows = sweep([*good, always], jobs=2, store=store)
        assert len(store) == 8
    assert (tmp_path / "killed").exists()
    assert rows["error"].isna().tolist() == [True] * 7 + [False]
    assert rows["error"][7].startswith("BrokenProcessPool: ")
    assert rows["controller"][7] == "deadly"
    survivors, alone = (
        repeatable(them).dropna(axis="columns", how="all")
        for them in (rows[:7], sweep(good, jobs=1))
    )
    pd.testing.assert_frame_equal(survivors, alone, check_dtype=False)


def test_a_killed_worker_costs_a_comparison_nothing(tmp_path: Path) -> None:
    """A task whose process dies is tried again alone; only one that dies every time is lost."""
    once = {0: "", 1: str(tmp_path / "killed"), 2: ""}
    assert dict(pooled(killing, once, 2, pool_of=processes)) == {0: 7, 1: 7, 2: 7}
    assert (tmp_path / "killed").exists()
    answers = dict(pooled(killing, once | {1: "always"}, 2, pool_of=processes))
    assert isinstance(answers.pop(1), BrokenExecutor)
    assert answers == {0: 7, 2: 7}


def test_giving_up_ends_what_runs() -> None:
    results = pooled(time.sleep, {0: 0.0, **dict.fromkeys(range(1, 6), 600.0)}, 1,
                     pool_of=processes)  # fmt: skip
    assert next(results) == (0, None)
    began = time.monotonic()
    results.close()
    assert time.monotonic() - began < 20.0


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def sweep_of(folder: Path, jobs: int, seeds: int, horizon: int) -> tuple[list[str], Path, Path]:
    """A command, its file of 8 runs per seed, and its store."""
    file, store = folder / "sweep.toml", folder / "s.db"
    file.write_text(
        'scenario = ["three-way", "four-way"]\ncontroller = ["dim", "fixed-time"]\n'
        f"density = [150, 300]\nseeds = {seeds}\nhorizon = {horizon}\n"
    )
    run = [sys.executable, "-m", "minisim", "sweep", str(file), "--out", str(store)]
    return [*run, "--jobs", str(jobs)], file, store


def killed_and_restarted(tmp_path: Path, kills: int, jobs: int, seeds: int, horizon: int) -> None:
    """Kill a sweep at random moments: in the end its rows are those of an undisturbed one.

    Every second kill comes up to 0.3 s after a row was stored, when the sweep is surely at work;
    the others come at any moment after the start of the process.
    """
    chance = random.Random(4)
    command, file, path = sweep_of(tmp_path, jobs, seeds, horizon)
    total = 8 * seeds
    counts = []
    for kill in range(kills):
        before = stored(path)
        process = subprocess.Popen(
            command, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        if kill % 2:
            deadline = time.monotonic() + 60
            while stored(path) == before and process.poll() is None:
                assert time.monotonic() < deadline
                time.sleep(0.02)
        time.sleep(chance.uniform(0.0, 0.3 if kill % 2 else 2.0))
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=20)
        counts.append(stored(path))
    assert counts == sorted(counts), "nothing is ever lost"
    assert any(0 < count < total for count in counts), "some kill was in the middle"
    subprocess.run(command, env=ENVIRONMENT, check=True, capture_output=True)
    todo = read_experiments(file)
    with Store(path, create=False) as store:
        assert len(store) == len(todo) == total
        kept = store.valid([key_of(experiment) for experiment in todo])
    rows = pd.DataFrame([kept[key_of(experiment)] for experiment in todo])
    pd.testing.assert_frame_equal(repeatable(rows), repeatable(sweep(todo, jobs=1)))


def test_a_killed_sweep_goes_on_where_it_was(tmp_path: Path) -> None:
    killed_and_restarted(tmp_path, kills=3, jobs=1, seeds=10, horizon=150)


@pytest.mark.slow
def test_a_sweep_killed_twenty_times_ends_as_an_undisturbed_one(tmp_path: Path) -> None:
    killed_and_restarted(tmp_path, kills=20, jobs=2, seeds=60, horizon=600)


def test_two_sweeps_may_share_a_store(tmp_path: Path) -> None:
    command, _, path = sweep_of(tmp_path, jobs=1, seeds=3, horizon=60)
    both = [
        subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    said = [process.communicate(timeout=120)[0] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert all(f"24 runs in {path}" in text for text in said)
    with Store(path, create=False) as store:
        assert len(store) == 24


INTERRUPTED = """
import os, signal, threading, time
from scenarios.sweep.pool import pooled, processes

if __name__ == "__main__":
    threading.Timer(3.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        list(pooled(time.sleep, dict.fromkeys(range(9), 9.0), 2, pool_of=processes))
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.slow
def test_giving_up_leaves_no_traceback_of_a_thread(tmp_path: Path) -> None:
    """A pool of Python's fails over a run that is cancelled while others are under way."""
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    done = python(str(script))
    assert (done.stdout, done.stderr) == ("interrupted\n", "")
