"""The paper's figures and its lane table: its values beside ours, from both studies."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import chain, product
from typing import NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared import paper_values as paper
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from minisim.junction.movements import ARM_NAMES
from scenarios.paper import SERIES, SPLITS
from scenarios.published import PUBLISHED_ARMS
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.paper_comparison import compare, published
from scenarios.studies.shared.points import Point
from scenarios.studies.shared.study import Results

#: Both studies of the paper's grid.
BOTH = tuple(paper.HEADINGS)


class Measure(NamedTuple):
    """A time that the paper shows: column, name, and the axis as in `plots.log_time`."""

    column: str
    name: str
    low: float
    high: float
    linear: float | None


MEASURES = (
    Measure("waiting_time_s", "waiting", 0.0, 500.0, 0.1),
    Measure("travel_time_s", "travel", 45.0, 500.0, None),
)


def split_figure(*both: Results, measure: Measure, split: str) -> Figure:
    """All four controllers on four arms under one of the `SPLITS`."""

    def chosen(table: pd.DataFrame) -> pd.DataFrame:
        return table[(table["arms"] == 4) & (table["split"] == split)]

    inflow = "equal inflow" if split == "balanced" else f"inflow {split}"
    return _grid_figure(
        both, measure, f", 4 arms, {inflow}", tuple(SERIES.values()), chosen,
        lambda point: point.where == f"4 arms, {split}",
    )  # fmt: skip


def arms_figure(*both: Results, measure: Measure) -> Figure:
    """DIM on three, four and five arms with equal inflow."""

    def chosen(table: pd.DataFrame) -> pd.DataFrame:
        dim = table[(table["series"] == "dim") & (table["split"] == "balanced")]
        return dim.assign(series="dim-" + dim["arms"].astype(str))

    return _grid_figure(
        both, measure, " under DIM by number of arms",
        tuple(f"dim-{arms}" for arms in PUBLISHED_ARMS), chosen,
        lambda point: point.series == "dim" and point.where.endswith(", balanced"),
    )  # fmt: skip


def _grid_figure(
    both: tuple[Results, ...], measure: Measure, what: str, series: tuple[str, ...],
    chosen: Callable[[pd.DataFrame], pd.DataFrame], wanted: Callable[[Point], bool],
) -> Figure:  # fmt: skip
    """One panel per study; `chosen` takes the figure's rows from a table, ours or the paper's."""
    figure, panels = plots.panels(
        9.2, 4.9, len(BOTH), left=0.07, right=0.988, top=0.735, bottom=0.15, wspace=0.07
    )
    table = published()
    theirs = chosen(table[(table["metric"] == measure.column) & (table["lane"] == "all")])
    for axes, results in zip(panels, both, strict=True):
        rows = chosen(results.good)
        plots.draw_means(axes, rows, measure.column, series)
        plots.draw_published(axes, theirs, rows, series)
        name = paper.HEADINGS[results.study.name].capitalize()
        style.plot_axes(axes, name, plots.DENSITY_LABEL, "")
        plots.log_time(axes, measure.low, measure.high, linear=measure.linear)
        plots.density_axis(axes)
    scale = plots.scale_words(measure.linear)
    panels[0].set_ylabel(f"mean {measure.name} time [s], {scale}", **style.LABEL)
    title, note = f"Mean {measure.name} time{what}", missing_note(*both, wanted=wanted)
    plots.frame(figure, title, map(style.look, series), note, marks=0.868, paper=True)
    return figure


def lane_table(*both: Results) -> Table:
    """Mean waiting time by lane under DIM at 350 veh/h/lane: the paper's table and ours."""
    tables = []
    for results in both:
        table = compare(results.good)
        dim = table[(table["series"] == "dim") & (table["density"] == 350)]
        tables.append({(row["arms"], row["lane"]): row for row in dim.to_dict("records")})
    rows = []
    for arms in PUBLISHED_ARMS:
        for lane in ARM_NAMES[:arms]:
            ours = [table[arms, lane] for table in tables]
            texts = ((paper.range_words(row, mean=True), paper.inside(row)) for row in ours)
            rows.append((f"{arms}-way", lane, paper.marked(ours[0]), *chain.from_iterable(texts)))

    def wanted(point: Point) -> bool:
        return point.series == "dim" and point.density == 350.0 and "balanced" in point.where

    return Table(
        "Mean waiting time by lane under DIM at 350 veh/h/lane [s]",
        ("junction", "lane", "paper",
         *(t for words in paper.HEADINGS.values() for t in (words, "paper inside"))),
        tuple(rows), labels=2,
        notes=(f"{missing_note(*both, wanted=wanted)}  {paper.EXPLAINED}",),
    )  # fmt: skip


SECTION = Section(
    "The paper's figures and tables",
    (
        *(
            Item(f"{measure.name}-{split.replace(':', '')}",
                 f"mean {measure.name} time over demand, inflow {split}, 4 arms",
                 partial(split_figure, measure=measure, split=split), BOTH)
            for split, measure in product(SPLITS, MEASURES)
        ),
        *(
            Item(f"{measure.name}-arms", f"mean {measure.name} time under DIM on 3, 4 and 5 arms",
                 partial(arms_figure, measure=measure), BOTH)
            for measure in MEASURES
        ),
        Item("lanes", "waiting time by lane at 350 veh/h/lane", lane_table, BOTH),
    ),
)  # fmt: skip
