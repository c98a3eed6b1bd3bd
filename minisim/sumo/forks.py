"""Forks of SUMO's process: two copies of a run that go on by themselves.

libsumo can save its state to a file, but not all of it: commanded speeds, for instance, are lost. A
fork of the process has everything. It gets pipes of its own, and its own copies of the files that
SUMO is writing. Only Linux can do it.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import signal
import stat
from collections.abc import Iterator
from pathlib import Path

from minisim.sumo.messages import Channel, Fork, Job

#: The pipes in the folder of a fork, to it and from it.
PIPES = "to", "from"

#: Where Linux lists the open files of a process.
OPEN_FILES = Path("/proc/self/fd")


def connect(channel: Channel, folder: Path) -> Channel:
    """Have the process at the other end of `channel` forked; returns the channel to the fork."""
    to, back = (folder / name for name in PIPES)
    for pipe in (to, back):
        os.mkfifo(pipe)
    # Neither waits for the other end, and the fork does not find its pipe closed before we open it.
    source = os.fdopen(os.open(back, os.O_RDONLY | os.O_NONBLOCK), "rb")
    target = os.fdopen(os.open(to, os.O_RDWR), "wb")
    channel.send(Fork(str(folder)))
    channel.receive()
    os.set_blocking(source.fileno(), True)
    for pipe in (to, back):
        pipe.unlink()
    return Channel(source, target)


def forked(job: Job, caller: Channel, asked: Fork) -> Job:
    """Fork this process. Each copy goes on from here and returns its own job.

    In the new one, `caller` is the process that asked for it, by pipes of its own.
    """
    folder = Path(asked.folder)
    target = os.open(folder / PIPES[1], os.O_WRONLY)
    source = os.open(folder / PIPES[0], os.O_RDONLY)
    moved = [(source, caller.source.fileno()), (target, caller.target.fileno())]
    moved += _copies(Path(job.folder).resolve(), folder)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # no fork is waited for
    new = os.fork()
    for mine, theirs in moved:
        if not new:
            os.dup2(mine, theirs)
        os.close(mine)
    if new:
        caller.send(new)
        return job
    os.chdir(folder)
    return job._replace(folder=asked.folder, temporary=True)


def _copies(folder: Path, into: Path) -> Iterator[tuple[int, int]]:
    """Copy each file of a folder that is open; yields the copy's descriptor and its own."""
    for entry in list(OPEN_FILES.iterdir()):
        number = int(entry.name)
        try:
            path = Path(os.readlink(entry))
            kept = path.parent == folder and stat.S_ISREG(os.fstat(number).st_mode)
        except OSError:  # the listing itself, closed by now
            continue
        if kept:
            shutil.copyfile(path, into / path.name)
            copy = os.open(into / path.name, fcntl.fcntl(number, fcntl.F_GETFL))
            os.lseek(copy, os.lseek(number, 0, os.SEEK_CUR), os.SEEK_SET)
            yield copy, number
