"""Means over demand with intervals, and the paper's values beside them."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from figures import style
from scenarios.statistics import mean_interval
from scenarios.sweep.cells import saturated

if TYPE_CHECKING:
    import pandas as pd

#: Series are drawn side by side, so that their bars do not cover each other, over this share of
#: the range, and at least so much apart.
DODGE = 0.028
APART = 0.0075
DENSITY_LABEL = "demand [veh/h/lane]"
#: Of small print [pt].
FOOTNOTE_SIZE = 7.5


def draw_means(axes: Axes, rows: pd.DataFrame, metric: str, series: Sequence[str]) -> None:
    """One line a series: mean over seeds, 95 % interval, an arrow where the queue still grows.

    Args:
        axes: to draw on.
        rows: of a study (`scenarios.studies.results.Results.good`).
        metric: a column.
        series: in the order of the legend; one without rows is left out.
    """
    if rows.empty:
        axes.text(
            0.5, 0.94, "not run", transform=axes.transAxes, ha="center", va="top", fontsize=11,
            color=style.MUTED,
        )  # fmt: skip
        return
    for place, name in enumerate(series):
        found = rows[(rows["series"] == name) & rows[metric].notna()]
        if found.empty:
            continue
        look = style.look(name)
        points = [
            (float(str(density)), mean_interval(cell[metric].astype(float).tolist()),
             saturated(cell))
            for density, cell in found.groupby("density")
        ]  # fmt: skip
        shift = offset(rows, place, len(series))
        x = [density + shift for density, _, _ in points]
        y = [interval.mean for _, interval, _ in points]
        half = [interval.half_width if interval.size > 1 else 0.0 for _, interval, _ in points]
        axes.errorbar(
            x, y, yerr=half, color=look.colour, marker=look.marker, linestyle=look.dashes,
            linewidth=1.7, markersize=5.0, capsize=2.6, elinewidth=1.1, zorder=3, label=look.label,
        )  # fmt: skip
        for a, b, bar, (_, _, grown) in zip(x, y, half, points, strict=True):
            if grown:
                growth_arrow(axes, a, b + bar, look.colour)


def growth_arrow(axes: Axes, x: float, y: float, colour: str) -> None:
    """An arrow up from above a marker or the end of its bar: the queue was still growing there."""
    axes.annotate(
        "", (x, y), xytext=(0, 16), textcoords="offset points", zorder=4,
        arrowprops={"arrowstyle": "<-", "color": colour, "linewidth": 1.1, "shrinkA": 0,
                    "shrinkB": 5.5},
    )  # fmt: skip


def draw_published(
    axes: Axes, table: pd.DataFrame, rows: pd.DataFrame, series: Sequence[str]
) -> None:
    """The paper's values as hollow markers; those that are not comparable are crossed out.

    Args:
        axes: to draw on.
        table: columns `series`, `density`, `paper`, `comparable`.
        rows: ours, for the same sideways shift.
        series: in the order of the legend.
    """
    for place, name in enumerate(series):
        look = style.look(name)
        chosen = table[table["series"] == name]
        x = chosen["density"].astype(float) + offset(rows, place, len(series))
        axes.plot(
            x, chosen["paper"], marker=look.marker, markersize=8.0, markeredgewidth=1.2,
            markeredgecolor=look.colour, markerfacecolor="none", linestyle="none", zorder=5,
        )  # fmt: skip
        crossed = (chosen["comparable"] != "yes").to_numpy()
        axes.plot(
            x[crossed], chosen["paper"][crossed], marker="x", markersize=7.0,
            markeredgewidth=1.2, color=look.colour, linestyle="none", zorder=6,
        )  # fmt: skip


def offset(rows: pd.DataFrame, place: int, count: int) -> float:
    """Sideways shift of a series [veh/h/lane]."""
    if rows.empty or count < 2:
        return 0.0
    span = float(rows["density"].max() - rows["density"].min())
    return max(DODGE, APART * (count - 1)) * span * (place / (count - 1) - 0.5)


def density_axis(axes: Axes, densities: Iterable[float]) -> None:
    """The demands that were run as ticks, six at most, with a margin around them."""
    shown = sorted(set(densities))
    step = math.ceil(len(shown) / 6)
    axes.set_xticks(shown[(len(shown) - 1) % step :: step], minor=False)
    margin = 0.05 * (shown[-1] - shown[0]) or 14.0
    axes.set_xlim(shown[0] - margin, shown[-1] + margin)


def log_time(axes: Axes, low: float, high: float, *, linear: float | None = None) -> None:
    """A logarithmic time axis from `low` to `high` [s] with plain numbers.

    Args:
        axes: to scale.
        low, high: its ends; with `linear`, `low` may be 0.
        linear: below it the axis is linear, so that 0 can be shown.
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
    # A marker on 0 is whole, and so is one on the lowest value.
    axes.set_ylim(low if linear is None else low - 0.25 * linear, high)


def scale_words(linear: float | None) -> str:
    """What to say of an axis of `log_time` beside its label."""
    return "logarithmic" if linear is None else f"log., linear below {linear:g}"


def series_legend(
    figure: Figure, series: Iterable[str], left: float, top: float, ncols: int | None = None
) -> None:
    """A legend of lines and markers by series."""
    looks = [style.look(name) for name in series]
    handles = [
        Line2D([], [], color=k.colour, marker=k.marker, linestyle=k.dashes, linewidth=1.7,
               markersize=5.5)
        for k in looks
    ]  # fmt: skip
    _legend(figure, handles, [k.label for k in looks], left, top, ncols=ncols)


def marks_legend(figure: Figure, left: float, top: float, *, paper: bool) -> None:
    """A legend of what markers mean, whatever the series."""
    handles: list[Any] = [Line2D([], [], color=style.MUTED, marker="o", markersize=5.0)]
    labels = ["ours, mean and 95 % interval"]
    if paper:
        hollow = _mark("o", 8.0, markerfacecolor="none")
        handles += [hollow, (hollow, _mark("x", 7.0))]
        labels += ["the paper's value", "not the run that its label says"]
    handles.append(_mark(r"$\uparrow$", 8.0))
    labels.append("queue still growing at the end")
    _legend(figure, handles, labels, left, top, fontsize=8.5)


def _mark(marker: str, size: float, **look: Any) -> Line2D:
    return Line2D(
        [], [], color=style.MUTED, marker=marker, linestyle="none", markersize=size, **look
    )


def _legend(
    figure: Figure,
    handles: Sequence[Any],
    labels: Sequence[str],
    left: float,
    top: float,
    *,
    fontsize: float = 9.5,
    ncols: int | None = None,
) -> None:
    figure.legend(
        handles, labels, loc="upper left", bbox_to_anchor=(left, top), frameon=False,
        fontsize=fontsize, handlelength=2.4, labelcolor=style.INK, borderaxespad=0.0,
        handletextpad=0.6, handler_map={tuple: HandlerTuple(ndivide=1)}, columnspacing=1.7,
        ncols=len(labels) if ncols is None else ncols,
    )  # fmt: skip


def footnote(figure: Figure, text: str) -> None:
    """Small print along the lower edge, in as many lines as it takes."""
    # Sans serif is half as wide as high, in points of which there are 72 an inch; with a margin.
    columns = int(figure.get_figwidth() * 72.0 / (0.54 * FOOTNOTE_SIZE))
    figure.text(
        0.012, 0.008, textwrap.fill(text, columns), fontsize=FOOTNOTE_SIZE, color=style.MUTED,
        va="bottom", linespacing=1.05,
    )  # fmt: skip
