"""The figures of a benchmark: how good each controller is, where, and by which measure."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from minisim.errors import plural
from scenarios.benchmark.definition import SCHEDULE
from scenarios.benchmark.ranking import (
    LEAST,
    by_cell,
    overall,
    scores,
)
from scenarios.benchmark.results import Result
from scenarios.optimum import ABOVE
from scenarios.statistics import Interval, mean_interval

#: Measures at a glance: column -> heading. For all of them, less is better.
GLANCE = {
    "delay_s": "delay\n[s]", "delay_s_p95": "delay,\n95 % [s]", "worst_lane_s": "worst\nlane [s]",
    "order_reversals": "order\nreversals", "stops": "stops", "queue_max": "longest\nqueue",
    "fuel_g": "fuel\n[g]", "jerk_mps3": "jerk\n[m/s³]", "hard_brakings": "hard\nbrakings",
    "messages": "messages\nper trip", "median_decision_us": "decision\n[µs]",
}  # fmt: skip

#: Per trip, though measured for a run.
PER_TRIP = ("messages", "message_bytes")

#: Percent above the least delay that have the palest and the darkest colour.
PALE, DARK = 10.0, 3000.0

#: Colours of the heat maps: from light to dark, and readable in grey.
SCALE = "YlGnBu"

#: Measures that differ by less are no better or worse: relative to the larger one.
ALIKE = 0.005


def names(result: Result) -> list[str]:
    """All controllers, the best first; those without an overall rank, and the schedule, last."""
    standings = overall(result.rows, result.plain)
    left = [name for name in result.head["controllers"] if name not in standings]
    return [*standings, *left, SCHEDULE]


def overall_figure(result: Result) -> Figure:
    """How many times the least delay each controller has, over all plain cells, and its rank."""
    standings = overall(result.rows, result.plain)
    lines = {name: (it.mean, it.words) for name, it in standings.items()}
    if known := scores(result.rows, result.plain).get(SCHEDULE):
        lines[SCHEDULE] = mean_interval(known.values()), "no rival"
    left, high = _margin(lines), 1.9 + 0.3 * len(lines)
    width = left + 6.6
    figure = style.new_figure(width, high)
    axes = figure.add_axes((left / width, 0.9 / high, 5.4 / width, 1.0 - 1.55 / high))
    for place, (name, (mean, words)) in enumerate(lines.items()):
        look = style.look(name)
        low, value, top = times(mean)
        axes.errorbar(value, place, xerr=[[value - low], [top - value]], color=look.colour,
                      marker=look.marker, markersize=6.5, capsize=2.6, elinewidth=1.2)  # fmt: skip
        axes.annotate(words, (1.02, place), xycoords=("axes fraction", "data"), va="center",
                      fontsize=9.0, color=style.INK)  # fmt: skip
    style.plot_axes(axes, "", "times the least delay that is possible, logarithmic", "")
    _times_axis(axes)
    axes.set_yticks(range(len(lines)), list(map(label, lines)))
    axes.set_ylim(len(lines) - 0.5, -0.5)
    style.write(figure, (left + 5.5) / width, 1.0 - 0.5 / high, "rank", 9.5, bold=True)
    note = (
        f"{_extent(result)}  Geometric mean over {plural(len(result.plain), 'cell')} without "
        "errors, lost messages and humans; 95 % intervals over seeds. In brackets the ranks that "
        "are possible, with 95 % confidence for all together."
    )
    _framed(figure, titled(result, "overall"), note)
    return figure


def _times_axis(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_xlim(1.0, max(axes.get_xlim()[1], 2.0))
    ticks = [1, 1.5, 2, 3, 5, 7, 10, 15, 20, 30, 50, 100]
    axes.set_xticks([t for t in ticks if t <= axes.get_xlim()[1]], minor=False)
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.grid(axis="x", color=style.FAINT, linewidth=0.8)
    axes.grid(axis="y", visible=False)


def cells_figure(result: Result) -> Figure:
    """Percent above the least delay: controllers by cells."""
    order, cells = names(result), list(result.head["cells"])
    known = by_cell(result.rows, ABOVE.name)
    least = {str(cell): _mean(rows[LEAST]) for cell, rows in result.rows.groupby("cell")}
    values = np.full((len(order), len(cells)), np.nan)
    for i, name in enumerate(order):
        for j, cell in enumerate(cells):
            if above := known.get(cell, {}).get(name):
                values[i, j] = np.mean([*above.values()])
    heads = [
        f"{_wrapped(cell)}\n({least[cell]:.1f} s)" if least[cell] > 0.0 else _wrapped(cell)
        for cell in cells
    ]
    shades = np.log(np.maximum(values, PALE) / PALE) / math.log(DARK / PALE)
    note = (
        f"{_extent(result)}  In brackets the least mean delay that is possible.  ×: collided, "
        "refused or left vehicles behind; the report says which."
    )
    title = titled(result, "mean delay above the least possible [%]")
    return _heat(order, heads, values, shades, title, note)


def measures_figure(result: Result) -> Figure:
    """Some measures by controller: means over the plain cells, coloured by their order."""
    order = [name for name in names(result) if name in scores(result.rows, result.plain)]
    plain = per_trip(result.rows[result.rows["cell"].isin(result.plain)])
    columns = [column for column in GLANCE if column in plain]
    values = np.array([
        [_mean(plain[plain["controller"] == name][column]) for column in columns] for name in order
    ]).reshape(len(order), len(columns))  # fmt: skip
    better = (values[None] < values[:, None] * (1.0 - ALIKE)).sum(axis=1)
    note = (
        f"{_extent(result)}  Means over {plural(len(result.plain), 'cell')} without errors and "
        "humans. The paler, the fewer controllers are better. cells.csv has all measures of all "
        "cells, with intervals."
    )
    heads = [GLANCE[column] for column in columns]
    shades = better / max(len(order) - 1, 1)
    return _heat(order, heads, values, shades, titled(result, "measures"), note)


def _heat(
    order: Sequence[str], heads: Sequence[str], values: Any, shades: Any, title: str, note: str
) -> Figure:
    """Numbers in cells, from pale (shade 0) to dark (1); grey for none."""
    left, high = _margin(order), 1.95 + 0.29 * len(order)
    width = left + 0.2 + 0.78 * len(heads)
    figure = style.new_figure(width, high)
    axes = figure.add_axes((left / width, 0.5 / high, 0.78 * len(heads) / width, 1 - 1.65 / high))
    axes.set_facecolor(style.FAINT)
    axes.imshow(np.ma.masked_invalid(shades), cmap=SCALE, vmin=0.0, vmax=1.0, aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        axes.text(j, i, _shown(value), ha="center", va="center", fontsize=8.5,
                  color=style.PAPER if shades[i, j] > 0.5 else style.INK)  # fmt: skip
    axes.set_xticks(range(len(heads)), heads, fontsize=8.0)
    axes.xaxis.tick_top()
    axes.set_yticks(range(len(order)), [label(name) for name in order], fontsize=9.0)
    axes.set_xticks(np.arange(len(heads) - 1) + 0.5, minor=True)
    axes.set_yticks(np.arange(len(order) - 1) + 0.5, minor=True)
    axes.tick_params(which="both", length=0, labelcolor=style.INK)
    axes.spines[:].set_visible(False)
    axes.grid(which="minor", color=style.PAPER, linewidth=1.5)
    _framed(figure, title, note)
    return figure


def _framed(figure: Figure, title: str, note: str) -> None:
    plots.frame(figure, "", (), note)
    top = 1.0 - 0.22 / figure.get_figheight()
    style.write(figure, plots.LEFT, top, title, 13, bold=True)


def times(mean: Interval) -> tuple[float, float, float]:
    """Low end, value and high end of an interval of logarithms."""
    half = 0.0 if math.isnan(mean.half_width) else mean.half_width
    low, value, high = (math.exp(mean.mean + sign * half) for sign in (-1.0, 0.0, 1.0))
    return low, value, high


def _wrapped(text: str) -> str:
    return textwrap.fill(text, 11)


def _shown(value: float) -> str:
    if math.isnan(value):
        return "×"
    if 0.0 < value < 0.095:
        return f"{value:.1g}" if value >= 0.001 else "0"
    return f"{value:.2g}" if value < 10.0 else f"{value:.0f}"


def per_trip(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows in which measures of exchange are per trip."""
    trips = pd.to_numeric(rows["trips"], errors="coerce") if "trips" in rows else math.nan
    there = [column for column in PER_TRIP if column in rows]
    return rows.assign(**{
        column: pd.to_numeric(rows[column], errors="coerce") / trips for column in there
    })  # fmt: skip


def _mean(values: pd.Series[Any]) -> float:
    return float(pd.to_numeric(values, errors="coerce").mean())


def label(name: str) -> str:
    """What figures and tables call a controller."""
    return style.look(name).label


def _margin(order: Iterable[str]) -> float:
    """Room for the labels [in]."""
    return 0.4 + 0.072 * max(map(len, map(label, order)), default=0)


def titled(result: Result, what: str) -> str:
    """A heading with the benchmark's name and version."""
    head = result.head
    return f"Benchmark {head['benchmark']} {head['benchmark_version']}: {what}"


def _extent(result: Result) -> str:
    warning = "A smoke test: its numbers mean nothing.  " if result.head["quick"] else ""
    return f"{warning}{plural(len(result.head['seeds']), 'seed')}."
