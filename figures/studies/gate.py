"""The paper's gate against the others."""

from __future__ import annotations

from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from scenarios.studies.fair import GATES, MEASURES
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results


def gate_figure(results: Results) -> Figure:
    """All gates on three, four and five arms."""
    figure, panels = plots.panels(
        11.0, 4.7, 3, left=0.06, right=0.985, top=0.745, bottom=0.15, wspace=0.06
    )
    for axes, arms in zip(panels, (3, 4, 5), strict=True):
        rows = results.good[results.good["arms"] == arms]
        plots.draw_means(axes, rows, MEASURES["waiting time"], GATES)
        style.plot_axes(axes, f"{arms} arms", plots.DENSITY_LABEL, "")
        plots.log_time(axes, 0.0, 500.0, linear=0.1)
        plots.density_axis(axes)
    panels[0].set_ylabel(f"mean waiting [s], {plots.scale_words(0.1)}", **style.LABEL)
    title = "DIM's gates: which vehicles may enter while others cross"
    plots.frame(figure, title, map(style.look, GATES), missing_note(results), marks=0.865)
    return figure


SECTION = Section(
    "How far do other gates move it?",
    (Item("gate", "the gates of DIM", gate_figure, ("gate",)),),
)
