"""The paper's figures and its table of lanes: its own values beside both ways to run its grid."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.paper_values import (
    EXPLAINED,
    HEADINGS,
    agreement,
    inside,
    marked,
    range_words,
)
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from minisim.junction.movements import ARM_NAMES
from scenarios.paper import SERIES, SPLITS
from scenarios.published import PUBLISHED_ARMS
from scenarios.studies.shared.archive import Archive, missing_note
from scenarios.studies.shared.paper_comparison import compare, published
from scenarios.studies.shared.points import Point

if TYPE_CHECKING:
    import pandas as pd

#: Both studies of the paper's grid.
BOTH = tuple(HEADINGS)


class Measure(NamedTuple):
    """A time that the paper shows.

    Attributes:
        column: of a sweep.
        name: in words.
        low, high: ends of its axis [s].
        linear: below it the axis is linear; None is logarithmic throughout.
    """

    column: str
    name: str
    low: float
    high: float
    linear: float | None


#: What the paper shows over demand.
MEASURES = (
    Measure("waiting_time_s", "waiting", 0.0, 500.0, 0.1),
    Measure("travel_time_s", "travel", 45.0, 500.0, None),
)


def split_figure(archive: Archive, measure: Measure, split: str) -> Figure:
    """All four controllers on four arms under one split.

    Args:
        archive: of both studies.
        measure: what is shown.
        split: of `scenarios.paper.SPLITS`.

    Raises:
        MissingRunsError: nothing was run.
    """

    def chosen(table: pd.DataFrame) -> pd.DataFrame:
        return table[(table["arms"] == 4) & (table["split"] == split)]

    inflow = "equal inflow" if split == "balanced" else f"inflow {split}"
    return _grid_figure(
        archive, measure, f", 4 arms, {inflow}", tuple(SERIES.values()), chosen,
        lambda point: point.where == f"4 arms, {split}",
    )  # fmt: skip


def arms_figure(archive: Archive, measure: Measure) -> Figure:
    """DIM on three, four and five arms with equal inflow; arguments as in `split_figure`."""

    def chosen(table: pd.DataFrame) -> pd.DataFrame:
        dim = table[(table["series"] == "dim") & (table["split"] == "balanced")]
        return dim.assign(series="dim-" + dim["arms"].astype(str))

    return _grid_figure(
        archive, measure, " under DIM by number of arms",
        tuple(f"dim-{arms}" for arms in PUBLISHED_ARMS), chosen,
        lambda point: point.series == "dim" and point.where.endswith(", balanced"),
    )  # fmt: skip


def _grid_figure(
    archive: Archive, measure: Measure, what: str, series: tuple[str, ...],
    chosen: Callable[[pd.DataFrame], pd.DataFrame], wanted: Callable[[Point], bool],
) -> Figure:  # fmt: skip
    """One panel a study.

    Args:
        archive: of both studies.
        measure: what is shown.
        what: the rest of the title.
        series: the lines.
        chosen: the rows of a table, ours or the paper's, that the figure shows.
        wanted: whether a point belongs to the figure.
    """
    both = archive.need(*BOTH)
    figure, panels = plots.panels(
        9.2, 4.9, len(BOTH), left=0.07, right=0.988, top=0.735, bottom=0.15, wspace=0.07
    )
    table = published()
    theirs = chosen(table[(table["metric"] == measure.column) & (table["lane"] == "all")])
    for axes, results in zip(panels, both, strict=True):
        rows = chosen(results.good)
        plots.draw_means(axes, rows, measure.column, series)
        plots.draw_published(axes, theirs, rows, series)
        style.plot_axes(axes, HEADINGS[results.study.name].capitalize(), plots.DENSITY_LABEL, "")
        plots.log_time(axes, measure.low, measure.high, linear=measure.linear)
        plots.paper_densities(axes)
    scale = plots.scale_words(measure.linear)
    plots.ylabel(panels[0], f"mean {measure.name} time [s], {scale}")
    plots.heading(figure, f"Mean {measure.name} time{what}")
    plots.series_legend(figure, series, 0.012, 0.925)
    plots.marks_legend(figure, 0.012, 0.868, paper=True)
    plots.footnote(figure, missing_note(both, wanted))
    return figure


def lane_table(archive: Archive) -> Table:
    """Mean waiting time by lane under DIM at 350 veh/h/lane: the paper's table and ours.

    Raises:
        MissingRunsError: nothing was run.
    """
    both = archive.need(*BOTH)
    tables = []
    for results in both:
        table = compare(results.good)
        dim = table[(table["series"] == "dim") & (table["density"] == 350)]
        tables.append({(row["arms"], row["lane"]): row for row in dim.to_dict("records")})
    rows = []
    for arms in PUBLISHED_ARMS:
        for lane in ARM_NAMES[:arms]:
            ours = [table[arms, lane] for table in tables]
            rows.append((
                f"{arms}-way", lane, marked(ours[0]),
                *(text for row in ours for text in (range_words(row, mean=True), inside(row))),
            ))  # fmt: skip
    note = missing_note(
        both,
        lambda point: (
            point.series == "dim" and point.density == 350.0 and point.where.endswith("balanced")
        ),
    )
    return Table(
        "Mean waiting time by lane under DIM at 350 veh/h/lane [s]",
        ("junction", "lane", "paper",
         *(t for words in HEADINGS.values() for t in (words, "paper inside"))),
        tuple(rows), labels=2, notes=(f"{note}  {EXPLAINED}",),
    )  # fmt: skip


def _items() -> Iterator[Item]:
    for split, measure in product(SPLITS, MEASURES):
        yield Item(
            f"{measure.name}-{split.replace(':', '')}",
            f"mean {measure.name} time over demand, inflow {split}, 4 arms",
            partial(split_figure, measure=measure, split=split), BOTH,
        )  # fmt: skip
    for measure in MEASURES:
        yield Item(
            f"{measure.name}-arms", f"mean {measure.name} time under DIM on 3, 4 and 5 arms",
            partial(arms_figure, measure=measure), BOTH,
        )  # fmt: skip
    yield Item("lanes", "waiting time by lane at 350 veh/h/lane", lane_table, BOTH)


SECTION = Section(
    "The paper's figures and tables", tuple(_items()), partial(agreement, name="text")
)
