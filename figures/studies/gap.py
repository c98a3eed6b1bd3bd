"""What the delay of DIM consists of."""

from __future__ import annotations

from itertools import product

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from figures import plots, style
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.controllers import label_of
from scenarios.statistics import mean_interval
from scenarios.studies.gap import ORDER, PARTS, delays, seconds
from scenarios.studies.optimum import DENSITIES
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results

#: Every cause -> its colour and hatching; the paper's gate has them all.
LOOKS = dict(
    zip(
        (part.label for part in PARTS["dim"]),
        (
            (style.INK, ""), (style.SKY, ""), (style.PURPLE, "///"), (style.MUTED, "..."),
            (style.ORANGE, ""), (style.BLUE, "///"), (style.GREEN, "..."),
            (style.VERMILLION, "xxx"), (style.FAINT, ""),
        ),
        strict=True,
    )
)  # fmt: skip

NOTE = (
    "The parts of a bar add up to the delay of its controller (diamond), negative ones to the "
    "left of 0.  Vehicles come for half of that time, and every one counts."
)


def gap_figure(results: Results) -> Figure:
    """The delay of each controller in parts: a row per junction, the three highest demands."""
    table = delays(results.good)
    shown = sorted(table.index.unique("density"))[-3:] or DENSITIES[-3:]
    figure, panels = plots.panels(
        11.0, 6.6, 3 * len(shown), rows=3, left=0.17, right=0.985, top=0.795, bottom=0.105,
        wspace=0.1, hspace=0.46,
    )  # fmt: skip
    for axes, (arms, density) in zip(panels, product((3, 4, 5), shown), strict=True):
        _draw(axes, table.query("arms == @arms and density == @density"))
        style.plot_axes(axes, f"{arms} arms, {density:g} veh/h/lane", "", "")
        axes.grid(axis="x", color=style.FAINT, linewidth=0.8)
        axes.grid(axis="y", visible=False)
    for axes in panels[-len(shown) :]:
        axes.set_xlabel("mean delay [s]", **style.LABEL)
    title = "What the delay consists of, profile fair"
    plots.frame(figure, title, (), f"{missing_note(results)}  {NOTE}")
    handles = [
        Patch(facecolor=colour, hatch=hatch, edgecolor=style.PAPER, linewidth=0.0)
        for colour, hatch in LOOKS.values()
    ]
    plots.legend(figure, handles, list(LOOKS), 0.94, 4, fontsize=8.5)
    return figure


def _draw(axes: Axes, table: pd.DataFrame) -> None:
    for place, parts in enumerate(PARTS.values()):
        ends = {True: 0.0, False: 0.0}
        for part in parts:
            value = float(seconds(part, table).mean()) if len(table) else 0.0
            colour, hatch = LOOKS[part.label]
            axes.barh(
                place, value, left=ends[value > 0.0], height=0.72, color=colour, hatch=hatch,
                edgecolor=style.PAPER, linewidth=0.0,
            )  # fmt: skip
            ends[value > 0.0] += value
        axes.plot(sum(ends.values()), place, "D", color=style.PAPER, markeredgecolor=style.INK,
                  markersize=4.5, zorder=4)  # fmt: skip
    axes.axvline(0.0, color=style.MUTED, linewidth=0.8)
    axes.set_yticks(range(len(PARTS)), [label_of(name) for name in PARTS])
    axes.set_ylim(len(PARTS) - 0.5, -0.5)
    low, high = axes.get_xlim()
    axes.set_xticks([tick for tick in axes.get_xticks() if low <= tick <= high])


def gap_table(results: Results) -> Table:
    """The same in numbers: each cause, and the controllers that they add up to."""
    table, rows = delays(results.good), []
    for arms in (3, 4, 5):
        causes = {
            (part.label, label_of(name) if part.label == ORDER else ""):
            seconds(part, table)
            for name, parts in PARTS.items() for part in parts
        }  # fmt: skip
        totals = {("in sum", label_of(name)): table[name] for name in PARTS}
        for (cause, controller), values in {**causes, **totals}.items():
            rows.append((f"{arms}", cause, controller, *_cells(values, arms)))
    return Table(
        "What the delay consists of [s], with 95 % intervals, paired by seed",
        ("arms", "cause", "under", *(f"{density:g} veh/h/lane" for density in DENSITIES)),
        tuple(rows), labels=3,
        notes=(f"{missing_note(results)}  Vehicles come for half of that time.",),
    )  # fmt: skip


def _cells(values: pd.Series[float], arms: int) -> list[str]:
    cells = []
    for density in DENSITIES:
        chosen = values.loc[[it for it in values.index if it[:2] == (arms, density)]]
        it = mean_interval(chosen.tolist()) if len(chosen) else None
        cells.append("–" if it is None else f"{it.mean:.2f} ± {it.half_width:.2f}")
    return cells


SECTION = Section(
    "What DIM leaves on the table",
    (
        Item("gap", "the delay in parts that add up", gap_figure, ("gap",)),
        Item("gap-table", "the same in numbers", gap_table, ("gap",)),
    ),
)
