"""How human drivers and vehicles of DIM fare beside each other."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from scenarios.studies.fair import GATES
from scenarios.studies.humans import DENSITIES, SHARES, STOP, delays
from scenarios.studies.shared.archive import Archive, missing_note
from scenarios.studies.shared.delay import TOTAL_DELAY, with_total_delay
from scenarios.sweep.cells import saturated

if TYPE_CHECKING:
    import pandas as pd

#: Gate -> its name and line.
LINES: Mapping[str, tuple[str, Literal["-", ":"]]] = MappingProxyType(
    dict(zip(GATES, (("clear", "-"), ("harmonious", ":")), strict=True))
)
#: (group of vehicles, gate) -> look: colour and marker tell the group, the line tells the gate.
LOOKS: Mapping[tuple[str, str], style.Look] = MappingProxyType(
    {
        (group, gate): style.Look(f"{words}, gate {name}", colour, marker, dashes)
        for gate, (name, dashes) in LINES.items()
        for group, words, colour, marker in (
            ("human", "human drivers", style.VERMILLION, "s"),
            ("automated", "vehicles of DIM", style.BLUE, "o"),
        )
    }
)
#: Sideways shift of the second gate [%], so that bars do not cover each other.
SHIFT = 1.2


def human_figure(archive: Archive) -> Figure:
    """Delay of human drivers and of vehicles of DIM over the share of humans.

    Raises:
        MissingRunsError: nothing was run.
    """
    (results,) = archive.need("humans")
    rows = results.good
    run = [density for density in DENSITIES if (rows["density"] == density).any()]
    figure, panels = plots.panels(
        11.0, 4.9, len(run), left=0.062, right=0.985, top=0.735, bottom=0.145, wspace=0.06
    )
    stop = style.look(STOP)._replace(label="all-way stop (mean)", marker="")
    for axes, density in zip(panels, run, strict=True):
        chosen = rows[rows["density"] == density]
        for (group, gate), look in LOOKS.items():
            _draw_group(axes, chosen[chosen["series"] == gate], group, gate, look)
        level = with_total_delay(chosen[chosen["series"] == STOP])[TOTAL_DELAY]
        if not level.empty:
            axes.axhline(float(level.mean()), color=stop.colour, linestyle=stop.dashes,
                         linewidth=1.1)  # fmt: skip
        style.plot_axes(axes, f"{density:g} veh/h/lane", "human drivers [%]", "")
        axes.set_xticks([100.0 * share for share in SHARES])
        plots.log_time(axes, 1.0, 1000.0)
    plots.ylabel(panels[0], "mean delay of all vehicles [s], logarithmic")
    plots.heading(figure, "Human drivers among vehicles of DIM on four arms, profile fair")
    plots.looks_legend(figure, [*LOOKS.values(), stop], 0.012, 0.935, 3, fontsize=9.0)
    plots.marks_legend(figure, 0.012, 0.842, paper=False)
    plots.footnote(figure, (
        f"{missing_note([results])}  Delay is time loss and departure delay, up to the end of the "
        "run for vehicles that had not left it."
    ))  # fmt: skip
    return figure


def _draw_group(axes: Axes, rows: pd.DataFrame, group: str, gate: str, look: style.Look) -> None:
    """One line over shares."""
    rows = rows.assign(delay=delays(rows, group))
    cells = list(rows[rows["delay"].notna()].groupby("humans"))
    if cells:
        shift = SHIFT * (GATES.index(gate) - 0.5)
        plots.draw_line(
            axes, [100.0 * float(str(share)) + shift for share, _ in cells],
            [plots.mean_estimate(cell["delay"]) for _, cell in cells], look,
            [saturated(cell) for _, cell in cells],
        )  # fmt: skip


SECTION = Section(
    "Human drivers",
    (Item("humans", "delay over the share of human drivers", human_figure, ("humans",)),),
)
