"""Many runs at once, in processes of our own or in a caller's executor; processes may die."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
)
from contextlib import closing, contextmanager
from functools import partial
from itertools import islice
from queue import SimpleQueue
from typing import TypeVar

from minisim.errors import ExecutorError, integer
from scenarios.sweep.processes import Processes, interrupts_blocked
from scenarios.termination import Terminated, terminable

#: Runs that a pool of ours holds per worker: the current one and the next one.
IN_HAND = 2

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
    return Processes(integer("jobs", jobs, low=1, high=1024))


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

    A run whose worker dies is tried again alone, after the others: they may have taken the memory
    that it needs. The function and its tasks go to other processes; `begin` is called with the pool
    before it gets a task. Raises `ExecutorError` if no process can be started.
    """
    if not todo:
        return
    suspects: dict[int, Task] = {}
    with _until_given_up(pool_of(min(jobs, len(todo)))) as pool:
        if begin is not None:
            begin(pool)
        for k, result in _results(function, todo, pool, IN_HAND * jobs):
            if isinstance(result, ExecutorError):
                raise result
            if isinstance(result, BrokenExecutor):
                suspects[k] = todo[k]
            else:
                yield k, result
    if suspects:
        with _until_given_up(processes(1)) as alone:
            yield from _results(function, suspects, alone, 1)


@contextmanager
def _until_given_up(pool: Executor) -> Iterator[Executor]:
    """A pool for the block; an exception ends its processes and their runs at once."""
    with pool:
        try:
            yield pool
        except BaseException:
            if isinstance(pool, Processes):
                pool.let_go()
            else:
                pool.shutdown(wait=False, cancel_futures=True)
            raise


def handed(executor: Executor, function: Callable[[Task], Answer], task: Task) -> Future[Answer]:
    """Hand one task over; Ctrl-C is delayed, and hidden from processes that start meanwhile."""
    with interrupts_blocked():
        return executor.submit(partial(_ending, function), task)


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

    A run that a broken executor refuses gives its `BrokenExecutor`.
    """
    done: SimpleQueue[int] = SimpleQueue()
    running: dict[int, Future[Answer]] = {}
    waiting = iter(todo.items())

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
        yield from hand_over(in_hand)
        while running:
            k = done.get()
            future = running.pop(k)
            gone = CancelledError("the executor gave the run up") if future.cancelled() else None
            result = gone or future.exception() or future.result()
            # Before the caller stores the result, so that no worker waits for the disk.
            yield from hand_over(1)
            yield k, result
    finally:
        for future in running.values():
            future.cancel()
