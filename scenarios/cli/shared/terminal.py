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

#: Characters in place of those that the terminal's encoding lacks: one for one, so that tables keep
#: their columns.
_PLAIN = str.maketrans("●·–…←±", "x.-~<~")

#: How often a line of progress is printed where there is no terminal [s].
SILENCE = 20.0


class Bar:
    """Progress: a bar on a terminal; elsewhere a line now and then."""

    def __init__(self, label: str, progress: Progress | None) -> None:
        self._label = label
        self._progress = progress
        self._task = progress.add_task(label, total=None) if progress else None
        self._said = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Show `done` of `total`; a line at most once in `SILENCE` seconds."""
        if self._progress is not None and self._task is not None:
            self._progress.update(self._task, completed=done, total=total, description=self._label)
        elif (now := time.monotonic()) - self._said >= SILENCE:
            self._said = now
            typer.echo(f"{self._label}: {done} of {total}", err=True)

    def label(self, text: str) -> None:
        """Change the text in front of the bar, from the next call on."""
        self._label = text


@contextmanager
def bar(label: str) -> Iterator[Bar]:
    """A progress bar on stderr that vanishes at the end; lines where stderr is no terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Bar(label, None)
        return
    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        yield Bar(label, progress)


def show(*renderables: Text | Table) -> None:
    """Print on stdout; only text is wrapped, and only on a terminal."""
    console = Console(highlight=False, markup=False)
    for renderable in renderables:
        if isinstance(renderable, Table) or not console.is_terminal:
            console.width = max(console.width, _width(console, renderable))
        console.print(renderable)


def show_json(value: Any) -> None:
    """Print JSON and nothing else; a missing value is null."""
    typer.echo(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False))


def _width(console: Console, renderable: Text | Table) -> int:
    """The columns that it takes where there is room for everything."""
    return Measurement.get(console, console.options.update(max_width=10_000), renderable).maximum


def prepare_streams() -> None:
    """Let stdout and stderr take any text: in plainer characters if need be; lost if closed."""
    codecs.register_error("minisim-plain", _plain)
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="minisim-plain")


def drop_output() -> None:
    """Send the rest of stdout nowhere, since it cannot be written."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end].translate(_PLAIN)
    return "".join(c if c.isascii() else "?" for c in text), error.end
