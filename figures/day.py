"""Waiting and delay over a day, one line per controller."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import cycle
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from figures import plots, style
from minisim.clock import time_of_day
from minisim.results.run import Run
from minisim.results.service import LEVELS, service
from scenarios.controllers import VARIANTS

#: Columns of `service` -> titles of their panels; logarithmic, but linear below `LINEAR` [s].
TIMES = {"waiting_time_s": "mean waiting [s]", "control_delay_s": "mean control delay [s]"}
LINEAR = 1.0

NOTE = (
    "By the interval in which vehicles came, with the vehicles that had not arrived by the end. "
    f"Times are on a logarithmic scale, linear below {LINEAR:g} s. A … E: where the levels of "
    "service end at junctions without signals (Highway Capacity Manual, 6th ed.); beyond E is F."
)


def day_figure(runs: Mapping[str, Run], interval: float = 900.0) -> Figure:
    """How many vehicles came in each `interval` [s], and their mean waiting and control delay.

    `runs` maps names to runs of one demand. Names of controllers have the same look as in other
    figures; other variants of these have its colour, other dashes, and their place for a marker.
    """
    figure, panels = plots.panels(
        12.0, 4.4, 3, sharey=False, left=0.05, right=0.97, top=0.77, bottom=0.2, wspace=0.2
    )
    looks = _looks(runs)
    tables = {name: service(run, interval) for name, run in runs.items()}
    start = next(iter(tables.values()))["start_s"]
    begin = max(
        getattr(getattr(run.scenario, "demand", None), "start", 0.0) for run in runs.values()
    )
    hours = (begin + start + interval / 2.0) / 3600.0
    panels[0].plot(hours, next(iter(tables.values()))["trips"], color=style.INK)
    panels[0].set_ylim(bottom=0.0)
    style.plot_axes(panels[0], f"vehicles per {interval / 60.0:g} min", "time of day", "")
    for axes, (column, title) in zip(panels[1:], TIMES.items(), strict=True):
        for look, table in zip(looks, tables.values(), strict=True):
            axes.plot(
                hours, table[column], look.dashes, color=look.colour, label=look.label,
                marker=look.marker, markersize=4.5, markevery=4,
            )  # fmt: skip
        style.plot_axes(axes, title, "time of day", "")
        highest = max(float(table[column].max()) for table in tables.values())
        plots.log_time(axes, 0.0, max(1.5 * highest, 10.0), linear=LINEAR)
    for axes in panels:
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
        axes.xaxis.set_major_formatter(lambda hour, _: time_of_day(3600.0 * hour))
    _levels(panels[2])
    plots.frame(figure, "A day at the junction", looks, NOTE, ncols=len(looks))
    return figure


def _looks(names: Iterable[str]) -> list[style.Look]:
    strokes: Iterator[Any] = cycle((":", "-.", "--", "-"))
    return [
        style.look(name)
        if name in VARIANTS
        else style.look(name.partition(":")[0])._replace(
            label=name, dashes=next(strokes), marker=f"${place}$"
        )
        for place, name in enumerate(names, start=1)
    ]


def _levels(axes: Axes) -> None:
    """Where each level of service ends."""
    axes.grid(visible=False)
    top = axes.get_ylim()[1]
    for level, limit in zip("ABCDE", LEVELS["unsignalised"], strict=True):
        if limit < top:
            axes.axhline(limit, color=style.FAINT, linewidth=0.8, zorder=0)
            axes.annotate(level, (1.01, limit), xycoords=("axes fraction", "data"), va="top",
                          fontsize=7, color=style.MUTED)  # fmt: skip
