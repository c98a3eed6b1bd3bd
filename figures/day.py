"""Waiting and delay over a day, one line per controller."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from figures import plots, style
from minisim.clock import time_of_day
from minisim.results.run import Run
from minisim.results.service import LEVELS, service

#: Line styles of the runs, in their order.
_STROKES = ("-", "--", "-.", ":")

#: Column of `service` -> title of its panel.
COLUMNS = {
    "trips": "vehicles that came",
    "waiting_time_s": "mean waiting [s]",
    "control_delay_s": "mean control delay [s]",
}


def day_figure(runs: Mapping[str, Run], interval: float = 900.0) -> Figure:
    """Mean waiting and control delay by the interval [s] in which vehicles came, and how many did.

    `runs` maps what the legend says to runs of one demand. Grey lines are the levels of service A
    to F at junctions without signals (`minisim.results.service.LEVELS`).
    """
    figure, panels = plots.panels(
        12.0, 4.2, 3, sharey=False, left=0.05, right=0.97, top=0.78, bottom=0.15, wspace=0.2
    )
    for axes, (column, label) in zip(panels, COLUMNS.items(), strict=True):
        for stroke, (name, run) in zip(cycle(_STROKES), runs.items()):
            table = service(run, interval)
            begin = getattr(getattr(run.scenario, "demand", None), "start", 0.0)
            hours = (begin + table["start_s"] + interval / 2.0) / 3600.0
            axes.plot(hours, table[column], stroke, label=name)
            if column == "trips":  # the same for all
                break
        axes.set_ylim(bottom=0.0)
        style.plot_axes(axes, label, "time of day", "")
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        axes.xaxis.set_major_formatter(lambda hour, _: time_of_day(3600.0 * hour))
    _levels(panels[2])
    figure.legend(*panels[2].get_legend_handles_labels(), loc="upper center", ncols=len(runs))
    return figure


def _levels(axes: Axes) -> None:
    """Where each level of service ends."""
    axes.grid(visible=False)
    top = axes.get_ylim()[1]
    for level, limit in zip("ABCDE", LEVELS["unsignalised"], strict=True):
        if limit < top:
            axes.axhline(limit, color=style.FAINT, linewidth=0.8, zorder=0)
            axes.annotate(level, (1.01, limit), xycoords=("axes fraction", "data"), va="top",
                          fontsize=7, color=style.MUTED)  # fmt: skip
