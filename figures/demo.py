"""Waiting and travel time over density, one line a controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import style
from scenarios.demo import CONTROLLERS

if TYPE_CHECKING:
    import pandas as pd

PANELS = {
    "waiting_time_s": "Waiting time",
    "travel_time_s": "Travel time",
}
#: Colour, marker and line by position: told apart without colour too.
LOOKS = (
    (style.BLUE, "o", "-"), (style.GREEN, "s", "--"), (style.VERMILLION, "^", "-."),
    (style.PURPLE, "D", ":"), (style.ORANGE, "v", "-"), (style.SKY, "P", "--"),
)  # fmt: skip

#: Lines are drawn so far apart that their interval bars do not cover each other [veh/h/lane].
DODGE = 2.5


def performance_figure(points: pd.DataFrame, title: str = "") -> Figure:
    """Draw means with their confidence intervals.

    Args:
        points: columns `controller`, `density`, and each of `PANELS` with its `…_ci95`
            (`scenarios.demo.average`).
        title: above the panels.
    """
    figure = style.new_figure(9.2, 4.5)
    panels = figure.subplots(1, len(PANELS))
    figure.subplots_adjust(left=0.075, right=0.985, top=0.745, bottom=0.13, wspace=0.2)
    for axes, (metric, name) in zip(panels, PANELS.items(), strict=True):
        _draw_panel(axes, points, metric)
        style.plot_axes(axes, name, "density [veh/h/lane]", "mean [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="upper left", bbox_to_anchor=(0.066, 0.925), ncols=len(labels),
        frameon=False, fontsize=10.5, handlelength=2.6, columnspacing=2.2, labelcolor=style.INK,
    )  # fmt: skip
    figure.text(0.075, 0.945, title, fontsize=10, color=style.MUTED, va="center")
    return figure


def _draw_panel(axes: Axes, points: pd.DataFrame, metric: str) -> None:
    lines = list(points.groupby("controller", sort=False))
    for k, (controller, line) in enumerate(lines):
        colour, marker, dashes = LOOKS[k % len(LOOKS)]
        aside = DODGE * (k - (len(lines) - 1) / 2.0)
        axes.errorbar(
            line["density"] + aside, line[metric], yerr=line[f"{metric}_ci95"], color=colour,
            marker=marker, linestyle=dashes, linewidth=2.0, markersize=5.5, capsize=3.5,
            elinewidth=1.2, label=CONTROLLERS.get(str(controller), str(controller)), zorder=3,
        )  # fmt: skip
    axes.set_xticks(sorted(points["density"].unique()))
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.06)
