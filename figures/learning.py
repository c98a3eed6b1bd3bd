"""What training has brought: the course of it, and a comparison on other arrivals."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from figures import plots, style
from figures.tables import Table
from scenarios.environments.training import Training
from scenarios.optimum import ABOVE, DELAY, LEAST
from scenarios.statistics import mean_interval

#: Generations over which the course is averaged; each has arrivals of its own.
SMOOTHED = 10


def learning_figure(training: Training, rows: pd.DataFrame) -> Figure:
    """Left the course of training, right the delay of each controller over demand."""
    figure, (left, right) = plots.panels(
        11.0, 4.8, 2, sharey=False, left=0.075, right=0.985, top=0.78, bottom=0.14, wspace=0.2
    )
    gained = np.array([it.middle - it.start for it in training.generations])
    width = min(SMOOTHED, len(gained))
    smooth = np.convolve(gained, np.ones(width) / width, "valid")
    number = np.arange(1, len(gained) + 1)
    left.plot(number, gained, color=style.FAINT, linewidth=1.0)
    left.plot(number[width - 1 :], smooth, color=style.BLUE, linewidth=2.0)
    left.axhline(0.0, color=style.INK, linewidth=0.8)
    left.xaxis.set_major_locator(MaxNLocator(integer=True))
    style.plot_axes(left, "Training", "generation", "median less the start policy [s/vehicle]")
    names = list(dict.fromkeys(rows["controller"]))
    for place, name in enumerate(names):
        cells = list(rows[rows["controller"] == name].groupby("density"))
        aside = plots.offset(rows, place, len(names))
        x = [float(str(density)) + aside for density, _ in cells]
        found = [plots.mean_estimate(cell[DELAY.name]) for _, cell in cells]
        plots.draw_line(right, x, found, style.look(name))
    once = rows.drop_duplicates(["density", "seed"]).groupby("density")[LEAST.name].mean()
    right.plot(once.index, once, color=style.MUTED, linestyle=":", linewidth=1.6, label="bound")
    right.set_yscale("log")
    right.set_xticks(once.index)
    style.plot_axes(right, "Other arrivals", plots.DENSITY_LABEL, "mean delay [s], logarithmic")
    handles, labels = right.get_legend_handles_labels()
    plots.legend(figure, handles, labels, 0.93, 4)
    style.write(figure, 0.02, 0.965, "A linear policy, trained from scratch", 14, bold=True)
    return figure


def learning_table(rows: pd.DataFrame) -> Table:
    """Mean delays and what is above the least possible, with 95 % intervals."""
    demands = sorted(rows["density"].unique())
    made = []
    for name in dict.fromkeys(rows["controller"]):
        cells = []
        for demand in demands:
            cell = rows[(rows["controller"] == name) & (rows["density"] == demand)]
            above = mean_interval(cell[ABOVE.name])
            cells.append(f"{mean_interval(cell[DELAY.name])} s, +{above.mean:.0f} %")
        made.append((name, *cells))
    title = "Mean delay, and above the least possible; 95 % intervals"
    headings = "controller", *(f"{it:g} veh/h/lane" for it in demands)
    return Table(title, headings, tuple(made))
