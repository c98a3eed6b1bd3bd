"""A section of the gallery and of the report: figures, tables, and the text around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from figures.tables import Table
from scenarios.studies.shared.archive import Archive

Drawing = Figure | Table


@dataclass(frozen=True)
class Item:
    """A figure or table that can be made."""

    name: str  # on the command line and in file names
    title: str  # in one line
    #: Makes it from the results of the studies that it needs, one argument per study.
    draw: Callable[..., Drawing]
    needs: tuple[str, ...] = ()  # those studies
    in_report: bool = True  # whether the report shows it; otherwise it is a file only

    def build(self, archive: Archive) -> Drawing:
        """Make it; raises `MissingRunsError` if it needs runs and there are none."""
        return self.draw(*archive.need(*self.needs))


@dataclass(frozen=True)
class Section:
    """A section of the report."""

    heading: str  # above it
    items: tuple[Item, ...]  # its figures and tables, in order
    ending: Callable[[Archive], str] | None = None  # a text below the items
    appendix: bool = False  # whether it comes after all others
