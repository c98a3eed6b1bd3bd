"""Waiting and delay over a day, one line per controller."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from figures import plots, style
from minisim.clock import time_of_day
from minisim.results.run import Run
from minisim.results.service import LEVELS, service

#: Line styles of the runs, in their order.
_STROKES = ("-", "--", "-.", ":")


def day_figure(runs: Mapping[str, Run], interval: float = 900.0) -> Figure:
    """Mean waiting and control delay by the interval [s] in which vehicles came, and how many did.

    `runs` maps what the legend says to runs of one demand. Grey lines are the levels of service A
    to F at junctions without signals (`minisim.results.service.LEVELS`).
    """
    figure, panels = plots.panels(12.0, 4.2, 3, top=0.8, bottom=0.15)
    columns = {"trips": "vehicles that came", "waiting_time_s": "mean waiting [s]",
               "control_delay_s": "mean control delay [s]"}  # fmt: skip
    for axes, (column, label) in zip(panels, columns.items(), strict=True):
        for k, (name, run) in enumerate(runs.items()):
            table = service(run, interval)
            begin = getattr(getattr(run.scenario, "demand", None), "start", 0.0)
            hours = (begin + table["start_s"] + interval / 2.0) / 3600.0
            if column != "trips" or k == 0:
                axes.plot(hours, table[column], _STROKES[k % len(_STROKES)], label=name)
        if column == "control_delay_s":
            top = axes.get_ylim()[1]
            for level, limit in zip("ABCDE", LEVELS["unsignalised"], strict=True):
                if limit < top:
                    axes.axhline(limit, color="0.8", linewidth=0.8, zorder=0)
                    axes.text(hours.iloc[-1], limit, level, va="top", ha="right", color="0.5")
        style.plot_axes(axes, label, "time of day", "")
        ticks = np.linspace(*axes.get_xlim(), 5)[1:-1].round()
        axes.set_xticks(ticks, [time_of_day(3600.0 * tick) for tick in ticks])
    figure.legend(*panels[-1].get_legend_handles_labels(), loc="upper center", ncols=len(runs))
    return figure
