"""Every controller on equal terms, and the demands at which DIM does worse than another."""

from __future__ import annotations

import math
from itertools import chain, product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.families import Panel, panels_by_family
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.controllers import RIVALS
from scenarios.studies.fair import GATES, MEASURES, OTHERS, Crossing, needed_losses, tried
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results, with_total_delay


def fair_figure(results: Results) -> Figure:
    """Every controller with one vehicle and speed limit: three measures over demand."""
    rows = with_total_delay(results.good)
    figure, grid = panels_by_family(
        RIVALS, [Panel(name.capitalize(), rows, column) for name, column in MEASURES.items()]
    )
    for axes in grid.flat:
        plots.log_time(axes, 0.0, 4000.0, linear=0.1)
        plots.density_axis(axes, rows["density"])
    for axes in grid[:, 0]:
        axes.set_ylabel(f"mean of all vehicles [s],\n{plots.scale_words(0.1)}", **style.LABEL)
    note = (
        f"{missing_note(results)}  Waiting is standing on the road: it leaves out the queue "
        "before a full road, and V2I-C's vehicles crawl."
    )
    plots.frame(figure, "Every controller on four arms, profile fair", (), note, marks=0.95)
    return figure


def crossing_figure(results: Results) -> Figure:
    """The demands at which DIM does worse than each rival, with each of its gates."""
    known = needed_losses(results)
    figure, panels = plots.panels(
        11.0, 7.4, len(MEASURES), left=0.18, right=0.985, top=0.805, bottom=0.1, wspace=0.06
    )
    for axes, measure in zip(panels, MEASURES, strict=True):
        for place, rival in enumerate(OTHERS):
            for gate, aside in zip(GATES, (-0.26, 0.0, 0.26), strict=True):
                if (measure, gate, rival) in known:
                    _draw_crossing(axes, known[measure, gate, rival], gate, place + aside)
        style.plot_axes(axes, measure.capitalize(), plots.DENSITY_LABEL, "")
        axes.grid(axis="x", color=style.FAINT, linewidth=0.8)
        plots.density_axis(axes, results.good["density"])
    panels[0].set_yticks(range(len(OTHERS)), [style.look(name).label for name in OTHERS])
    panels[0].set_ylim(len(OTHERS) - 0.5, -0.5)
    title, looks = "Demands at which DIM does worse than …", map(style.look, GATES)
    plots.frame(figure, title, looks, missing_note(results))
    words = (
        "pale bar: demands at which DIM does worse     marker and line: where that begins, with "
        "its 95 % interval\nhollow marker: on average at all of these demands (on the left) or at "
        "none (on the right)"
    )
    style.write(figure, plots.LEFT, 0.872, words, 8.5)
    return figure


def loss_table(results: Results) -> Table:
    """The demand from which DIM does worse than each rival."""
    known = needed_losses(results)
    low, high = tried(known.values())
    rows = []
    for rival, measure in product(OTHERS, MEASURES):
        cells = [known.get((measure, gate, rival)) for gate in GATES]
        if any(cells):
            texts = ((cell.point, cell.interval) if cell else ("–", "–") for cell in cells)
            rows.append((style.look(rival).label, measure, *chain.from_iterable(texts)))
    return Table(
        "Demand from which DIM does worse [veh/h/lane]",
        ("than", "measure", *(t for g in GATES for t in (style.look(g).label, "95 % interval"))),
        tuple(rows), labels=2,
        notes=(
            f"{missing_note(results)}  "
            "Four arms, profile fair, complete means; paired differences over common arrivals, "
            f"linear between the demands tried, {low:g} to {high:g}. “a to b”: worse between a and "
            "b only: beyond both capacities their order may reverse. “all”: at every demand tried, "
            "on average; “c at the latest” then means that it is certain only from c on. “never”: "
            "at none, on average; “c at the earliest” means that it is possible from c on.",
        ),
    )  # fmt: skip


def _draw_crossing(axes: Axes, crossing: Crossing, gate: str, y: float) -> None:
    look = style.look(gate)
    ends = crossing.density, crossing.until, crossing.low, crossing.high
    start, end, least, most = np.clip(ends, *crossing.tried).tolist()
    if crossing.density < math.inf:
        axes.barh(y, end - start, left=start, height=0.2, color=look.colour, alpha=0.35, zorder=2)
    if math.isfinite(crossing.low) or math.isfinite(crossing.high):
        axes.plot([least, most], [y, y], color=look.colour, marker="|", markersize=8.0,
                  markeredgewidth=1.6, linewidth=1.6, zorder=3)  # fmt: skip
    known = math.isfinite(crossing.density)
    axes.plot([start], [y], marker=look.marker, color=look.colour, markersize=5.5, zorder=4,
              markerfacecolor=look.colour if known else style.PAPER)  # fmt: skip


SECTION = Section(
    "When does DIM lose?",
    (
        Item("fair", "every controller up to 800 veh/h/lane", fair_figure, ("fair",)),
        Item("losses", "demand from which DIM loses", crossing_figure, ("fair",)),
        Item("losses-table", "losses in numbers", loss_table, ("fair",)),
    ),
)
