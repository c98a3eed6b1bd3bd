"""Processes that run tasks: what they take from this one, how they end, and what they leave."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from pickle import PicklingError
from types import SimpleNamespace
from typing import NoReturn

import pytest

from scenarios.sweep import processes
from scenarios.sweep.processes import Processes
from tests.builders import killing, python

needs_server = pytest.mark.skipif(not processes.FORKS, reason="no server to fork from here")


@pytest.fixture
def pool() -> Iterator[Processes]:
    with Processes(2) as pool:
        yield pool


class PeculiarError(Exception):
    """An error that cannot be pickled."""

    def __reduce__(self) -> NoReturn:
        raise TypeError("never")


def peculiar() -> NoReturn:
    raise PeculiarError("it happened")


def own_process() -> int:
    """What a process of the caller's own answers."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(abs, (-3,))


def test_answers_and_errors_come_back(pool: Processes) -> None:
    assert [it.result() for it in [pool.submit(abs, -k) for k in range(5)]] == [0, 1, 2, 3, 4]
    with pytest.raises(ZeroDivisionError, match="by zero"):
        pool.submit(divmod, 1, 0).result()
    with pytest.raises(SystemExit):
        pool.submit(sys.exit, 3).result()
    with pytest.raises(RuntimeError, match="PeculiarError: it happened"):
        pool.submit(peculiar).result()
    with pytest.raises((AttributeError, TypeError, PicklingError), match="lambda"):
        pool.submit(lambda: 0).result()
    with pytest.raises(TypeError, match="pickle"):
        pool.submit(open, os.devnull).result()
    assert pool.submit(int, "7", base=8).result() == 7


def test_a_process_may_start_others(pool: Processes) -> None:
    assert pool.submit(subprocess.call, [sys.executable, "-c", "exit(3)"]).result() == 3
    assert pool.submit(own_process).result() == 3


@pytest.mark.parametrize("forks", [pytest.param(True, marks=needs_server), False])
def test_a_dead_process_costs_its_own_task(monkeypatch: pytest.MonkeyPatch, forks: bool) -> None:
    monkeypatch.setattr(processes, "FORKS", forks)
    with Processes(1) as pool:
        first, last = pool.submit(os.getpid), pool.submit(abs, -7)
        dead, after = pool.submit(killing, "always"), pool.submit(abs, -8)
        assert first.result() != os.getpid()
        with pytest.raises(BrokenProcessPool, match="the process of the run died"):
            dead.result()
        assert (last.result(), after.result()) == (7, 8)


@needs_server
def test_a_spawned_server_serves_many_pools_in_the_same_surroundings(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(processes, "_has_one_thread", lambda: False)

    def asked(*task: object) -> object:
        with Processes(1) as pool:
            return pool.submit(*task).result()  # type: ignore[arg-type]

    server = asked(os.getppid)
    assert asked(os.getppid) == server != os.getpid()
    os.kill(int(str(server)), signal.SIGKILL)
    time.sleep(0.1)
    assert asked(abs, -7) == 7
    monkeypatch.setenv("MINISIM_ASKED", "yes")
    assert asked(os.getenv, "MINISIM_ASKED") == "yes"
    monkeypatch.chdir(tmp_path)
    assert asked(os.getcwd) == str(tmp_path)


#: Runs two sweeps, and is killed.
SWEEPS = """
import os, signal
from dim import Dim
from scenarios import three_way
from scenarios.recipe import Recipe
from scenarios.sweep import sweep

if __name__ == "__main__":
    for seeds in (4, 2):
        todo = [Recipe(three_way(200, horizon=30), Dim(), seed) for seed in range(seeds)]
        print(sweep(todo, jobs=2)["error"].isna().sum(), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX's")
def test_nothing_is_left_in_a_long_temporary_folder(tmp_path: Path) -> None:
    """The path of a socket has at most some 100 bytes."""
    long = tmp_path / ("long" * 40)
    long.mkdir()
    done = python("-c", SWEEPS, TMPDIR=str(long))
    assert (done.stdout, done.stderr) == ("4\n2\n", "")
    assert not list(long.iterdir())


#: Keeps a script from being forked, as the thread of a notebook does.
THREAD = "import threading\nthreading.Thread(target=threading.Event().wait, daemon=True).start()\n"


def test_a_script_without_a_guard_is_told_so(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(THREAD + SWEEPS.replace('if __name__ == "__main__":', "if True:"))
    done = python(str(script))
    assert done.stdout == ""
    own, _, parent = done.stderr.rpartition("Traceback")
    assert own.count("Traceback") == 1
    assert 'under `if __name__ == "__main__":`' in parent


#: As a notebook's class, it is in no file; and it changes between two sweeps.
UNKNOWN = """
from dataclasses import dataclass
from minisim.control import Unregulated
from scenarios import three_way
from scenarios.recipe import Recipe
from scenarios.sweep import sweep

for new in (False, True):
    @dataclass(frozen=True)
    class Mine(Unregulated):
        version = 1

        def start(self, site, new=new):
            if new:
                raise ValueError("the new one")
            return super().start(site)

    rows = sweep([Recipe(three_way(0, horizon=1), Mine(), seed) for seed in (1, 2)], jobs=2)
    print(*rows["error"], sep="\\n")
"""


def test_a_class_that_other_processes_do_not_know_fails_its_runs() -> None:
    done = python("-c", THREAD + UNKNOWN)
    assert done.stderr == ""
    assert len(set(done.stdout.splitlines())) == 1
    assert "Can't get attribute 'Mine'" in done.stdout


@needs_server
def test_a_fork_knows_the_latest_class_of_this_process() -> None:
    done = python("-c", UNKNOWN)
    assert done.stderr == ""
    first, second, *changed = done.stdout.splitlines()
    assert (first, second) == ("None", "None")
    assert len(changed) == 2
    assert all("the new one" in it for it in changed)


#: A run that has processes of its own.
NESTED = """
from scenarios.sweep.processes import Processes

def nested():
    with Processes(1) as inner:
        return inner.submit(abs, -3).result()

if __name__ == "__main__":
    with Processes(1) as pool:
        print(pool.submit(nested).result(timeout=60))
"""


def test_a_process_may_have_a_pool_of_its_own(tmp_path: Path) -> None:
    script = tmp_path / "nested.py"
    script.write_text(NESTED)
    done = python(str(script))
    assert (done.stdout, done.stderr) == ("3\n", "")


#: Has an end of a pipe while it sweeps: a fork that kept it would never let its reader end.
WITH_A_PIPE = """
import os, subprocess, sys
from scenarios.sweep.processes import Processes

with subprocess.Popen(["cat"], stdin=subprocess.PIPE) as reader, Processes(1) as pool:
    child = pool.submit(os.getpid).result() != os.getpid()
    reader.stdin.close()
    print(child, reader.wait(10))
"""


@needs_server
def test_a_fork_keeps_no_pipe_of_this_process_open() -> None:
    assert python("-c", WITH_A_PIPE).stdout == "True 0\n"


@needs_server
@pytest.mark.parametrize(("maps", "forks"), [("/lib/libgomp.so.1", False), ("/lib/libm.so", True)])
def test_a_process_with_openmp_is_not_forked(
    monkeypatch: pytest.MonkeyPatch, maps: str, forks: bool
) -> None:
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    monkeypatch.setattr(processes, "Path", lambda _: SimpleNamespace(read_text=lambda: maps))
    assert processes._has_one_thread() == forks


#: Gives up while its server loads.
GIVING_UP = """
import os, signal, threading, time
from scenarios.sweep.pool import pooled, processes

if __name__ == "__main__":
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    began = time.monotonic()
    try:
        list(pooled(time.sleep, dict.fromkeys(range(9), 60.0), 2, pool_of=processes))
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
def test_ctrl_c_while_the_server_loads() -> None:
    began = time.monotonic()
    done = python("-c", GIVING_UP)
    assert (done.stdout, done.stderr) == ("interrupted\n", "")
    assert time.monotonic() - began < 30.0


#: Prints the server and two busy processes, and waits.
PARENT = """
import os, time
from scenarios.sweep.processes import Processes

if __name__ == "__main__":
    pool = Processes(2)
    pids = {pool.submit(of).result() for of in (os.getppid, os.getpid)}
    busy = [pool.submit(time.sleep, 600) for _ in range(2)]
    print(*pids - {os.getpid()}, flush=True)
    time.sleep(600)
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
def test_all_processes_end_with_a_killed_parent() -> None:
    command = [sys.executable, "-c", PARENT]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pids = parent.stdout.readline().split()
        assert len(pids) == 1 + processes.FORKS
        parent.kill()
    deadline = time.monotonic() + 20
    while any(map(alive, pids)):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def alive(pid: str) -> bool:
    """Whether the process runs; one that only waits to be reaped does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
