"""Waiting by lane under fixed, rotating and longest-waiting priority."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from minisim.junction.movements import ARM_NAMES
from scenarios.studies.fairness import LANE_WAIT, PRIORITIES, lane_waits
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results

#: Lanes are compared at this demand, or the nearest one that was run [veh/h/lane].
LANE_DENSITY = 300.0


def fairness_figure(results: Results) -> Figure:
    """Waiting in each lane and in the worst lane, and how unequal it is between lanes."""
    rows = lane_waits(results.good, 4)
    figure, (by_lane, worst, spread) = plots.panels(
        11.0, 4.7, 3, sharey=False, left=0.06, right=0.985, top=0.745, bottom=0.15, wspace=0.26
    )
    compared = min(set(rows["density"]), key=lambda density: abs(density - LANE_DENSITY))
    _draw_lanes(by_lane, rows[rows["density"] == compared])
    style.plot_axes(by_lane, f"By lane, {compared:g} veh/h/lane", "lane", "mean waiting [s]")
    for axes, metric, title, label in (
        (worst, "worst_lane_s", "Worst lane", f"mean waiting [s], {plots.scale_words(0.1)}"),
        (spread, "gini", "Inequality between lanes", "Gini coefficient of the lanes' means"),
    ):
        plots.draw_means(axes, rows, metric, PRIORITIES)
        style.plot_axes(axes, title, plots.DENSITY_LABEL, label)
        plots.density_axis(axes)
    plots.log_time(worst, 0.0, 500.0, linear=0.1)
    for axes, top in ((spread, 1.0), (by_lane, by_lane.get_ylim()[1])):
        axes.set_ylim(-0.025 * top, top)  # room for markers at 0
    title = "Fixed, rotating and longest-waiting priority on four arms, profile fair"
    plots.frame(figure, title, map(style.look, PRIORITIES), missing_note(results), marks=0.865)
    return figure


def _draw_lanes(axes: Axes, rows: pd.DataFrame) -> None:
    lanes = ARM_NAMES[:4]
    for place, name in enumerate(PRIORITIES):
        chosen = rows[rows["series"] == name]
        if not chosen.empty:
            plots.draw_line(
                axes, [k + 0.09 * (place - 1) for k in range(len(lanes))],
                [plots.mean_estimate(chosen[LANE_WAIT.format(lane)]) for lane in lanes],
                style.look(name), linestyle="none", markersize=6.0,
            )  # fmt: skip
    axes.set_xticks(range(len(lanes)), list(lanes))


SECTION = Section(
    "Fairness",
    (Item("fairness", "fixed, rotating and waiting priority", fairness_figure, ("fairness",)),),
)
