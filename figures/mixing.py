"""How human drivers and vehicles of DIM fare beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from figures import lines, style
from scenarios.statistics import mean_interval
from scenarios.studies.archive import Archive, missing_note
from scenarios.studies.study import HUMAN_DENSITIES, HUMAN_GATES, HUMAN_SHARES, STOP
from scenarios.sweep.cells import saturated

if TYPE_CHECKING:
    import pandas as pd

#: Group of vehicles in a row -> its look: colour and marker tell who, the line tells the gate.
GROUPS: Mapping[str, style.Look] = MappingProxyType({
    "human": style.Look("human drivers", style.VERMILLION, "s", "-"),
    "automated": style.Look("vehicles of DIM", style.BLUE, "o", "-"),
})  # fmt: skip
#: Gate -> line.
DASHES: Mapping[str, Literal["-", ":"]] = MappingProxyType({"dim": "-", "dim:gate=harmonious": ":"})
#: Sideways shift of the second gate [%], so that bars do not cover each other.
SHIFT = 1.2


def human_figure(archive: Archive) -> Figure:
    """Delay of human drivers and of vehicles of DIM over the share of humans.

    Raises:
        MissingRunsError: nothing was run.
    """
    (results,) = archive.need("humans")
    rows = results.good
    figure = style.new_figure(11.0, 4.9)
    run = [density for density in HUMAN_DENSITIES if (rows["density"] == density).any()]
    panels = figure.subplots(1, len(run), sharey=True, squeeze=False)[0]
    figure.subplots_adjust(left=0.062, right=0.985, top=0.735, bottom=0.145, wspace=0.06)
    for axes, density in zip(panels, run, strict=True):
        chosen = rows[rows["density"] == density]
        for gate in HUMAN_GATES:
            for group in GROUPS:
                _draw_group(axes, chosen[chosen["series"] == gate], group, gate)
        _draw_stop(axes, chosen[chosen["series"] == STOP])
        style.plot_axes(axes, f"{density:g} veh/h/lane", "human drivers [%]", "")
        axes.set_xticks([100.0 * share for share in HUMAN_SHARES])
        lines.log_time(axes, 1.0, 1000.0)
    panels[0].set_ylabel(
        "mean delay of all vehicles [s], logarithmic", fontsize=9.5, color=style.INK
    )
    figure.text(
        0.012, 0.965, "Human drivers among vehicles of DIM on four arms, profile fair",
        fontsize=13, fontweight="bold", color=style.INK, va="center",
    )  # fmt: skip
    _legend(figure)
    lines.marks_legend(figure, 0.012, 0.842, paper=False)
    lines.footnote(figure, (
        f"{missing_note([results], lambda _: True)}  Delay is time loss and departure delay, up to "
        "the end of the run for who had not left it."
    ))  # fmt: skip
    return figure


def delays(rows: pd.DataFrame, group: str) -> pd.Series[float]:
    """Time loss and departure delay of a group in each row [s]; NaN where it has nobody."""
    import pandas as pd

    parts = pd.DataFrame(index=rows.index)
    for metric in ("complete_time_loss_s", "complete_depart_delay_s"):
        column = rows.get(f"kinds_{group}_{metric}", pd.Series(index=rows.index, dtype=float))
        alone = rows[metric].where((rows["humans"] == 0.0) & (group == "automated"))
        parts[metric] = column.astype(float).fillna(alone)
    return parts.sum(axis=1, skipna=False)


def _draw_group(axes: Axes, rows: pd.DataFrame, group: str, gate: str) -> None:
    """One line over shares, with an arrow where the queue still grew."""
    look = GROUPS[group]
    shift = SHIFT * (HUMAN_GATES.index(gate) - 0.5)
    rows = rows.assign(delay=delays(rows, group))
    points = [
        (100.0 * float(str(share)) + shift, mean_interval(cell["delay"].tolist()), saturated(cell))
        for share, cell in rows[rows["delay"].notna()].groupby("humans")
    ]
    if not points:
        return
    x, y = [place for place, _, _ in points], [interval.mean for _, interval, _ in points]
    half = [interval.half_width if interval.size > 1 else 0.0 for _, interval, _ in points]
    axes.errorbar(
        x, y, yerr=half, color=look.colour, marker=look.marker, linestyle=DASHES[gate],
        linewidth=1.7, markersize=5.0, capsize=2.6, elinewidth=1.1, zorder=3,
    )  # fmt: skip
    for place, mean, bar, (_, _, grown) in zip(x, y, half, points, strict=True):
        if grown:
            lines.growth_arrow(axes, place, mean + bar, look.colour)


def _draw_stop(axes: Axes, rows: pd.DataFrame) -> None:
    """The all-way stop, which knows where everybody goes, as a level."""
    if rows.empty:
        return
    level = rows["complete_time_loss_s"] + rows["complete_depart_delay_s"]
    look = style.look(STOP)
    axes.axhline(float(level.mean()), color=look.colour, linestyle=look.dashes, linewidth=1.1)


def _legend(figure: Figure) -> None:
    handles = [
        Line2D([], [], color=look.colour, marker=look.marker, linestyle=DASHES[gate])
        for gate in HUMAN_GATES
        for look in GROUPS.values()
    ]
    labels = [
        f"{look.label}, gate {gate.removeprefix('dim').strip('-') or 'clear'}"
        for gate in HUMAN_GATES
        for look in GROUPS.values()
    ]
    stop = style.look(STOP)
    handles.append(Line2D([], [], color=stop.colour, linestyle=stop.dashes, linewidth=1.1))
    figure.legend(
        handles, [*labels, "all-way stop (mean)"], loc="upper left", ncols=3, frameon=False,
        bbox_to_anchor=(0.012, 0.935), fontsize=9.0, labelcolor=style.INK, borderaxespad=0.0,
        columnspacing=1.7, handlelength=2.4,
    )  # fmt: skip
