"""Figures of the comparisons that the paper does not make."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from figures import lines, style
from minisim.junction.geometry import ARM_NAMES
from scenarios.controllers import RIVALS
from scenarios.paper import DENSITIES
from scenarios.statistics import mean_interval
from scenarios.studies.archive import (
    Archive,
    MissingRunsError,
    make_command,
    missing_note,
    smoke_test,
)
from scenarios.studies.capacity import CASES, Capacity
from scenarios.studies.crossing import (
    METRICS,
    Crossing,
    crossing,
    paired_differences,
    with_total_delay,
)
from scenarios.studies.fairness import LANE_WAIT, lane_waits
from scenarios.studies.study import PRIORITIES

#: The two gates whose losses are asked for, and whom they may lose to.
GATES = ("dim", "dim:gate=harmonious")
OTHERS = tuple(name for name in RIVALS if name not in GATES)
#: Arms -> colour and marker of a capacity.
ARMS: Mapping[int, tuple[str, str]] = MappingProxyType({
    3: (style.GREEN, "^"), 4: (style.BLUE, "s"), 5: (style.VERMILLION, "p"), 6: (style.INK, "h"),
})  # fmt: skip
#: The demand at which lanes are compared, or the nearest that was run [veh/h/lane].
LANE_DENSITY = 300.0


def fair_figure(archive: Archive) -> Figure:
    """Every controller with one vehicle and speed limit: three measures over demand.

    Raises:
        MissingRunsError: nothing was run.
    """
    (results,) = archive.need("fair")
    rows = with_total_delay(results.good)
    figure = style.new_figure(11.5, 5.4)
    panels = figure.subplots(1, len(METRICS), sharey=True)
    figure.subplots_adjust(left=0.058, right=0.99, top=0.735, bottom=0.135, wspace=0.06)
    for axes, (name, metric) in zip(panels, METRICS.items(), strict=True):
        lines.draw_means(axes, rows, metric, RIVALS)
        style.plot_axes(axes, name[0].upper() + name[1:], lines.DENSITY_LABEL, "")
        lines.log_time(axes, 0.0, 4000.0, linear=0.1)
        lines.density_axis(axes, rows["density"])
    panels[0].set_ylabel(
        f"mean of all vehicles [s], {lines.scale_words(0.1)}", fontsize=9.5, color=style.INK
    )
    _title(figure, "Every controller on four arms, profile fair")
    lines.series_legend(figure, RIVALS, 0.012, 0.93, ncols=4)
    lines.marks_legend(figure, 0.012, 0.842, paper=False)
    lines.footnote(figure, (
        f"{missing_note([results], lambda _: True)}  Waiting is standing on the road: it leaves "
        "out the queue before a full road, and V2I-C's vehicles crawl."
    ))  # fmt: skip
    return figure


def losses(archive: Archive) -> dict[tuple[str, str, str], Crossing]:
    """From which demand on DIM does worse: (measure, gate, rival) -> crossing.

    Pairs without two demands in common are left out.

    Raises:
        MissingRunsError: no pair has two demands in common.
    """
    (results,) = archive.need("fair")
    rows = with_total_delay(results.good)
    found = {}
    for name, metric in METRICS.items():
        for gate in GATES:
            for rival in OTHERS:
                differences = paired_differences(rows, gate, rival, metric)
                if len(differences) > 1:
                    found[name, gate, rival] = crossing(differences)
    if not found:
        raise MissingRunsError(
            "the store has no two demands at which DIM and another controller ran with two common "
            f"seeds; make them with: {make_command(archive.effort, 'fair')}"
        )
    return found


def crossing_figure(archive: Archive) -> Figure:
    """Demand from which on DIM loses to each rival, with both gates; errors as `losses`."""
    found = losses(archive)
    (results,) = archive.need("fair")
    figure = style.new_figure(11.0, 4.7)
    panels = figure.subplots(1, len(METRICS), sharey=True)
    figure.subplots_adjust(left=0.14, right=0.985, top=0.745, bottom=0.155, wspace=0.06)
    for axes, name in zip(panels, METRICS, strict=True):
        for place, rival in enumerate(OTHERS):
            for gate, aside in zip(GATES, (-0.16, 0.16), strict=True):
                if (name, gate, rival) in found:
                    _draw_crossing(axes, found[name, gate, rival], gate, place + aside)
        style.plot_axes(axes, name[0].upper() + name[1:], lines.DENSITY_LABEL, "")
        axes.grid(axis="x", color=style.FAINT, linewidth=0.8)
        lines.density_axis(axes, results.good["density"])
    panels[0].set_yticks(range(len(OTHERS)), [style.look(name).label for name in OTHERS])
    panels[0].set_ylim(len(OTHERS) - 0.5, -0.5)
    _title(figure, "Demands at which DIM does worse than …")
    lines.series_legend(figure, GATES, 0.012, 0.925)
    figure.text(
        0.012, 0.845, "pale bar: demands at which DIM does worse     marker and line: where that "
        "begins, with its 95 % interval", fontsize=8.5, color=style.INK, va="center",
    )  # fmt: skip
    lines.footnote(figure, missing_note([results], lambda _: True))
    return figure


def _draw_crossing(axes: Axes, found: Crossing, gate: str, y: float) -> None:
    look = style.look(gate)
    low, high = found.tried

    def shown(value: float) -> float:
        return min(max(value, low), high)

    if found.density < math.inf:
        axes.barh(
            [y], shown(found.until) - shown(found.density), left=shown(found.density), height=0.24,
            color=look.colour, alpha=0.35, zorder=2,
        )  # fmt: skip
    elif not math.isfinite(found.low):
        axes.text(high, y, "nowhere", ha="right", va="center", fontsize=8.5, color=style.MUTED)
    if math.isfinite(found.low) or math.isfinite(found.high):
        axes.plot(
            [shown(found.low), shown(found.high)], [y, y], color=look.colour, marker="|",
            markersize=8.0, markeredgewidth=1.6, linewidth=1.6, zorder=3,
        )  # fmt: skip
    if math.isfinite(found.density):
        axes.plot([found.density], [y], marker=look.marker, color=look.colour, markersize=5.5,
                  zorder=4)  # fmt: skip


def gate_figure(archive: Archive) -> Figure:
    """The paper's gate against the harmonious one on three, four and five arms; errors as above."""
    (results,) = archive.need("gate")
    figure = style.new_figure(11.0, 4.7)
    panels = figure.subplots(1, 3, sharey=True)
    figure.subplots_adjust(left=0.06, right=0.985, top=0.745, bottom=0.15, wspace=0.06)
    for axes, arms in zip(panels, (3, 4, 5), strict=True):
        rows = results.good[results.good["arms"] == arms]
        lines.draw_means(axes, rows, METRICS["waiting time"], GATES)
        style.plot_axes(axes, f"{arms} arms", lines.DENSITY_LABEL, "")
        lines.log_time(axes, 0.0, 500.0, linear=0.1)
        axes.set_xticks(DENSITIES)
        axes.set_xlim(DENSITIES[0] - 14, DENSITIES[-1] + 14)
    panels[0].set_ylabel(
        f"mean waiting [s], {lines.scale_words(0.1)}", fontsize=9.5, color=style.INK
    )
    _title(figure, "Two gates: nobody crossing, or in harmony with everybody who crosses")
    lines.series_legend(figure, GATES, 0.012, 0.925)
    lines.marks_legend(figure, 0.012, 0.865, paper=False)
    lines.footnote(figure, missing_note([results], lambda _: True))
    return figure


def fairness_figure(archive: Archive) -> Figure:
    """Who waits under fixed, rotating and longest-waiting priority; errors as above."""
    (results,) = archive.need("fairness")
    rows = lane_waits(results.good, 4)
    figure = style.new_figure(11.0, 4.7)
    by_lane, worst, spread = figure.subplots(1, 3)
    figure.subplots_adjust(left=0.055, right=0.985, top=0.745, bottom=0.15, wspace=0.22)
    compared = min(set(rows["density"]), key=lambda density: abs(density - LANE_DENSITY))
    _draw_lanes(by_lane, rows[rows["density"] == compared])
    style.plot_axes(by_lane, f"By lane, {compared:g} veh/h/lane", "lane", "mean waiting [s]")
    for axes, metric, title, label in (
        (worst, "worst_lane_s", "Worst lane", f"its mean waiting [s], {lines.scale_words(0.1)}"),
        (spread, "gini", "Inequality between lanes", "Gini coefficient of the lanes' means"),
    ):
        lines.draw_means(axes, rows, metric, PRIORITIES)
        style.plot_axes(axes, title, lines.DENSITY_LABEL, label)
        axes.set_xticks(DENSITIES)
        axes.set_xlim(DENSITIES[0] - 14, DENSITIES[-1] + 14)
    lines.log_time(worst, 0.0, 500.0, linear=0.1)
    spread.set_ylim(0.0, 0.8)
    by_lane.set_ylim(bottom=0.0)
    _title(figure, "Fixed, rotating and longest-waiting priority on four arms, profile fair")
    lines.series_legend(figure, PRIORITIES, 0.012, 0.925)
    lines.marks_legend(figure, 0.012, 0.865, paper=False)
    lines.footnote(figure, missing_note([results], lambda _: True))
    return figure


def _draw_lanes(axes: Axes, rows: object) -> None:
    import pandas as pd

    if not isinstance(rows, pd.DataFrame) or rows.empty:
        return
    for place, name in enumerate(PRIORITIES):
        look, chosen = style.look(name), rows[rows["series"] == name]
        if chosen.empty:
            continue
        means = [
            mean_interval(chosen[LANE_WAIT.format(lane)].astype(float).tolist())
            for lane in ARM_NAMES[:4]
        ]
        axes.errorbar(
            [k + 0.09 * (place - 1) for k in range(4)], [m.mean for m in means],
            yerr=[m.half_width for m in means], color=look.colour, marker=look.marker,
            linestyle="none", capsize=2.6, markersize=6.0, elinewidth=1.1,
        )  # fmt: skip
    axes.set_xticks(range(4), list(ARM_NAMES[:4]))


def capacity_figure(archive: Archive) -> Figure:
    """The largest demand served without a growing queue, by controller and arms.

    Raises:
        MissingRunsError: nothing was run.
    """
    found, missing = archive.capacities()
    figure = style.new_figure(9.2, 5.2)
    axes = figure.add_axes((0.2, 0.15, 0.78, 0.67))
    ends = [end for c in found for bracket in c.brackets for end in bracket if end < math.inf]
    highest = 100.0 * math.ceil(1.04 * max(ends) / 100.0)
    for capacity in found:
        _draw_capacity(axes, capacity, highest)
    style.plot_axes(axes, "", "capacity [veh/h/lane]", "")
    axes.grid(axis="x", color=style.FAINT, linewidth=0.8)
    axes.grid(axis="y", visible=False)
    axes.set_yticks(range(len(RIVALS)), [style.look(name).label for name in RIVALS])
    axes.set_ylim(len(RIVALS) - 0.5, -0.5)
    for edge in range(1, len(RIVALS)):
        axes.axhline(edge - 0.5, color=style.FAINT, linewidth=0.8)
    axes.set_xlim(0.0, highest)
    _title(figure, "Capacity: the largest demand served without a growing queue")
    handles = [
        Line2D([], [], color=colour, marker=marker, linestyle="none", markersize=6.5)
        for colour, marker in ARMS.values()
    ]
    figure.legend(
        handles, [f"{arms} arms" for arms in ARMS], loc="upper left", ncols=len(ARMS),
        bbox_to_anchor=(0.012, 0.91), frameon=False, fontsize=9.5, labelcolor=style.INK,
        borderaxespad=0.0,
    )  # fmt: skip
    search = archive.search
    note = f"{smoke_test(archive.effort)}" + (
        f"Mean and 95 % interval over {search.seeds} seeds of {search.horizon:g} s, with the "
        f"{search.step / 2.0:g} veh/h/lane by which the search rounds; profile fair.  Pale line: "
        "a bound is all that is known."
    )
    if missing:
        note += f"  Not drawn, for there is no run: {len(missing)} of {len(CASES)} cases."
    lines.footnote(figure, note)
    return figure


def _draw_capacity(axes: Axes, capacity: Capacity, highest: float) -> None:
    """Mean and interval; a pale line where only a bound is known."""
    colour, marker = ARMS[capacity.case.arms]
    place = RIVALS.index(capacity.case.series) + 0.17 * (capacity.case.arms - 4.5)
    low, high = capacity.above, capacity.below
    if low is None and high is None:
        mean, half, _ = capacity.interval
        axes.errorbar(
            [mean], [place], xerr=[0.0 if math.isnan(half) else half], color=colour, marker=marker,
            linestyle="none", markersize=6.5, capsize=2.6, elinewidth=1.2,
        )  # fmt: skip
        return
    ends = (0.0 if low is None else low, highest if high is None else high)
    axes.plot(ends, [place, place], color=colour, alpha=0.35, linewidth=3.0)


def _title(figure: Figure, text: str) -> None:
    figure.text(0.012, 0.965, text, fontsize=13, fontweight="bold", color=style.INK, va="center")


def crossing_rows(found: Mapping[tuple[str, str, str], Crossing]) -> Sequence[tuple[str, ...]]:
    """The crossings as cells of a table: rival, measure, and both gates with their intervals."""
    rows = []
    for rival in OTHERS:
        for name in METRICS:
            cells = [found.get((name, gate, rival)) for gate in GATES]
            if any(cells):
                rows.append((
                    style.look(rival).label, name,
                    *(text for c in cells for text in ((c.point, c.interval) if c else ("–", "–"))),
                ))  # fmt: skip
    return rows
