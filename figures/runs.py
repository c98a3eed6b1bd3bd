"""Textbook pictures of one run: time-space diagram, queues, cumulative counts.

Each is a figure of its own, or drawn into `ax`. What they need and was not recorded is run again,
see `figures.whole` for what that costs.
"""

from __future__ import annotations

import math
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from figures import style
from figures.whole import filmed, head_spans, whole
from minisim.errors import choice, number
from minisim.junction.movements import ARM_NAMES
from minisim.junction.paths import Floats
from minisim.results.queues import JAM_SPEED, JAM_TIME, queue_lengths
from minisim.results.run import Run
from minisim.ticks import first_tick

#: How far behind the junction entry a time-space diagram goes [m].
BEYOND = 150.0
#: How lanes are drawn one after the other, so that they differ without colour too.
STROKES = (
    (style.BLUE, "-"), (style.VERMILLION, "--"), (style.GREEN, "-."), (style.PURPLE, ":"),
    (style.INK, (0, (6, 1, 1, 1, 1, 1))), (style.ORANGE, (0, (1, 1))),
)  # fmt: skip


def time_space(
    run: Run, lane: str = "a", *, start: float = 0.0, end: float = math.inf, ax: Axes | None = None
) -> Figure:
    """The vehicles that come on a lane, over time: where each is, and what the signal shows.

    Distances are of front bumpers from the junction entry [m], negative before it. A line is blue
    while its vehicle has the right of way. Along the hold line, heads show their state by width
    too: green wide, amber half as wide, red thin. `start` and `end` are in seconds.

    Raises `InputError` for a lane or times that the run does not have, and as `figures.whole`.
    """
    intersection, dt = run.site.intersection, run.site.dt
    index = ARM_NAMES.index(choice("lane", lane, list(ARM_NAMES[: intersection.n])))
    last = number("end [s]", min(end, run.columns.end), above=number("start [s]", start, low=0.0))
    axes = _axes(ax)
    trace, rows = filmed(run, start, last, everywhere=True).recorded()
    time, origins = trace["tick"] * dt, intersection.movements.origins
    shown = (time >= start - dt / 2) & (time <= last + dt / 2) & (origins[rows["path"]] == index)
    vehicle, gone = rows["id"][shown], trace["released"][shown] != 0
    points = np.stack([time[shown], trace["s"][shown] - intersection.paths[0].entry], axis=-1)
    order = np.argsort(vehicle, kind="stable")
    vehicle, gone, points = vehicle[order], gone[order], points[order]
    pairs = np.stack([points[:-1], points[1:]], axis=1)[vehicle[:-1] == vehicle[1:]]
    exits = np.array([path.exit for path in intersection.paths])[rows["path"][shown][order]]
    gone &= points[:, 1] <= exits - intersection.paths[0].entry
    goes = gone[1:][vehicle[:-1] == vehicle[1:]]
    for mine, colour, width in ((~goes, style.FREE, 0.9), (goes, style.RIGHT_OF_WAY, 1.3)):
        axes.add_collection(LineCollection(list(pairs[mine]), colors=colour, linewidths=width))
    stop = -run.plan.hold_distance
    axes.axhline(0.0, color=style.MUTED, linewidth=0.8, linestyle=":")
    keys = [
        Line2D([], [], color=style.RIGHT_OF_WAY, label="has the right of way"),
        Line2D([], [], color=style.FREE, label="does not"),
        Line2D([], [], color=style.MUTED, linestyle=":", label="junction entry"),
    ]
    spans = [
        it for it in head_spans(run) if it.lane == index and it.end > start and it.start < last
    ]
    for span in spans:
        ends = [max(span.start, start), min(span.end, last)]
        head = style.HEADS[span.state]
        axes.plot(ends, [stop, stop], color=head.colour, linewidth=head.width,
                  solid_capstyle="butt", zorder=3)  # fmt: skip
    if not spans:
        axes.axhline(stop, color=style.INK, linewidth=1.4)
        keys.append(Line2D([], [], color=style.INK, linewidth=1.4, label="hold line"))
    for state in sorted({span.state for span in spans}, key=list(style.HEADS).index):
        head = style.HEADS[state]
        keys.append(Line2D([], [], color=head.colour, linewidth=head.width, label=state))
    axes.set_xlim(start, last)
    axes.set_ylim(-intersection.approach_length, BEYOND)
    style.plot_axes(axes, f"Lane {lane}", "time [s]", "front bumper after the junction entry [m]")
    return _keyed(axes, keys)


def queues(run: Run, *, ax: Axes | None = None) -> Figure:
    """How many vehicles are in the queue of each lane over time, as `queue_lengths` counts them.

    Raises as `figures.whole`.
    """
    axes, lengths = _axes(ax), queue_lengths(whole(run))
    start = first_tick(float(run.scenario.warmup), run.site.dt)
    time = (start + np.arange(len(lengths))) * run.site.dt
    lanes = run.site.intersection.approaches
    for lane, (colour, dashes) in zip(lanes, cycle(STROKES), strict=False):
        axes.plot(time, lengths[:, lane], color=colour, linestyle=dashes, linewidth=1.4,
                  drawstyle="steps-post", label=f"lane {ARM_NAMES[lane]}")  # fmt: skip
    axes.set_ylim(bottom=0.0)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.margins(x=0.0)
    what = f"slower than {3.6 * JAM_SPEED:g} km/h for {JAM_TIME:g} s, or waiting before the road"
    style.plot_axes(axes, "Queues", f"time [s]; in the queue: {what}", "vehicles in the queue")
    return _keyed(axes)


def cumulative(run: Run, *, ax: Axes | None = None) -> Figure:
    """Cumulative arrivals and departures (Newell, Applications of Queueing Theory, 1982, ch. 1).

    A vehicle departs when it leaves the road. Its arrival is virtual: when it would have left had
    nothing delayed it. So the area between the curves is the control delay of all vehicles
    (`control_delay_s`), those on their way at the end too. Nothing has to be recorded.
    """
    axes, end = _axes(ax), run.columns.end
    arrivals, departures = cumulative_times(run)
    delay = float((end - arrivals).sum() - (end - departures).sum())
    arrivals = arrivals[arrivals < end]
    grid = np.unique(np.concatenate([[run.counted.columns.start, end], arrivals, departures]))
    curves = [np.searchsorted(np.sort(times), grid, "right") for times in (arrivals, departures)]
    axes.fill_between(grid, curves[1], curves[0], step="post", color=style.SKY, alpha=0.35)
    looks = (("arrivals, had nothing delayed them", style.VERMILLION, "--"),
             ("departures", style.BLUE, "-"))  # fmt: skip
    for curve, (label, colour, dashes) in zip(curves, looks, strict=True):
        axes.plot(grid, curve, color=colour, linestyle=dashes, linewidth=1.5,
                  drawstyle="steps-post", label=label)  # fmt: skip
    axes.margins(x=0.0)
    axes.set_ylim(bottom=0.0)
    mean = delay / max(len(run.counted.columns.lane), 1)
    title = f"Area: {delay:,.0f} s of delay, {mean:.1f} s per vehicle"
    style.plot_axes(axes, title, "time [s]", "vehicles")
    return _keyed(axes)


def cumulative_times(run: Run) -> tuple[Floats, Floats]:
    """Virtual arrivals and departures [s], not sorted; vehicles still on the way do not depart."""
    trips = run.counted.columns
    left = np.where(trips.arrived, trips.arrival, trips.end)
    return left - trips.time_loss - trips.depart_delay, trips.arrival[trips.arrived]


def _axes(ax: Axes | None) -> Axes:
    """The axes to draw into, by default those of a new figure."""
    if ax is not None:
        return ax
    return style.new_figure(9.0, 4.6, dpi=110).add_axes((0.09, 0.13, 0.89, 0.7))


def _keyed(axes: Axes, handles: list[Line2D] | None = None) -> Figure:
    """Put the legend above the axes, on the right; return their figure."""
    known = handles or axes.get_legend_handles_labels()[0]
    axes.legend(
        handles=known, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8.5,
        ncols=len(known), columnspacing=1.3, labelcolor=style.INK,
    )  # fmt: skip
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure
