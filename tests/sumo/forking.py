"""SUMO's process as the host starts it, but forked from one that has loaded all it needs.

Python, minisim and libsumo take more time to load than most tests to run. What comes after is the
same, in a process of its own. Tests of the start itself use the fixture `started`.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import IO

#: What the two processes say: 0 asks for a fork, which is answered by its process id; a process id
#: asks for its exit code.
NUMBER = struct.Struct("q")


class Forked:
    """What the host uses of a `subprocess.Popen`."""

    def __init__(
        self, server: socket.socket, command: object, *, env: Mapping[str, str], stderr: IO[bytes],
        **pipes: int,
    ) -> None:  # fmt: skip
        self._server = server
        (its_stdin, ours), (theirs, its_stdout) = os.pipe(), os.pipe()
        fds = its_stdin, its_stdout, stderr.fileno()
        socket.send_fds(server, [NUMBER.pack(0)], fds)
        self.pid = self._answer()
        for fd in (its_stdin, its_stdout):
            os.close(fd)
        self.stdin, self.stdout = os.fdopen(ours, "wb"), os.fdopen(theirs, "rb")
        pickle.dump(dict(env), self.stdin)
        self.returncode: int | None = None

    def _answer(self) -> int:
        number: int = NUMBER.unpack(self._server.recv(NUMBER.size, socket.MSG_WAITALL))[0]
        return number

    def wait(self) -> int:
        if self.returncode is None:
            self._server.sendall(NUMBER.pack(self.pid))
            self.returncode = self._answer()
        return self.returncode

    def kill(self) -> None:
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)

    def communicate(self) -> None:
        self.stdin.close()
        self.stdout.close()
        self.wait()


@contextmanager
def forking() -> Iterator[socket.socket]:
    """The process that forks, by the socket on which it is asked."""
    ours, its = socket.socketpair()
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "MINISIM_JIT": "0"}
    command = [sys.executable, "-P", __file__, str(its.fileno())]
    # Ctrl-C is for pytest: without it, nothing asks any more.
    with subprocess.Popen(
        command, env=environment, pass_fds=[its.fileno()], start_new_session=True
    ):
        its.close()
        with ours:
            yield ours


def forked(caller: socket.socket) -> bool:
    """Fork whenever the caller asks; returns True in a fork, False when the caller has gone."""
    while True:
        asked, fds, *_ = socket.recv_fds(caller, NUMBER.size, 3)
        if not asked:
            return False
        (pid,) = NUMBER.unpack(asked)
        if pid:
            answer = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        else:
            answer = os.fork()
            for target, fd in enumerate(fds):
                if not answer:
                    os.dup2(fd, target)
                os.close(fd)
            if not answer:
                os.environ.clear()
                os.environ.update(pickle.load(sys.stdin.buffer))
                return True
        caller.sendall(NUMBER.pack(answer))


if __name__ == "__main__":
    import libsumo  # noqa: F401  (loaded here once)

    from minisim.sumo.worker import main

    gc.freeze()  # what is loaded need not be looked at, and so copied, in every fork
    with socket.socket(fileno=int(sys.argv[1])) as caller:
        called = forked(caller)
    if called:
        main()
