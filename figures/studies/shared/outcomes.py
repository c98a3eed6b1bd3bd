"""Outcomes of misread intents: panels of collisions, false grants and delay."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pandas as pd
from matplotlib.axes import Axes

from figures import plots, style
from scenarios.studies.shared.intent_errors import CROSSINGS, rate_of
from scenarios.studies.shared.study import TOTAL_DELAY

#: Kind of error -> words and look.
KIND_LOOKS = {
    "missed": style.Look("missed signals", style.BLUE, "o", "-"),
    "symmetric": style.Look("symmetric errors", style.VERMILLION, "s", "--"),
}
#: Panel title -> column, and what its axis counts.
OUTCOMES = {
    "Collisions": ("collisions", f"in {CROSSINGS:,} crossings"),
    "False grants": ("false_grants", f"in {CROSSINGS:,} crossings"),
    "Mean delay": (TOTAL_DELAY, "of all vehicles [s]"),
}
#: Small print.
NOTE = (
    "95 % intervals: Poisson's (Garwood) for counts, Student's over seeds for delays. Delay: time "
    "loss and departure delay."
)


def estimated(rows: pd.DataFrame, outcome: str) -> plots.Estimate | None:
    """One of `OUTCOMES` over all runs together; None if there is nothing to estimate it from."""
    if rows.empty:
        return None
    column, _ = OUTCOMES[outcome]
    if column == TOTAL_DELAY:
        return plots.mean_estimate(rows[column])
    rate = rate_of(rows, column)
    return rate and plots.Estimate(*rate[:3])


def select(rows: pd.DataFrame, **wanted: object) -> pd.DataFrame:
    """The rows with these values."""
    for key, value in wanted.items():
        rows = rows[rows[key] == value]
    return rows


def draw(
    axes: Axes, places: Iterable[float], cells: Iterable[pd.DataFrame], outcome: str,
    look: style.Look,
) -> None:  # fmt: skip
    """Draw one of `OUTCOMES` for each cell of runs; cells without it are left out."""
    known = {
        x: estimate
        for x, cell in zip(places, cells, strict=True)
        if (estimate := estimated(cell, outcome)) is not None
    }
    if known:
        plots.draw_line(axes, [*known], [*known.values()], look)


def dress(axes: Axes, outcome: str, title: str, xlabel: str, ticks: Sequence[str]) -> None:
    """Set the frame and scales of a panel of `OUTCOMES`."""
    column, words = OUTCOMES[outcome]
    style.plot_axes(axes, title, xlabel, "")
    if column == TOTAL_DELAY:
        plots.log_time(axes, 1.0, 4000.0)
    else:
        plots.log_time(axes, 0.0, 10_000.0, linear=1.0)
    axes.set_xticks(range(len(ticks)), ticks)
    axes.set_ylabel(words, fontsize=9.0, color=style.INK)
