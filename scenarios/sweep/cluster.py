"""A Dask cluster as an executor of sweeps (extra `dask`)."""

from __future__ import annotations

import importlib
import logging
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from typing import Any

from minisim.errors import InputError, MissingExtraError, extra, instance
from scenarios.sweep.keys import results_version

#: The address of a scheduler; the protocols are Dask's.
ADDRESS = re.compile(r"((tcp|tls|ucx|ws|wss)://)?[^/\s]+:(?P<port>\d{1,9})", re.ASCII)

#: How long to wait for a scheduler, and then for its first worker [s].
PATIENCE = 5.0


@contextmanager
def cluster(address: str, patience: float = PATIENCE) -> Iterator[Executor]:
    """An executor on the cluster of the scheduler at `address`, such as tcp://10.0.0.1:8786.

    Dask repeats the tasks of a lost worker on others, and gives up a run that has cost three
    workers. Raises `MissingExtraError` without the extra `dask`, and `InputError` if there is no
    scheduler, or if it has no workers or one with another version of minisim.
    """
    instance("scheduler", address, str)
    form = ADDRESS.fullmatch(address)
    if form is None or not 1 <= int(form["port"]) <= 65535:  # Dask would hang while it cleans up
        need = "an address has the form tcp://host:port, with a port 1 … 65535"
        raise InputError(f"no Dask scheduler at {address!r}: {need}")
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        need = f"--scheduler needs the package distributed: {extra('dask')}"
        raise MissingExtraError(need) from None
    # The sweep itself reports a lost connection in one line. Each logger has its own level.
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"no Dask scheduler at {address!r}: {reason}") from error
    with client:
        _check_workers(client, address, patience)
        with Watched(client.get_executor(), lambda: client.status == "running", patience) as runs:
            yield runs


class Watched(Executor):
    """An executor that gives all runs up once its scheduler has been lost for `patience` seconds.

    Dask does so itself, but for results that were just on their way: these it would await for ever.
    """

    def __init__(self, executor: Executor, alive: Callable[[], bool], patience: float) -> None:
        self._executor, self._alive, self._patience = executor, alive, patience
        self._running: set[Future[Any]] = set()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def submit(self, function: Callable[..., Any], /, *args: Any, **options: Any) -> Future[Any]:
        """As of the executor."""
        future = self._executor.submit(function, *args, **options)
        self._running.add(future)
        future.add_done_callback(self._running.discard)  # its result is the caller's to keep
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002
        """Stop watching; the cluster itself goes on."""
        self._over.set()
        self._thread.join()

    def _watch(self) -> None:
        lost = 0.0
        pause = min(0.5, self._patience / 4.0)
        while lost < self._patience:
            if self._over.wait(pause):
                return
            lost = 0.0 if self._alive() else lost + pause
        for future in list(self._running):
            future.cancel()


def _check_workers(client: Any, address: str, patience: float) -> None:
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError as error:
        raise InputError(f"the Dask scheduler at {address} has no workers") from error
    try:
        versions = client.run(results_version)
    except ImportError as error:
        raise InputError(f"the workers of {address} lack minisim: {error}") from error
    ours = results_version()
    for worker, it in versions.items():
        if it != ours:
            raise InputError(f"worker {worker} has version {it} of the results, here it is {ours}")
