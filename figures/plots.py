"""Plots of means with intervals, their axes and legends, and the small print below them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from figures import style
from scenarios.paper import DENSITIES
from scenarios.statistics import mean_interval
from scenarios.sweep.cells import saturated

#: Series stand side by side, spread over this share of the smallest step between demands.
SPREAD = 0.12
#: Lines with few points are this far apart [veh/h/lane].
DODGE = 2.5
#: Series that a panel shows for comparison only.
OTHERS = style.Look("the others", "#BCC3CC", "", "-")
DENSITY_LABEL = "demand [veh/h/lane]"
#: Left edge of titles, legends and small print, as a share of the figure.
LEFT = 0.012
#: Size of the small print [pt].
FOOTNOTE_SIZE = 7.5


class Estimate(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


def mean_estimate(values: pd.Series[Any]) -> Estimate:
    """Mean and Student-t interval, cut at 0 if no value is negative; no width for one value."""
    mean, half, size = mean_interval(values.astype(float).tolist())
    half = half if size > 1 else 0.0
    low = mean - half
    return Estimate(mean, low if values.min() < 0.0 else max(low, 0.0), mean + half)


def draw_line(
    axes: Axes, x: Sequence[float], estimates: Sequence[Estimate], look: style.Look,
    growing: Iterable[bool] = (), **changes: Any,
) -> None:  # fmt: skip
    """A line with intervals, and arrows at points whose queue was still growing.

    `changes` are keyword arguments of `Axes.errorbar`.
    """
    bars = [[e.value - e.low for e in estimates], [e.high - e.value for e in estimates]]
    drawn: dict[str, Any] = {
        "color": look.colour, "marker": look.marker, "linestyle": look.dashes, "linewidth": 1.7,
        "markersize": 5.0, "capsize": 2.6, "elinewidth": 1.1, "zorder": 3, "label": look.label,
    }  # fmt: skip
    axes.errorbar(x, [e.value for e in estimates], yerr=bars, **(drawn | changes))
    arrow = {"arrowstyle": "<-", "color": look.colour, "linewidth": 1.1, "shrinkA": 0}
    for place, estimate, grown in zip(x, estimates, growing, strict=False):
        if grown:
            axes.annotate("", (place, estimate.high), xytext=(0, 16), textcoords="offset points",
                          zorder=4, arrowprops=arrow | {"shrinkB": 5.5})  # fmt: skip


def draw_side_by_side(
    axes: Axes, lines: Iterable[tuple[style.Look, Mapping[float, Estimate]]], title: str
) -> None:
    """Means [s] over a few densities [veh/h/lane], one line per look, in a frame of their own."""
    drawn = list(lines)
    for k, (look, points) in enumerate(drawn):
        aside = DODGE * (k - (len(drawn) - 1) / 2.0)
        places = [density + aside for density in points]
        draw_line(axes, places, [*points.values()], look, markersize=5.5, capsize=3.5)
    axes.set_xticks(sorted({density for _, points in drawn for density in points}))
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.08)
    style.plot_axes(axes, title, "density [veh/h/lane]", "mean [s]")


def draw_means(
    axes: Axes, rows: pd.DataFrame, metric: str, series: Sequence[str],
    others: Collection[str] = (),
) -> None:  # fmt: skip
    """One line per series over demand: mean over seeds, interval, arrows at growing queues.

    `rows` come from a study (`Results.good`); a series without rows is left out. The means of
    `others` are pale lines behind them.
    """
    if rows.empty:
        axes.text(0.5, 0.94, "not run", transform=axes.transAxes, ha="center", va="top",
                  fontsize=11, color=style.MUTED)  # fmt: skip
        return
    known = rows[rows[metric].notna()]
    behind = known[known["series"].isin([*others]) & ~known["series"].isin(series)]
    for _, line in behind.groupby("series"):
        means = line.groupby("density")[metric].mean()
        axes.plot(means.index, means, OTHERS.dashes, color=OTHERS.colour, linewidth=1.0, zorder=1)
    for place, name in enumerate(series):
        mine = known[known["series"] == name]
        if not mine.empty:
            shift = offset(rows, place, len(series))
            draw_over(axes, mine, "density", metric, style.look(name), 1.0, shift)


def draw_over(
    axes: Axes, rows: pd.DataFrame, by: str, metric: str, look: style.Look,
    scale: float, shift: float,
) -> None:  # fmt: skip
    """One line over the values of a column, scaled and shifted."""
    cells = list(rows.groupby(by))
    draw_line(
        axes, [scale * float(str(value)) + shift for value, _ in cells],
        [mean_estimate(cell[metric]) for _, cell in cells], look,
        [saturated(cell) for _, cell in cells],
    )  # fmt: skip


def draw_published(
    axes: Axes, table: pd.DataFrame, rows: pd.DataFrame, series: Sequence[str]
) -> None:
    """The paper's values as hollow markers; those that are not comparable are crossed out.

    The table has columns `series`, `density`, `paper`, `comparable`; our `rows` give the shift.
    """
    for place, name in enumerate(series):
        look = style.look(name)
        chosen = table[table["series"] == name]
        x = chosen["density"].astype(float) + offset(rows, place, len(series))
        drawn: dict[str, Any] = {
            "color": look.colour, "markeredgewidth": 1.2, "linestyle": "none", "zorder": 5
        }  # fmt: skip
        axes.plot(
            x, chosen["paper"], marker=look.marker, markersize=8.0, markerfacecolor="none", **drawn
        )
        crossed = (chosen["comparable"] != "yes").to_numpy()
        axes.plot(x[crossed], chosen["paper"][crossed], "x", markersize=7.0, **drawn)


def offset(rows: pd.DataFrame, place: int, count: int) -> float:
    """Sideways shift of a series [veh/h/lane]."""
    demands = np.unique(rows["density"])
    if len(demands) < 2 or count < 2:
        return 0.0
    # Within the axes also if there are few demands: see the margin in `density_axis`.
    step = min(float(np.diff(demands).min()), float(np.ptp(demands)) / 4.0)
    return SPREAD * step * (place / (count - 1) - 0.5)


def density_axis(axes: Axes, densities: Iterable[float] = DENSITIES) -> None:
    """Ticks at these demands (by default the paper's), six at most, with a margin around them."""
    shown = sorted(set(densities))
    step = math.ceil(len(shown) / 6)
    axes.set_xticks(shown[(len(shown) - 1) % step :: step], minor=False)
    margin = 0.06 * (shown[-1] - shown[0]) or 14.0
    axes.set_xlim(shown[0] - margin, shown[-1] + margin)


def log_time(axes: Axes, low: float, high: float, *, linear: float | None = None) -> None:
    """A logarithmic time axis from `low` to `high` [s] with plain numbers.

    Below `linear` the axis is linear, so that it can show 0.
    """
    if linear is None:
        axes.set_yscale("log")
    else:
        axes.set_yscale("symlog", linthresh=linear, linscale=0.35)
    ticks = [t for e in range(-2, 5) for t in (10.0**e, 2 * 10.0**e, 5 * 10.0**e)]
    decade = high / max(low, linear or low) > 60.0
    shown = [t for t in ticks if low <= t <= high and (not decade or f"{t:g}".strip("0.") == "1")]
    axes.set_yticks(([0.0] if low == 0.0 else []) + [t for t in shown if t >= (linear or 0.0)])
    axes.set_yticks([], minor=True)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    # Show all of a marker at 0 or at the lowest value.
    axes.set_ylim(low if linear is None else low - 0.25 * linear, high)


def scale_words(linear: float | None) -> str:
    """The scale of a `log_time` axis in words, for its label."""
    return "logarithmic" if linear is None else f"log., linear below {linear:g}"


def panels(
    width: float, height: float, count: int, *, rows: int = 1, sharey: bool = True, **edges: float
) -> tuple[Figure, list[Axes]]:
    """A figure sized in inches, with panels in rows; `edges` as in `Figure.subplots_adjust`."""
    figure = style.new_figure(width, height)
    drawn = figure.subplots(rows, count // rows, sharey=sharey, squeeze=False)
    figure.subplots_adjust(**edges)
    return figure, list(drawn.flat)


def frame(
    figure: Figure, title: str, looks: Iterable[style.Look], note: str, *,
    ncols: int | None = None, marks: float | None = None, paper: bool = False, lines: bool = True,
) -> None:  # fmt: skip
    """The title of a figure, the legend of its looks in `ncols` columns, and its small print.

    At the height `marks`, a second legend says what markers and arrows mean, those of the `paper`
    too. Without `lines`, the looks are markers only.
    """
    style.write(figure, LEFT, 0.965, title, 13, bold=True)
    shown = list(looks)
    if shown:
        legend(figure, [key(k, lines=lines) for k in shown], [k.label for k in shown], 0.93, ncols)
    if marks is not None:
        _marks_legend(figure, marks, paper=paper)
    # A letter is about 0.54 times its size in width; an inch has 72 points.
    columns = int(figure.get_figwidth() * 72.0 / (0.54 * FOOTNOTE_SIZE))
    figure.text(
        LEFT, 0.008, textwrap.fill(note, columns), fontsize=FOOTNOTE_SIZE, color=style.MUTED,
        va="bottom", linespacing=1.05,
    )  # fmt: skip


def key(look: style.Look, *, lines: bool = True) -> Line2D:
    """A look as legends show it; without `lines`, its marker only."""
    return Line2D(
        [], [], color=look.colour, marker=look.marker, linewidth=1.7, markersize=5.5,
        linestyle=look.dashes if lines else "none",
    )  # fmt: skip


def _marks_legend(figure: Figure, top: float, *, paper: bool) -> None:
    handles: list[Any] = [Line2D([], [], color=style.MUTED, marker="o", markersize=5.0)]
    labels = ["ours, mean and 95 % interval"]
    if paper:
        hollow = _mark("o", 8.0, markerfacecolor="none")
        handles += [hollow, (hollow, _mark("x", 7.0))]
        labels += ["the paper's value", "not the run named in its label"]
    handles.append(_mark(r"$\uparrow$", 8.0))
    labels.append("queue still growing at the end")
    legend(figure, handles, labels, top, fontsize=8.5)


def _mark(marker: str, size: float, **look: Any) -> Line2D:
    look |= {"color": style.MUTED, "linestyle": "none"}
    return Line2D([], [], marker=marker, markersize=size, **look)


def legend(
    figure: Figure, handles: Sequence[Any], labels: Sequence[str], top: float,
    ncols: int | None = None, **changes: Any,
) -> None:  # fmt: skip
    """A legend in the quiet style; `changes` are keyword arguments of `Figure.legend`."""
    drawn: dict[str, Any] = {
        "loc": "upper left", "bbox_to_anchor": (LEFT, top), "frameon": False, "fontsize": 9.5,
        "handlelength": 2.4, "labelcolor": style.INK, "borderaxespad": 0.0, "handletextpad": 0.6,
        "handler_map": {tuple: HandlerTuple(ndivide=1)}, "columnspacing": 1.7,
        "ncols": ncols or max(len(labels), 1),
    }  # fmt: skip
    figure.legend(handles, labels, **(drawn | changes))
