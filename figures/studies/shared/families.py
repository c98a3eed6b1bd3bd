"""Many controllers in one figure: a row of panels for each family, with all others pale behind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.figure import Figure

from figures import plots, style
from scenarios.controllers import FAMILIES

#: Every row has this one, for comparison.
REFERENCE = "dim"
#: Inches: the figure's width, a row's height and its distance from the next, the head and the foot.
WIDTH, ROW, GAP, HEAD, FOOT = 11.5, 2.45, 0.3, 1.1, 0.8
#: Where panels end and legends begin, as shares of the width.
RIGHT, LEGEND = 0.795, 0.803


class Panel(NamedTuple):
    """A column of panels: what it is called, and what it shows."""

    title: str
    rows: pd.DataFrame  # of a study
    metric: str


def panels_by_family(
    series: Sequence[str], columns: Sequence[Panel], left: float = 0.075
) -> tuple[Figure, Any]:
    """Means over demand: a row of panels for each of `FAMILIES`, so that lines can be told apart.

    Besides its family, a row has the series that are in none, DIM, and all others pale behind.
    Returns the figure and its panels, shape (rows, columns), which share their scales.
    """
    high = HEAD + len(FAMILIES) * (ROW + GAP) - GAP + FOOT
    figure = style.new_figure(WIDTH, high)
    figure.subplots_adjust(
        left=left, right=RIGHT, top=1.0 - HEAD / high, bottom=FOOT / high, wspace=0.06,
        hspace=GAP / ROW,
    )  # fmt: skip
    grid = figure.subplots(len(FAMILIES), len(columns), sharex=True, sharey=True, squeeze=False)
    alone = set(series).difference(*FAMILIES.values())
    for k, (panels, (needs, names)) in enumerate(zip(grid, FAMILIES.items(), strict=True)):
        shown = [it for it in series if it in alone or it == REFERENCE or it in names]
        for axes, column in zip(panels, columns, strict=True):
            plots.draw_means(axes, column.rows, column.metric, shown, series)
            style.plot_axes(axes, "" if k else column.title, "", "")
        looks = [*map(style.look, shown), plots.OTHERS]
        top = panels[0].get_position().y1
        style.write(figure, LEGEND, top, needs.capitalize(), 9.5, bold=True)
        plots.legend(
            figure, [*map(plots.key, looks)], [look.label for look in looks], top - 0.14 / high, 1,
            bbox_to_anchor=(LEGEND, top - 0.14 / high), fontsize=9,
        )  # fmt: skip
    for axes in grid[-1]:
        axes.set_xlabel(plots.DENSITY_LABEL, **style.LABEL)
    return figure, grid
