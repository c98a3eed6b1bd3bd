"""Many runs at once, in processes of our own or in a caller's executor; processes may die.

loky and pebble cannot replace this pool. With both, a busy worker outlives a killed parent; with
loky, one dead worker loses all runs; and pebble's pool is no `Executor`.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import closing, contextmanager
from functools import partial
from itertools import islice
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from multiprocessing.resource_tracker import ensure_running
from queue import SimpleQueue
from typing import TypeVar

from minisim.errors import integer
from scenarios.termination import Terminated, terminable

#: Runs that a pool of ours holds per worker: the current one and the next one.
IN_HAND = 2

#: How many times a worker is asked to end, once per second, before it is killed.
PATIENCE = 10

Task = TypeVar("Task")
Answer = TypeVar("Answer")

#: Number of a task, and its answer or the exception that it raised.
Results = Generator[tuple[int, Answer | BaseException]]


def workers(jobs: int) -> Executor:
    """An executor of `jobs` processes; with one job, a thread of this process."""
    integer("jobs", jobs, low=1, high=1024)
    return ThreadPoolExecutor(1) if jobs == 1 else processes(jobs)


def processes(jobs: int) -> Executor:
    """An executor of `jobs` processes, even of one; `pooled` can end them at once."""
    return _Processes(integer("jobs", jobs, low=1, high=1024))


def given(
    function: Callable[[Task], Answer], todo: Mapping[int, Task], executor: Executor
) -> Results[Answer]:
    """Run in a caller's executor, which gets all tasks at once."""
    left = set(todo)
    reason: BaseException = BrokenExecutor("the executor takes no runs")
    with closing(_results(function, todo, executor, len(todo))) as results:
        for k, result in results:
            left.discard(k)
            reason = result if isinstance(result, BaseException) else reason
            yield k, result
    for k in sorted(left):
        yield k, reason


def pooled(
    function: Callable[[Task], Answer],
    todo: Mapping[int, Task],
    jobs: int,
    *,
    pool_of: Callable[[int], Executor] = workers,
    begin: Callable[[Executor], None] | None = None,
) -> Results[Answer]:
    """Run in pools of `jobs` processes of our own; close the generator to give up.

    When a worker dies, its pool is lost, and any of the runs that it held may have killed it. Each
    of them is tried again alone. The others go on in a new pool. The function and its tasks go to
    other processes; `begin` is called with the first pool before it gets a task.
    """
    left = dict(todo)
    while left:
        suspects: dict[int, Task] = {}
        with _until_given_up(pool_of(min(jobs, len(left)))) as pool:
            if begin is not None:
                begin(pool)
                begin = None
            for k, result in _results(function, left, pool, IN_HAND * jobs):
                if isinstance(result, BrokenExecutor):
                    suspects[k] = left[k]
                else:
                    del left[k]
                    yield k, result
        while suspects:
            with _until_given_up(processes(1)) as alone:
                for k, result in _results(function, suspects, alone, 1):
                    del suspects[k], left[k]
                    yield k, result


@contextmanager
def _until_given_up(pool: Executor) -> Iterator[Executor]:
    """A pool for the block; an exception ends its processes and their runs at once."""
    with pool:
        try:
            yield pool
        except BaseException:
            if isinstance(pool, _Processes):
                pool.let_go()
            else:
                pool.shutdown(wait=False, cancel_futures=True)
            raise


def handed(executor: Executor, function: Callable[[Task], Answer], task: Task) -> Future[Answer]:
    """Hand one task over; Ctrl-C is delayed, and hidden from processes that start meanwhile."""
    whole = partial(_ending, function)
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        return executor.submit(whole, task)
    ensure_running()  # or the first process would, which ends the delay
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return executor.submit(whole, task)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Processes(ProcessPoolExecutor):
    """Processes that end when their parent dies or lets them go.

    They are spawned, since forking beside the threads of a progress bar can hang.
    """

    def __init__(self, jobs: int) -> None:
        leash, self._hand = Pipe(duplex=False)
        super().__init__(jobs, get_context("spawn"), initializer=_begin_worker, initargs=(leash,))

    def let_go(self) -> None:
        """End all processes and their runs at once."""
        self._hand.close()


def _begin_worker(leash: Connection) -> None:
    # Ctrl-C reaches every process of the terminal; only the parent should answer it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(leash,), daemon=True).start()


def _end_with(leash: Connection) -> None:
    """End when the parent has closed the other end, or was killed."""
    try:
        leash.recv_bytes()
    except (EOFError, OSError):
        main = threading.main_thread()
        if main.ident is not None and hasattr(signal, "pthread_kill"):  # not on Windows
            for _ in range(PATIENCE):
                signal.pthread_kill(main.ident, signal.SIGTERM)
                main.join(1.0)
        os._exit(1)


def _ending(function: Callable[[Task], Answer], task: Task) -> Answer:
    """Run a task; `Terminated` ends the worker, since a pool would take it for a result."""
    try:
        with terminable():
            return function(task)
    except Terminated as end:
        os._exit(end.code)


def _results(
    function: Callable[[Task], Answer], todo: Mapping[int, Task], executor: Executor, in_hand: int
) -> Results[Answer]:
    """Results as they come, with at most `in_hand` runs in the executor; closing cancels these.

    If the executor breaks, it ends with one `BrokenExecutor` per run in the executor, at least one.
    """
    done: SimpleQueue[int] = SimpleQueue()
    running: dict[int, Future[Answer]] = {}
    waiting = iter([*todo.items()])  # a copy, since the caller removes finished tasks
    broken = False

    def hand_over(count: int) -> Iterator[tuple[int, BaseException]]:
        for k, task in islice(waiting, count):
            try:
                running[k] = handed(executor, function, task)
            except BrokenExecutor as error:
                yield k, error
                return
            # k=k keeps this k, not the last one of the loop; mypy cannot infer such a default.
            running[k].add_done_callback(lambda _, k=k: done.put(k))  # type: ignore[misc]

    try:
        for refused in hand_over(in_hand):
            broken = True
            yield refused
        while running:
            k = done.get()
            future = running.pop(k)
            gone = CancelledError("the executor gave the run up") if future.cancelled() else None
            result = gone or future.exception() or future.result()
            broken = broken or isinstance(result, BrokenExecutor)
            if not broken:
                # Before the caller stores the result, so that no worker waits for the disk.
                for refused in hand_over(1):
                    broken = True
                    yield refused
            yield k, result
    finally:
        # Our own processes end with their runs; their pool fails over a run that is cancelled.
        for future in () if isinstance(executor, _Processes) else running.values():
            future.cancel()
