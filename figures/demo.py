"""Waiting and travel time over density, one line per controller."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from figures import plots, style
from minisim.results.metrics import METRICS

PANELS = ("waiting_time_s", "travel_time_s")


def performance_figure(points: pd.DataFrame, title: str = "") -> Figure:
    """Draw means with their confidence intervals, as computed by `scenarios.demo.average`."""
    figure, panels = plots.panels(
        9.2, 4.5, len(PANELS), sharey=False, left=0.075, right=0.985, top=0.745, bottom=0.13,
        wspace=0.2,
    )  # fmt: skip
    for axes, metric in zip(panels, PANELS, strict=True):
        lines = []
        for name, line in points.groupby("controller", sort=False):
            look = style.look(str(name))
            low, high = (line[metric] + sign * line[f"{metric}_ci95"] for sign in (-1, 1))
            means = map(plots.Estimate, line[metric], low, high)
            lines.append((look, dict(zip(line["density"], means, strict=True))))
        plots.draw_side_by_side(axes, lines, f"{METRICS[metric].title.capitalize()} time")
    handles, labels = panels[0].get_legend_handles_labels()
    plots.legend(figure, handles, labels, 0.9, bbox_to_anchor=(0.075, 0.9), fontsize=10.5)
    style.write(figure, 0.075, 0.945, title, 10, colour=style.MUTED)
    return figure
