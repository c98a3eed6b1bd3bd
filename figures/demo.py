"""Waiting and travel time over density, one line a controller."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from figures import plots, style
from minisim.results.metrics import METRICS
from scenarios.demo import CONTROLLERS

PANELS = ("waiting_time_s", "travel_time_s")

#: Lines are this far apart, so that their interval bars do not cover each other [veh/h/lane].
DODGE = 2.5


def performance_figure(points: pd.DataFrame, title: str = "") -> Figure:
    """Draw means with their confidence intervals.

    Args:
        points: columns `controller`, `density`, and each of `PANELS` with its `…_ci95`
            (`scenarios.demo.average`).
        title: above the panels.
    """
    figure, panels = plots.panels(
        9.2, 4.5, len(PANELS), sharey=False, left=0.075, right=0.985, top=0.745, bottom=0.13,
        wspace=0.2,
    )  # fmt: skip
    lines = list(points.groupby("controller", sort=False))
    for axes, metric in zip(panels, PANELS, strict=True):
        for k, (name, line) in enumerate(lines):
            aside = DODGE * (k - (len(lines) - 1) / 2.0)
            look = style.look(str(name))
            low, high = (line[metric] + sign * line[f"{metric}_ci95"] for sign in (-1, 1))
            plots.draw_line(
                axes, (line["density"] + aside).tolist(),
                [*map(plots.Estimate, line[metric], low, high)],
                look._replace(label=CONTROLLERS.get(str(name), look.label)), **plots.BOLD,
            )  # fmt: skip
        axes.set_xticks(sorted(points["density"].unique()))
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.06)
        heading = f"{METRICS[metric].title.capitalize()} time"
        style.plot_axes(axes, heading, "density [veh/h/lane]", "mean [s]")
    handles, labels = panels[0].get_legend_handles_labels()
    plots.legend(figure, handles, labels, 0.9, bbox_to_anchor=(0.075, 0.9), fontsize=10.5)
    style.write(figure, 0.075, 0.945, title, 10, colour=style.MUTED)
    return figure
