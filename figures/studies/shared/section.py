"""A section of the gallery and of the report: figures, tables, and the text around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from figures.tables import Table
from scenarios.studies.shared.archive import Archive

#: What is drawn: a picture, or a table to read.
Drawing = Figure | Table


@dataclass(frozen=True)
class Item:
    """A figure or table that can be made.

    Attributes:
        name: as on the command line, and of its files.
        title: in one line.
        build: makes it from results.
        needs: the studies that it is made from; none for what needs no run.
        in_report: whether the report shows it; otherwise it is a file only.
    """

    name: str
    title: str
    build: Callable[[Archive], Drawing]
    needs: tuple[str, ...] = ()
    in_report: bool = True


@dataclass(frozen=True)
class Section:
    """What belongs together in the report.

    Attributes:
        heading: above it.
        items: its figures and tables, in their order.
        answer: what the study says, in a few sentences at the head of the report.
        ending: a text below the items.
        appendix: whether it comes after all others.
    """

    heading: str
    items: tuple[Item, ...]
    answer: Callable[[Archive], str] | None = None
    ending: Callable[[Archive], str] | None = None
    appendix: bool = False
