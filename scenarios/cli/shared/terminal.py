"""Printing to stdout, and progress on stderr."""

from __future__ import annotations

import codecs
import io
import json
import os
import sys
import textwrap
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.progress import Progress

#: Substitutes for what the terminal's encoding lacks: one for one, so that tables stay aligned.
_PLAIN = str.maketrans("●·–…←±", "x.-~<~")

#: Shortest time between two lines of progress if stderr is not a terminal [s].
SILENCE = 20.0


class Bar:
    """Progress: a bar on a terminal, or else a line now and then."""

    def __init__(self, label: str, progress: Progress | None) -> None:
        self._label, self._progress = label, progress
        self._task = progress.add_task(label, total=None) if progress else None
        self._said = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        """Show `done` of `total`; without a bar, print a line at most every `SILENCE` seconds."""
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
    """A progress bar on stderr that vanishes at the end; lines if stderr is not a terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Bar(label, None)
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True) as progress:
        yield Bar(label, progress)


def show(*renderables: Text | Table) -> None:
    """Print to stdout; only text is wrapped, and only on a terminal."""
    console = Console(highlight=False, markup=False)
    for renderable in renderables:
        if isinstance(renderable, Table) or not console.is_terminal:
            roomy = console.options.update(max_width=10_000)
            console.width = max(console.width, Measurement.get(console, roomy, renderable).maximum)
        console.print(renderable)


def show_json(value: Any) -> None:
    """Print JSON and nothing else; a missing value is null."""
    typer.echo(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False))


def wrapped(text: str, indent: int) -> str:
    """A text in lines of 80 columns, all but the first indented."""
    return textwrap.fill(text, 80, subsequent_indent=" " * indent, break_long_words=False)


def prepare_streams() -> None:
    """Let stdout and stderr, even if closed, take any text, in plainer characters if need be."""
    codecs.register_error("minisim-plain", _plain)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
        if isinstance(stream := getattr(sys, name), io.TextIOWrapper):
            stream.reconfigure(errors="minisim-plain")


def drop_output() -> None:
    """Discard the rest of stdout, since it cannot be written."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def _plain(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end].translate(_PLAIN)
    return "".join(c if c.isascii() else "?" for c in text), error.end
