"""The largest demand served without a growing queue, by controller and arms."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from minisim.errors import plural
from scenarios.controllers import RIVALS
from scenarios.studies.capacity import STUDY, Capacity, capacities
from scenarios.studies.shared.archive import MissingRunsError
from scenarios.studies.shared.study import Results


def needed_capacities(results: Results) -> list[Capacity]:
    """Every known capacity; raises `MissingRunsError` if there is none."""
    known = capacities(results)
    if not known:
        raise MissingRunsError(
            "the store has no finished search for a capacity; make one with: "
            f"{results.effort.command('capacity')}"
        )
    return known


def capacity_figure(results: Results) -> Figure:
    """Capacities with their intervals."""
    known = needed_capacities(results)
    high = 1.7 + 0.39 * len(RIVALS)
    figure = style.new_figure(9.2, high)
    axes = figure.add_axes((0.24, 0.8 / high, 0.74, 1.0 - 1.7 / high))
    ends = [end for c in known for bracket in c.brackets for end in bracket if end < math.inf]
    highest = 100.0 * math.ceil(1.04 * max(ends) / 100.0)
    for capacity in known:
        _draw_capacity(axes, capacity, highest)
    style.plot_axes(axes, "", "capacity [veh/h/lane]", "")
    axes.grid(axis="x", color=style.FAINT, linewidth=0.8)
    axes.grid(axis="y", visible=False)
    axes.set_yticks(range(len(RIVALS)), [style.look(name).label for name in RIVALS])
    axes.set_ylim(len(RIVALS) - 0.5, -0.5)
    for edge in range(1, len(RIVALS)):
        axes.axhline(edge - 0.5, color=style.FAINT, linewidth=0.8)
    axes.set_xlim(0.0, highest)
    note = f"{_extent(results)}; profile fair.  Pale line: only a bound is known."
    if missing := len(STUDY.points) - len(known):
        note += f"  Not drawn, for lack of runs: {missing} of {len(STUDY.points)} cases."
    title = "Capacity: the largest demand served without a growing queue"
    plots.frame(figure, title, map(style.coloured, style.ARMS.values()), note, lines=False)
    return figure


def capacity_table(results: Results) -> Table:
    """Capacities as numbers [veh/h/lane]."""
    known = needed_capacities(results)
    texts = {(c.series, c.arms): str(c) for c in known}
    arms = sorted({c.arms for c in known})
    return Table(
        "Capacity [veh/h/lane]",
        ("controller", *(f"{n} arms" for n in arms)),
        tuple(
            (style.look(name).label, *(texts.get((name, n), "–") for n in arms))
            for name in dict.fromkeys(c.series for c in known)
        ),
        notes=(
            f"{_extent(results)}; “<” (“>”): for some seed, every (no) demand tried was too "
            "much. Served means that the queue grows by less than 2 % of the arrivals.",
        ),
    )  # fmt: skip


def _extent(results: Results) -> str:
    search = results.effort.search
    return (
        f"{results.effort.warning}Mean and 95 % interval over {plural(search.seeds, 'seed')} of "
        f"{search.horizon:g} s, with the search's rounding of {search.step / 2.0:g} "
        "veh/h/lane"
    )


def _draw_capacity(axes: Axes, capacity: Capacity, highest: float) -> None:
    """Mean and interval, or a pale line if only a bound is known."""
    look = style.coloured(style.ARMS[capacity.arms])
    place = RIVALS.index(capacity.series) + 0.17 * (capacity.arms - 4.5)
    low, high = capacity.above, capacity.below
    if low is None and high is None:
        mean, half, _ = capacity.interval
        axes.errorbar(mean, place, xerr=np.nan_to_num(half), color=look.colour, capsize=2.6,
                      marker=look.marker, markersize=6.5, elinewidth=1.2)  # fmt: skip
        return
    ends = (0.0 if low is None else low, highest if high is None else high)
    axes.plot(ends, [place, place], color=look.colour, alpha=0.35, linewidth=3.0)


SECTION = Section(
    "Capacity",
    (
        Item("capacity", "largest demand served", capacity_figure, ("capacity",)),
        Item("capacity-table", "capacity in numbers", capacity_table, ("capacity",)),
    ),
)
