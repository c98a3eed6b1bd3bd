"""A section of the gallery and of the report: figures, tables, and the text around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from figures.tables import Table
from scenarios.studies.shared.archive import Archive
from scenarios.studies.shared.study import Results

Drawing = Figure | Table


@dataclass(frozen=True)
class Item:
    """A figure or table that can be made.

    Attributes:
        name: on the command line, and of its files.
        title: in one line.
        draw: makes it from the results of the studies that it needs, one argument each.
        needs: those studies.
        in_report: whether the report shows it; otherwise it is a file only.
    """

    name: str
    title: str
    draw: Callable[..., Drawing]
    needs: tuple[str, ...] = ()
    in_report: bool = True

    def build(self, archive: Archive) -> Drawing:
        """Make it; raises `MissingRunsError` if it needs runs and there are none."""
        return self.draw(*archive.need(*self.needs))


@dataclass(frozen=True)
class Section:
    """A section of the report.

    Attributes:
        heading: above it.
        items: its figures and tables, in order.
        answer: the study's answer in a few sentences, for the head of the report.
        ending: a text below the items.
        appendix: whether it comes after all others.
    """

    heading: str
    items: tuple[Item, ...]
    answer: Callable[[Results], str] | None = None
    ending: Callable[[Archive], str] | None = None
    appendix: bool = False
