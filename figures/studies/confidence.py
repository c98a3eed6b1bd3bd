"""Effects of misread intents when vehicles believe only readings above some confidence."""

from __future__ import annotations

from matplotlib.figure import Figure

from dim.senses.noise import CLASSIFIER
from figures import plots
from figures.studies.shared import outcomes
from figures.studies.shared.section import Item, Section
from scenarios.studies.confidence import THRESHOLDS
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results, with_total_delay


def confidence_figure(results: Results) -> Figure:
    """Collisions, false grants and delay, plotted against the confidence threshold."""
    rows = with_total_delay(results.good)
    figure, panels = plots.panels(
        11.5, 4.6, len(outcomes.OUTCOMES), sharey=False, left=0.07, right=0.988, top=0.79,
        bottom=0.155, wspace=0.28,
    )  # fmt: skip
    for axes, outcome in zip(panels, outcomes.OUTCOMES, strict=True):
        for (kind, look), aside in zip(outcomes.KIND_LOOKS.items(), (-0.08, 0.08), strict=True):
            cells = [outcomes.select(rows, kind=kind, confidence=level) for level in THRESHOLDS]
            places = [k + aside for k in range(len(THRESHOLDS))]
            outcomes.draw(axes, places, cells, outcome, look)
        ticks = ["any", *(f"{threshold:g}" for threshold in THRESHOLDS[1:])]
        outcomes.dress(axes, outcome, outcome, "lowest confidence that is believed", ticks)
    title = (
        f"Believing only confident readings: lanes first, {CLASSIFIER:.0%} of intents persistently "
        "misread by all"
    )
    note = f"{outcomes.NOTE}  {missing_note(results)}"
    plots.frame(figure, title, outcomes.KIND_LOOKS.values(), note)
    return figure


SECTION = Section(
    "Believing only confident readings",
    (
        Item("confidence", "collisions, false grants and delay by the lowest confidence believed",
             confidence_figure, ("confidence",)),
    ),
)  # fmt: skip
