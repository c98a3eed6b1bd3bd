"""Parts of the kernel that a second process compiles while this one compiles the rest.

Compiling is Python code, so a second thread would not help. The code goes through numba's cache on
disk: what the second process could not compile or keep, this one compiles itself.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any, TypeAlias

#: A function that numba compiles.
Function: TypeAlias = Callable[..., object]

#: The process that compiles a function, by the function's name.
_UNDER_WAY: dict[str, subprocess.Popen[bytes]] = {}


@contextmanager
def elsewhere() -> Iterator[Callable[[Sequence[tuple[Function, Any]]], None]]:
    """Gives a function that has others compiled, for the argument types that stand beside them."""
    started: list[subprocess.Popen[bytes]] = []

    def begin(jobs: Sequence[tuple[Function, Any]]) -> None:
        interpreter = sys.executable and not getattr(sys, "frozen", False)
        if jobs and interpreter and cores() > 1:
            with suppress(OSError):
                started.append(_started(jobs))

    try:
        yield begin
    finally:
        for process in started:
            for name in [name for name, it in _UNDER_WAY.items() if it is process]:
                del _UNDER_WAY[name]
            with process:  # closes what it writes to, and waits
                pass


def wait_for(function: Function) -> None:
    """Wait until a second process has compiled `function`, or has failed, if one is about to."""
    process = _UNDER_WAY.pop(_name(function), None)
    if process is None or process.stdout is None:
        return
    for line in process.stdout:
        if line.decode().strip() == _name(function):
            break


def _started(jobs: Sequence[tuple[Function, Any]]) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert process.stdin is not None
    with suppress(BrokenPipeError), process.stdin as told:  # it may have died
        pickle.dump([(_name(function), types) for function, types in jobs], told)
    _UNDER_WAY.update((_name(function), process) for function, _ in jobs)
    return process


def _name(function: Function) -> str:
    return f"{function.__module__}:{function.__qualname__}"


def cores() -> int:
    """How many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def main() -> None:
    """Compile what stdin names, and name each on stdout when it is on disk."""
    for name, types in pickle.load(sys.stdin.buffer):
        module, _, function = name.partition(":")
        getattr(import_module(module), function).compile(types)
        sys.stdout.write(f"{name}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
