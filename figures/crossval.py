"""Figures of a cross-validation: means over density, every trip, and where the hosts part ways."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from minisim.junction.movements import ARM_NAMES
from minisim.junction.paths import Floats
from minisim.results.trajectories import LANE, MANOEUVRE, TIME, VEHICLE, S
from scenarios.crossval import Result
from scenarios.crossval.comparison import JUDGED, Parting, times

if TYPE_CHECKING:
    import pandas as pd

#: Markers and dashes tell the sources apart even without colour.
MINISIM = style.Look("minisim", style.BLUE, "o", "-")
SUMO = style.Look("SUMO", style.ORANGE, "s", "--")
PUBLISHED = style.Look("published", style.BLACK, "D", ":")

#: What a trajectory figure shows: time around the parting [s], distance around the entry [m].
SHOWN_BEFORE, SHOWN_AFTER = 12.0, 28.0
SHOWN_FROM, SHOWN_TO = -90.0, 40.0

#: Distributions are shown up to this quantile; the few trips beyond it would take up all the room.
TAIL: Final = 0.995


def crossval_figures(results: Sequence[Result]) -> Iterator[tuple[str, str, Figure]]:
    """Every figure of a comparison: name of its file, caption, and the figure itself.

    All densities of a junction, split and controller are drawn together.
    """
    groups: dict[tuple[str, ...], list[Result]] = {}
    for result in sorted(results, key=lambda result: result.case.density):
        if result.rows:
            groups.setdefault(_group(result), []).append(result)
    for group, ordered in groups.items():
        title = ", ".join(group)
        if len(ordered) > 1:
            yield _file("means", *group), f"{title}: means over density", means_figure(ordered)
        drawable = [result for result in ordered if _travel_times(result).size]
        if drawable:  # in a short run, perhaps no vehicle has arrived
            yield _file("trips", *group), f"{title}: every trip", trips_figure(drawable)
    for result in results:
        if result.parting is not None:
            name, figure = result.case.name, parting_figure(result, result.parting)
            yield _file("parting", name), f"{name}: where the hosts part ways", figure


def means_figure(results: Sequence[Result]) -> Figure:
    """Means over density with 95 % intervals: minisim's, SUMO's and, where known, the paper's."""
    figure, panels = plots.panels(
        8.6, 4.0, len(JUDGED), sharey=False, left=0.08, right=0.985, top=0.76, bottom=0.135,
        wspace=0.2,
    )  # fmt: skip
    for axes, (metric, name) in zip(panels, JUDGED.items(), strict=True):
        ours: dict[float, plots.Estimate] = {}
        theirs: dict[float, plots.Estimate] = {}
        paper: dict[float, plots.Estimate] = {}
        for result in results:
            density, row = result.case.density, result.row(metric)
            for line, (mean, half, _) in ((ours, row.minisim), (theirs, row.sumo)):
                line[density] = plots.Estimate(mean, mean - half, mean + half)
            value = result.case.reference(metric, "all")
            if value is not None:
                paper[density] = plots.Estimate(value, value, value)
        lines = [(MINISIM, ours), (PUBLISHED, paper), (SUMO, theirs)]
        plots.draw_side_by_side(axes, [line for line in lines if line[1]], name)
    _head(figure, panels[0], results[0])
    return figure


def trips_figure(results: Sequence[Result]) -> Figure:
    """Distributions in both hosts above, each trip in both below; one column per density."""
    columns = len(results)
    figure = style.new_figure(max(6.4, 2.7 * columns + 0.9), 7.6)
    panels = figure.subplots(3, columns, squeeze=False)
    figure.subplots_adjust(
        left=0.75 / figure.get_figwidth(), right=1.0 - 0.15 / figure.get_figwidth(), top=0.865,
        bottom=0.065, wspace=0.3, hspace=0.5,
    )  # fmt: skip
    for k, result in enumerate(results):
        for axes, (metric, name) in zip(panels[:2, k], JUDGED.items(), strict=True):
            _distributions(axes, result, metric)
            title = f"{result.case.density:g} veh/h/lane" if axes is panels[0, k] else ""
            ylabel = "share of trips" if k == 0 else ""
            style.plot_axes(axes, title, f"{name.lower()} [s]", ylabel)
        _scatter(panels[2, k], result)
        ylabel = "travel time in SUMO [s]" if k == 0 else ""
        style.plot_axes(panels[2, k], "", "in minisim [s]", ylabel)
    _head(figure, panels[0, 0], results[0])
    return figure


def parting_figure(result: Result, parting: Parting) -> Figure:
    """Distance to the junction over time, one panel per lane, with both hosts overlaid."""
    junction = result.case.scenario.intersection
    entry, arms = junction.approach_length, junction.n
    start, end = parting.time - SHOWN_BEFORE, parting.time + SHOWN_AFTER
    figure = style.new_figure(9.6, 1.25 + 1.45 * arms)
    height = figure.get_figheight()
    panels = figure.subplots(arms, 1, sharex=True, squeeze=False)[:, 0]
    top, bottom = 1.0 - 0.95 / height, 0.55 / height
    figure.subplots_adjust(left=0.085, right=0.985, top=top, bottom=bottom, hspace=0.14)
    for frame, look in ((parting.minisim, MINISIM), (parting.sumo, SUMO)):
        near = frame[frame[TIME].between(start, end)]
        near = near[near[S].between(entry + SHOWN_FROM, entry + SHOWN_TO)]
        width = 1.3 if look is MINISIM else 1.8
        for _, trip in near.groupby(VEHICLE):
            axes = panels[ARM_NAMES.index(str(trip[LANE].iloc[0]))]
            way = trip[TIME], trip[S] - entry
            axes.plot(*way, color=look.colour, linestyle=look.dashes, linewidth=width)
            if look is MINISIM:
                _name_trip(axes, trip, entry)
    for axes, lane in zip(panels, ARM_NAMES, strict=False):
        style.plot_axes(axes, "", "", f"lane {lane} [m]")
        axes.axhline(0.0, color=style.MUTED, linewidth=0.8)
        axes.set(xlim=(start, end), ylim=(SHOWN_FROM, SHOWN_TO))
    ring: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": style.VERMILLION}
    panels[ARM_NAMES.index(parting.movement[0])].plot(
        parting.time, parting.positions[0] - entry, "o", markersize=13, markeredgewidth=1.8, **ring
    )
    panels[-1].set_xlabel("time [s]", **style.LABEL)
    for look in (MINISIM, SUMO):
        panels[0].plot([], [], color=look.colour, linestyle=look.dashes, label=look.label)
    panels[0].plot([], [], "o", label="parting point", **ring)
    _head(figure, panels[0], result, "front bumper before (−) or past (+) the junction entry")
    return figure


def _distributions(axes: Axes, result: Result, metric: str) -> None:
    ours = np.concatenate([times(pair.minisim, metric) for pair in result.pairs])
    theirs = np.concatenate([times(pair.sumo, metric) for pair in result.pairs])
    for look, seconds in ((MINISIM, ours), (SUMO, theirs)):
        axes.ecdf(seconds, color=look.colour, linestyle=look.dashes, linewidth=1.6,
                  label=look.label)  # fmt: skip
    axes.set_xlim(_limits(np.concatenate([ours, theirs])))
    axes.set_ylim(0.0, 1.02)
    _note(axes, 0.97, 0.06, f"KS {result.row(metric).ks:.3f}", "right")


def _scatter(axes: Axes, result: Result) -> None:
    """Travel time of each trip that ended in both hosts."""
    both = _travel_times(result)
    axes.plot(*both, "o", markersize=2.6, markeredgewidth=0, color=style.BLUE, alpha=0.35,
              rasterized=True)  # fmt: skip
    limits = _limits(both)
    axes.plot(limits, limits, color=style.VERMILLION, linewidth=1.0, zorder=1)
    axes.set(xlim=limits, ylim=limits)
    _note(axes, 0.05, 0.9, f"same: {100 * result.row('travel_time_s').within:.1f} %", "left")


def _note(axes: Axes, x: float, y: float, text: str, align: str) -> None:
    axes.text(x, y, text, transform=axes.transAxes, ha=align, fontsize=9, color=style.INK)


def _limits(values: Floats) -> tuple[float, float]:
    low, high = map(float, np.quantile(values, (0.0, TAIL)))
    room = 0.03 * max(high - low, 1.0)
    return low - room, high + room


def _travel_times(result: Result) -> Floats:
    """Times in minisim and in SUMO of the trips that ended in both [s], shape (2, k)."""
    trips = [(pair.minisim, pair.sumo) for pair in result.pairs]
    both = [np.array([a.travel_time, b.travel_time])[:, a.arrived & b.arrived] for a, b in trips]
    return np.hstack(both)


def _name_trip(axes: Axes, trip: pd.DataFrame, entry: float) -> None:
    first = trip.iloc[0]
    axes.text(
        first[TIME] - 0.25, first[S] - entry + 2.0,
        f"{first[VEHICLE]}: {first[LANE]}{first[MANOEUVRE]}", fontsize=7.5, color=style.INK,
        ha="right", va="bottom", clip_on=True,
        bbox={"facecolor": style.PAPER, "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
    )  # fmt: skip


def _head(figure: Figure, axes: Axes, result: Result, note: str = "") -> None:
    case = result.case
    height, left = figure.get_figheight(), figure.subplotpars.left
    where = case.name if note else ", ".join(_group(result))
    arrivals = "drawn" if case.published is None else "published"
    title = f"{where} · profile {case.scenario.profile.name}, {arrivals} arrivals"
    style.write(figure, left, 1 - 0.2 / height, title, 10.5)
    style.write(figure, 0.985, 1 - 0.2 / height, note, 9, colour=style.MUTED, ha="right")
    handles, labels = axes.get_legend_handles_labels()
    corner = (left, 1 - 0.36 / height)
    plots.legend(figure, handles, labels, corner[1], bbox_to_anchor=corner, fontsize=10)


def _group(result: Result) -> tuple[str, ...]:
    case = result.case
    return tuple(filter(None, (case.scenario.name, case.split, case.fleet, case.controller)))


def _file(*words: str) -> str:
    return re.sub("[:/,]", "-", "_".join(words)).replace(" ", "_")
