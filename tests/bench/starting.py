"""What it takes to start: the command, the first run after installation, two workers."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from scenarios import four_way
from scenarios.controllers import controller_named
from scenarios.recipe import Recipe
from scenarios.sweep import sweep
from scenarios.sweep.pool import workers
from scenarios.sweep.store import Store
from tests import ROOT

RUN = "run", "four-way", "--horizon", "600"


def command(*arguments: str) -> float:
    """CPU seconds of `minisim`, from start to exit."""
    before = os.times()
    _start(*arguments).wait()
    after = os.times()
    return after.children_user + after.children_system - before[2] - before[3]


def first_run() -> tuple[float, float]:
    """Wall seconds of a run that has to compile, and until it says so at a terminal."""
    reader, terminal = pty.openpty()
    with tempfile.TemporaryDirectory() as empty:
        start = time.perf_counter()
        process = _start(*RUN, stderr=terminal, NUMBA_CACHE_DIR=empty)
        os.close(terminal)
        said = b""
        while b"compiling" not in said:
            said += os.read(reader, 1000)
        told = time.perf_counter() - start
        _drain(reader)
        process.wait()
        return time.perf_counter() - start, told


def _drain(reader: int) -> None:
    try:
        while os.read(reader, 1000):
            pass
    except OSError:  # its other end is closed
        os.close(reader)


def _start(
    *arguments: str, stderr: int = subprocess.DEVNULL, **environment: str
) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "minisim", *arguments], cwd=ROOT, stderr=stderr,
        stdout=subprocess.DEVNULL, env={**os.environ, **environment},
    )  # fmt: skip


def pair(runs: int, hours: float) -> float:
    """How many times faster a sweep of so many runs is with two workers, their start included.

    In a process of its own, as that of a script: this one may have loaded libsumo, whose OpenMP
    keeps it from being forked.
    """
    command = [sys.executable, "-m", __name__, str(runs), str(hours)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True, text=True)
    return float(done.stdout)


def _pair(runs: int, hours: float) -> float:
    todo = [
        Recipe(four_way(350, profile="fair", horizon=hours * 3600.0), controller_named(name), seed)
        for name in ("dim:gate=harmonious", "fixed-time")
        for seed in range(runs // 2)
    ]
    _seconds([todo[0], todo[-1]], 1)  # loads all that is needed
    return _seconds(todo, 1) / _seconds(todo, 2)


def _seconds(todo: list[Recipe], count: int) -> float:
    with tempfile.TemporaryDirectory() as folder, Store(Path(folder) / "s.db") as store:
        began = time.perf_counter()
        if count == 1:
            with workers(1) as executor:
                sweep(todo, executor, store=store)
        else:
            sweep(todo, jobs=count, store=store)
        return time.perf_counter() - began


if __name__ == "__main__":
    sys.stdout.write(str(_pair(int(sys.argv[1]), float(sys.argv[2]))))
