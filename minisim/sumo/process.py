"""SUMO's process, as its caller sees it."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import weakref
from pathlib import Path

from minisim.errors import SumoError
from minisim.sumo.messages import Asked, Channel, Ended, Failed, Job, Proceed, Started
from minisim.sumo.network import sumo_environment

#: What the process writes on stderr.
STDERR = "stderr.txt"

#: What it runs. The classes of its messages must belong to the module, not to `__main__`.
CHILD = "from minisim.sumo.worker import main; main()"


class Process:
    """One run in a process of its own. If that refuses or dies, its caller is unaffected.

    Args:
        folder: where it runs.
        dt: its step [s].
        channel: the pipes to it.
        version: SUMO's, "" until it has started.
        child: the process, unless it is a fork of another one's.
    """

    def __init__(
        self, folder: Path, dt: float, channel: Channel, *, version: str = "",
        child: subprocess.Popen[bytes] | None = None,
    ) -> None:  # fmt: skip
        self.folder, self.version = folder, version
        self._dt, self._channel, self._child, self._time = dt, channel, child, 0.0
        #: Ends the process; may be called again.
        self.close = weakref.finalize(self, _end, channel, child)

    def ask(self, message: Job | Proceed | None) -> Asked | Ended:
        """Have it start a job, or go on, or end the run; returns where it stopped.

        Raises:
            SumoError: it refused or died.
        """
        failed, answer = "SUMO failed", None
        try:
            self._channel.send(message)
            while isinstance(answer := self._channel.receive(), Started):
                self.version = answer.version
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            failed, what = "SUMO's process died", ""
            if self._child is not None:
                what = f" ({_cause(self._child.wait())})"
        if isinstance(answer, Failed):
            what = f": {answer.reason}"
        elif isinstance(answer, Asked | Ended):
            self._time = answer.tick * self._dt
            if isinstance(answer, Ended) and self._child is not None:
                self._child.wait()
            return answer
        self.close()
        when = f"after {self._time:.1f} s of simulated time"
        raise SumoError(
            f"{failed} {when if self.version else 'before the first step'}{what}"
            f"{_last_words(self.folder / STDERR)}"
        )

    def fork(self, folder: Path) -> Process:
        """A copy of the process in an empty folder of its own; both go on from here."""
        from minisim.sumo.forks import connect  # only Linux has all that it imports

        channel = connect(self._channel, folder)
        return Process(folder, self._dt, channel, version=self.version)


def started(job: Job, home: Path) -> tuple[Process, Asked]:
    """A new process for a job, and its first stop."""
    environment = sumo_environment(home) | {
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        "MINISIM_JIT": "0",  # compiled functions are slow to call one vehicle at a time
    }
    folder = Path(job.folder)
    with (folder / STDERR).open("wb") as complaints:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", CHILD], env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints,
        )  # fmt: skip
    assert child.stdin is not None
    assert child.stdout is not None
    channel = Channel(child.stdout, child.stdin)
    process = Process(folder, job.law.dt, channel, child=child)
    first = process.ask(job)
    assert isinstance(first, Asked)
    return process, first


def _end(channel: Channel, child: subprocess.Popen[bytes] | None) -> None:
    if child is None:
        channel.close()  # a fork ends when it finds its pipes closed
    else:
        child.kill()
        child.communicate()


def _cause(code: int) -> str:
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"exit code {code}"


def _last_words(complaints: Path) -> str:
    """The last lines that the process wrote, as one line."""
    lines = complaints.read_text(errors="replace").split("\n")
    words = "; ".join(line.strip() for line in lines[-8:] if line.strip())
    return f": {words}" if words else ""
