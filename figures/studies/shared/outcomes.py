"""How misread intents end: panels of collisions, false grants and delay."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from matplotlib.axes import Axes

from figures import plots, style
from scenarios.studies.shared.delay import TOTAL_DELAY
from scenarios.studies.shared.intent_errors import CROSSINGS, rate_of

if TYPE_CHECKING:
    import pandas as pd

#: Kind of error -> words and look.
KIND_LOOKS: Mapping[str, style.Look] = MappingProxyType({
    "missed": style.Look("missed signals", style.BLUE, "o", "-"),
    "symmetric": style.Look("symmetric errors", style.VERMILLION, "s", "--"),
})  # fmt: skip

NOTE = (
    "Intervals 95 %: of counts Poisson's (Garwood), of delays Student's over seeds. Delay: time "
    "loss and departure delay."
)


def _rate(rows: pd.DataFrame, column: str) -> plots.Estimate | None:
    rate = rate_of(rows, column)
    return plots.Estimate(*rate[:3]) if rate else None


def _delay(rows: pd.DataFrame) -> plots.Estimate | None:
    return plots.mean_estimate(rows[TOTAL_DELAY])


#: Title of a panel -> what it shows.
OUTCOMES: Mapping[str, Callable[[pd.DataFrame], plots.Estimate | None]] = MappingProxyType(
    {
        "Collisions": partial(_rate, column="collisions"),
        "False grants": partial(_rate, column="false_grants"),
        "Mean delay": _delay,
    }
)


def select(rows: pd.DataFrame, **wanted: object) -> pd.DataFrame:
    """The rows with these values."""
    for key, value in wanted.items():
        rows = rows[rows[key] == value]
    return rows


def draw(
    axes: Axes, places: Iterable[float], cells: Iterable[pd.DataFrame], outcome: str,
    look: style.Look,
) -> None:  # fmt: skip
    """One of `OUTCOMES` over cells of runs; a cell without any is left out."""
    drawn = [
        (x, estimate)
        for x, cell in zip(places, cells, strict=True)
        if not cell.empty and (estimate := OUTCOMES[outcome](cell)) is not None
    ]
    if drawn:
        plots.draw_line(axes, [x for x, _ in drawn], [estimate for _, estimate in drawn], look)


def dress(axes: Axes, outcome: str, title: str, xlabel: str, ticks: Sequence[str]) -> None:
    """Frame and scales of a panel of `OUTCOMES`."""
    counted = outcome != "Mean delay"
    style.plot_axes(axes, title, xlabel, "")
    if counted:
        plots.log_time(axes, 0.0, 10_000.0, linear=1.0)
    else:
        plots.log_time(axes, 1.0, 4000.0)
    axes.set_xticks(range(len(ticks)), ticks)
    words = {"Collisions": f"in {CROSSINGS:,} crossings", "Mean delay": "of all vehicles [s]"}
    axes.set_ylabel(words.get(outcome, ""), fontsize=9.0, color=style.INK)
