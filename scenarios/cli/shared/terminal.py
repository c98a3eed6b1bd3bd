"""Printing on stdout and progress on stderr."""

from __future__ import annotations

import codecs
import io
import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console
from rich.measure import Measurement
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

#: One character for one, where the terminal's encoding lacks it: tables keep their columns.
_PLAIN = str.maketrans("●·–…←±", "x.-~<~")


#: Without a terminal, progress is told once in so many seconds.
SILENCE = 20.0


class Bar:
    """Shows `done` of `total`, once there is something to show."""

    def __init__(self, progress: Progress, label: str) -> None:
        self._progress = progress
        self._task = progress.add_task(label, total=None)

    def __call__(self, done: int, total: int) -> None:
        """Move the bar."""
        self._progress.update(self._task, completed=done, total=total)

    def label(self, text: str) -> None:
        """Say something else in front of it."""
        self._progress.update(self._task, description=text)


class Lines:
    """Says in a line now and then how far it is, where there is no terminal for a bar."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._said = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Say so, when it was not said lately."""
        now = time.monotonic()
        if now - self._said >= SILENCE:
            self._said = now
            typer.echo(f"{self._label}: {done} of {total}", err=True)

    def label(self, text: str) -> None:
        """Say something else in front of it."""
        self._label = text


@contextmanager
def bar(label: str) -> Iterator[Bar | Lines]:
    """A progress bar on stderr that leaves nothing behind; lines where that is no terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Lines(label)
        return
    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        yield Bar(progress, label)


def show(*renderables: Text | Table) -> None:
    """Print on stdout; only text is wrapped, and only for a terminal."""
    console = Console(highlight=False, markup=False)
    for renderable in renderables:
        if isinstance(renderable, Table) or not console.is_terminal:
            console.width = max(console.width, _width(console, renderable))
        console.print(renderable)


def _width(console: Console, renderable: Text | Table) -> int:
    """Columns that it takes where there is room for everything."""
    return Measurement.get(console, console.options.update(max_width=10_000), renderable).maximum


def prepare_streams() -> None:
    """Let stdout and stderr take any text: into nowhere where closed, in plainer characters."""
    codecs.register_error("minisim-plain", _plain)
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="minisim-plain")


def drop_output() -> None:
    """Send what is still to be written to stdout nowhere, for it cannot be written."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end].translate(_PLAIN)
    return "".join(c if c.isascii() else "?" for c in text), error.end


def show_json(value: Any) -> None:
    """Print JSON and nothing else; what has no value is null."""
    typer.echo(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False))
