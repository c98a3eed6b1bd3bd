"""Delay over the loss and the latency of messages, beside DIM, which sends none."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.studies.fair import GATES
from scenarios.studies.messages import AXES, DENSITIES, TALKING, wins
from scenarios.studies.shared.archive import MissingRunsError, missing_note
from scenarios.studies.shared.study import TOTAL_DELAY, Results, with_total_delay

if TYPE_CHECKING:
    import pandas as pd


def message_figure(results: Results) -> Figure:
    """Mean delay over loss and latency: a row for each demand."""
    rows = with_total_delay(results.good)
    run = [density for density in DENSITIES if (rows["density"] == density).any()]
    figure, panels = plots.panels(
        10.5, 1.9 + 3.1 * len(run), 2 * len(run), rows=len(run), left=0.065, right=0.985, top=0.80,
        bottom=0.12, wspace=0.06, hspace=0.34,
    )  # fmt: skip
    for axes, (density, what) in zip(panels, product(run, AXES), strict=True):
        _draw(axes, rows[rows["density"] == density], what)
        style.plot_axes(axes, f"{density:g} veh/h/lane", what, "")
        plots.log_time(axes, 1.0, 500.0)
    for axes in panels[::2]:
        axes.set_ylabel("mean delay [s], logarithmic", **style.LABEL)
    note = (
        f"{missing_note(results)}  Delay is time loss and departure delay of all vehicles, up to "
        "the end of the run for those still there. Left no message is late, right none is lost."
    )
    looks = [*map(style.look, TALKING)]
    looks += [style.look(name)._replace(marker="") for name in GATES]
    title = "Messages that get lost or come late, on four arms, profile fair"
    plots.frame(figure, title, looks, note, ncols=4, marks=0.866)
    return figure


def _draw(axes: Axes, rows: pd.DataFrame, what: str) -> None:
    """The rivals over one kind of fault; DIM, which has none, as a line with its interval."""
    column, values, unit = AXES[what]
    axes.set_xticks([0.0, *(unit * value for value in values[2:])])
    other = "latency" if column == "loss" else "loss"
    for name in TALKING:
        known = rows[(rows["series"] == name) & (rows[other] == 0.0)]
        if not known.empty:
            plots.draw_over(axes, known, column, TOTAL_DELAY, style.look(name), unit, 0.0)
    for name in GATES:
        known, look = rows[rows["series"] == name], style.look(name)
        if not known.empty:
            level = plots.mean_estimate(known[TOTAL_DELAY])
            axes.axhspan(level.low, level.high, color=look.colour, alpha=0.2, linewidth=0.0)
            axes.axhline(level.value, color=look.colour, linestyle=look.dashes, linewidth=1.4)


def win_table(results: Results) -> Table:
    """The loss and the latency from which DIM has less delay than each rival."""
    known = {} if results.good.empty else wins(results.good)
    if not known:
        raise MissingRunsError(
            "the store has no two faults at which a rival and DIM ran with two common seeds; make "
            f"them with: {results.effort.command('messages')}"
        )
    rows = []
    for rival, gate, density in product(TALKING, GATES, DENSITIES):
        cells = [known.get((what, gate, rival, density)) for what in AXES]
        if any(cells):
            texts = [text for it in cells for text in ((it.point, it.interval) if it else "––")]
            rows.append((style.look(rival).label, style.look(gate).label, f"{density:g}", *texts))
    heads = [head for what in AXES for head in (what, "95 % interval")]
    return Table(
        "Loss and latency of messages from which DIM has less delay",
        ("than", "controller", "veh/h/lane", *heads), tuple(rows), labels=2,
        notes=(
            f"{missing_note(results)}  Four arms, profile fair. Time loss and "
            "departure delay of all vehicles; paired differences over common arrivals, linear "
            "between the faults tried. “all”: DIM has less even if no message fails; “never”: at "
            "none of the faults tried, on average.",
        ),
    )  # fmt: skip


SECTION = Section(
    "Messages that fail",
    (
        Item("messages", "delay over loss and latency of messages", message_figure, ("messages",)),
        Item("messages-table", "from which loss and latency DIM wins", win_table, ("messages",)),
    ),
)
