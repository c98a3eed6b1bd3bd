"""Delays of human drivers and of DIM's vehicles on the same roads."""

from __future__ import annotations

from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from scenarios.studies.humans import DENSITIES, GATES, SHARES, STOP, delays
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import TOTAL_DELAY, Results, with_total_delay

#: (group of vehicles, gate) -> look; vehicles of DIM look as elsewhere.
LOOKS = {
    ("human", GATES[0]): style.Look("human drivers, gate clear", style.VERMILLION, "s", "-"),
    ("automated", GATES[0]): style.look(GATES[0])._replace(label="vehicles of DIM, gate clear"),
    ("human", GATES[1]): style.Look("human drivers, gate harmonious", style.ORANGE, "D", ":"),
    ("automated", GATES[1]): style.look(GATES[1])._replace(
        label="vehicles of DIM, gate harmonious"
    ),
}
#: Sideways shift between the gates [%], so that error bars do not overlap.
SHIFT = 1.2


def human_figure(results: Results) -> Figure:
    """Delay of human drivers and of DIM's vehicles against the share of humans."""
    rows = results.good
    run = [density for density in DENSITIES if (rows["density"] == density).any()]
    figure, panels = plots.panels(
        11.0, 4.9, len(run), left=0.062, right=0.985, top=0.715, bottom=0.145, wspace=0.06
    )
    stop = style.look(STOP)._replace(label="all-way stop (mean)", marker="")
    for axes, density in zip(panels, run, strict=True):
        chosen = rows[rows["density"] == density]
        for (group, gate), look in LOOKS.items():
            delayed = chosen.assign(delay=delays(chosen, group))
            line = delayed[(delayed["series"] == gate) & delayed["delay"].notna()]
            if not line.empty:
                shift = SHIFT * (GATES.index(gate) - 0.5)
                plots.draw_over(axes, line, "humans", "delay", look, 100.0, shift)
        level = with_total_delay(chosen[chosen["series"] == STOP])[TOTAL_DELAY]
        if not level.empty:
            axes.axhline(float(level.mean()), color=stop.colour, linestyle=stop.dashes,
                         linewidth=1.1)  # fmt: skip
        style.plot_axes(axes, f"{density:g} veh/h/lane", "human drivers [%]", "")
        axes.set_xticks([100.0 * share for share in SHARES[::2]])
        plots.log_time(axes, 1.0, 2000.0)
    panels[0].set_ylabel("mean delay of each kind [s], logarithmic", **style.LABEL)
    note = (
        f"{missing_note(results)}  Delay is time loss and departure delay, up to the end of the "
        "run for vehicles still there."
    )
    title = "Human drivers among vehicles of DIM on four arms, profile fair"
    plots.frame(figure, title, [*LOOKS.values(), stop], note, ncols=3, marks=0.832)
    return figure


SECTION = Section(
    "Human drivers",
    (Item("humans", "delay over the share of human drivers", human_figure, ("humans",)),),
)
