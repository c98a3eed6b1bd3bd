"""An executor of processes, each of which is at work at once and ends with this one.

They are forked from a server, a process that has loaded what runs need. It is a fork of this one if
that has no other threads: a fork could hang where a thread, such as that of a progress bar, held a
lock. Otherwise it is spawned, which takes most of a second. Requests reach it by a socket without a
name, so no file can be left behind, nor can its path be too long, as that of
`multiprocessing.forkserver` can. Where forking is unsafe, each process is spawned.

`ProcessPoolExecutor`, loky and pebble cannot replace this. With the last two, a busy worker
outlives a killed parent; with the first two, one dead worker loses all runs.
"""

from __future__ import annotations

import gc
import os
import pickle
import re
import signal
import socket
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection
from multiprocessing.resource_tracker import ensure_running, getfd
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from minisim.errors import ExecutorError

#: Whether workers are forked from a server. Apple's libraries do not survive a fork.
FORKS = hasattr(os, "fork") and sys.platform != "darwin"

#: What Python says of a fork beside threads that it has not made.
MULTI_THREADED = "This process .* is multi-threaded"

#: How many times a worker is asked to end, once per second, before it is killed.
PATIENCE = 10

#: Python imports the script anew in each process that is spawned, and forbids it to start others.
UNGUARDED = (
    "no process can be started for the runs; a script that sweeps with several jobs does so under "
    '`if __name__ == "__main__":`'
)

Asked = ParamSpec("Asked")
Answer = TypeVar("Answer")


class Processes(ThreadPoolExecutor):
    """Threads, each of which hands its task to a process and waits for the answer.

    A task whose process dies raises `BrokenProcessPool`, and the others go on.
    """

    def __init__(self, jobs: int) -> None:
        super().__init__(jobs)
        start_server()  # before there are threads
        for server in _SERVERS.values():
            server.used = True
        self._idle: deque[Connection] = deque()
        self._leash, self._hand = Pipe(duplex=False)
        Finalize(self, self._hand.close, exitpriority=1)

    def submit(
        self, function: Callable[Asked, Answer], /, *args: Asked.args, **named: Asked.kwargs
    ) -> Future[Answer]:
        """Hand a task over; function, arguments and answer are pickled."""
        return super().submit(self._answer, function, args, named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes as they become idle, and `wait` for that."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            with suppress(OSError):
                for worker in self._idle:
                    worker.send_bytes(b"")
            while self._idle:
                with suppress(OSError, EOFError):
                    self._idle.pop().recv_bytes()  # until its end is closed

    def let_go(self) -> None:
        """End all processes and their runs at once."""
        super().shutdown(wait=False, cancel_futures=True)
        self._hand.close()
        _stop_server()  # it may still be loading, while a thread waits for a worker

    def _answer(
        self, function: Callable[..., Answer], args: Sequence[Any], named: Mapping[str, Any]
    ) -> Answer:
        task = pickle.dumps((function, args, named))
        try:
            worker = self._idle.pop()
        except IndexError:
            worker = self._started()
        try:
            worker.send_bytes(task)
            outcome = worker.recv_bytes()
        except (EOFError, OSError):
            raise BrokenProcessPool("the process of the run died") from None
        self._idle.append(worker)
        answer, error = pickle.loads(outcome)
        if error is not None:
            raise error
        return answer  # type: ignore[no-any-return]  # pickle does not know

    def _started(self) -> Connection:
        worker, its_end = Pipe()
        try:
            with its_end, interrupts_blocked():
                _start(its_end, self._leash)
            worker.recv_bytes()  # it is ready
        except (EOFError, OSError, RuntimeError):
            raise ExecutorError(UNGUARDED) from None
        return worker


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Delay Ctrl-C in the block, and hide it from threads and processes that start meanwhile."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    ensure_running()  # or the first process would, which ends the delay
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start(connection: Connection, leash: Connection) -> None:
    """Start a worker, which answers what comes through its connection."""
    if not FORKS:
        get_context("spawn").Process(target=_work, args=(connection, leash)).start()
        return
    with _LOCK:
        handles = [connection.fileno(), leash.fileno()]
        try:
            socket.send_fds(_server().control, [b"w"], handles)
        except OSError:  # it was killed
            socket.send_fds(_server(anew=True).control, [b"w"], handles)


def _work(connection: Connection, leash: Connection) -> None:
    """Answer tasks until an empty one comes."""
    # Ctrl-C reaches every process of the terminal; only the parent should answer it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(leash,), daemon=True).start()
    connection.send_bytes(b"ready")
    with suppress(EOFError):  # the parent was killed
        while task := connection.recv_bytes():
            connection.send_bytes(_answered(task))


def _answered(task: bytes) -> bytes:
    """The pickled answer and None, or None and the exception."""
    try:
        function, args, named = pickle.loads(task)
        return pickle.dumps((function(*args, **named), None))
    except BaseException as error:
        try:
            return pickle.dumps((None, error))
        except Exception:
            return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))


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


class _Server:
    """The process that workers are forked from; it ends with this one."""

    def __init__(self) -> None:
        self.control, its_end = socket.socketpair()
        self.forked, self.used = _has_one_thread(), False
        with its_end, warnings.catch_warnings():
            warnings.filterwarnings("ignore", MULTI_THREADED, DeprecationWarning)
            method = get_context("fork") if self.forked else get_context("spawn")
            process = method.Process(target=_serve, args=(its_end, self.forked))
            process.start()
        self.stop = Finalize(self, _terminate, (process, self.control), exitpriority=1)

    def retire(self) -> None:
        """Let it end after its last request."""
        self.stop.cancel()
        self.control.close()


def _has_one_thread() -> bool:
    """Whether no other thread can hold a lock; those of OpenBLAS do not outlive a fork."""
    if threading.active_count() > 1:
        return False
    try:  # OpenMP waits in vain for its threads after a fork
        return re.search(r"/lib[gi]?omp", Path("/proc/self/maps").read_text()) is None
    except OSError:
        return False


def _terminate(process: Any, control: socket.socket) -> None:
    process.terminate()
    process.join()
    control.close()


#: By what a process takes from its surroundings; there is at most one.
_SERVERS: dict[object, _Server] = {}
_LOCK = threading.Lock()


def _server(*, anew: bool = False) -> _Server:
    """The server; a new one if this process has changed its surroundings since, or was forked."""
    where = os.getpid(), os.getcwd(), tuple(sys.path), tuple(os.environ.items())
    if anew or where not in _SERVERS:
        for server in _SERVERS.values():
            server.retire()
        _SERVERS.clear()
        _SERVERS[where] = _Server()
    return _SERVERS[where]


def start_server() -> None:
    """Start the server of the next pool now, which is quicker while there is no other thread.

    A fork serves one pool: it knows no class that its parent has defined since.
    """
    if FORKS:
        with _LOCK, interrupts_blocked(), suppress(OSError, RuntimeError):  # the first task tells
            _server(anew=any(it.forked and it.used for it in _SERVERS.values()))


def _stop_server() -> None:
    with _LOCK:
        for server in _SERVERS.values():
            server.stop()
        _SERVERS.clear()


def _serve(control: socket.socket, forked: bool) -> None:
    """Become a worker in a fork for each pair of handles that comes; end when the parent does."""
    global _LOCK
    if forked:
        _LOCK = threading.Lock()  # its parent holds the other one
        _close_all_but(control.fileno(), getfd() or 0)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _load()
    gc.freeze()  # or the first collection of each fork would copy all of it
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # no one asks how forks ended
    warnings.filterwarnings("ignore", MULTI_THREADED, DeprecationWarning)
    while handles := socket.recv_fds(control, 1, 2)[1]:
        if os.fork() == 0:
            control.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            _work(*map(Connection, handles))
            return
        for handle in handles:
            os.close(handle)


def _close_all_but(*kept: int) -> None:
    """Close what a fork has of its parent: the other end of a pipe would never be told the end."""
    lowest = 3
    for handle in (*sorted(kept), os.sysconf("SC_OPEN_MAX")):
        os.closerange(lowest, handle)
        lowest = handle + 1


def _load() -> None:
    """Load what every run needs: modules, and compiled code by a short run."""
    from dim import Dim
    from scenarios.library import four_way
    from scenarios.recipe import Recipe
    from scenarios.sweep.rows import outcome_of

    with suppress(Exception):  # what fails here is told by the run that needs it
        outcome_of(Recipe(four_way(350.0, horizon=10.0), Dim(), 0))
