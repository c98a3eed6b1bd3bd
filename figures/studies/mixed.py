"""Every controller with cars alone, and with the vehicles of Indian roads."""

from __future__ import annotations

from itertools import product

from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.controllers import RIVALS
from scenarios.statistics import mean_interval
from scenarios.studies.fair import GATES, MEASURES, paired_differences
from scenarios.studies.mixed import FLEETS
from scenarios.studies.shared.archive import MissingRunsError, missing_note
from scenarios.studies.shared.study import Results

WAITING = MEASURES["waiting time"]
ARMS = (3, 4, 5)
WORDS = {"car": "cars alone", "india": "vehicles registered in India"}
DENSITY_LABEL = "demand [PCU/h/lane]"
#: The controllers with which the paper compares DIM.
COMPARED = ("fixed-time", "adaptive", "v2ic")
#: Those that the figure names; it has the others pale behind them.
SHOWN = (*GATES, *COMPARED)


def mixed_figure(results: Results) -> Figure:
    """Waiting over demand: a row for each fleet, a panel for each junction."""
    figure = style.new_figure(11.0, 8.0)
    grid = figure.subplots(
        len(FLEETS), len(ARMS), sharex=True, sharey=True,
        gridspec_kw={"left": 0.06, "right": 0.985, "top": 0.80, "bottom": 0.09, "wspace": 0.06,
                     "hspace": 0.16},
    )  # fmt: skip
    for (row, fleet), (column, arms) in product(enumerate(FLEETS), enumerate(ARMS)):
        axes, good = grid[row, column], results.good
        rows = good[(good["arms"] == arms) & (good["fleet"] == fleet)]
        plots.draw_means(axes, rows, WAITING, SHOWN, RIVALS)
        label = DENSITY_LABEL if fleet == FLEETS[-1] else ""
        style.plot_axes(axes, f"{arms} arms, {WORDS[fleet]}", label, "")
        plots.log_time(axes, 0.0, 500.0, linear=0.1)
        plots.density_axis(axes)
    for axes in grid[:, 0]:
        axes.set_ylabel(f"mean waiting [s], {plots.scale_words(0.1)}", **style.LABEL)
    title = "The same demand in passenger car units, as cars and as Indian vehicles"
    looks = [*map(style.look, SHOWN), plots.OTHERS]
    plots.frame(figure, title, looks, missing_note(results), ncols=4, marks=0.87)
    return figure


def differences(results: Results, rival: str, gate: str) -> dict[tuple[int, float], str]:
    """DIM's mean waiting minus a rival's, with Indian vehicles: (arms, demand) -> text [s]."""
    good = results.good
    words = {}
    for arms in ARMS:
        rows = good[(good["arms"] == arms) & (good["fleet"] == "india")]
        for density, each in paired_differences(rows, gate, rival, WAITING).items():
            mean, half, _ = mean_interval(each)
            words[arms, density] = f"{mean:+.1f} ± {half:.1f}"
    return words


def mixed_table(results: Results) -> Table:
    """How much longer vehicles wait under DIM than under the paper's rivals, Indian fleet."""
    rows = []
    for rival, gate in product(COMPARED, GATES):
        known = differences(results, rival, gate)
        for arms in ARMS:
            texts = {density: text for (n, density), text in known.items() if n == arms}
            if texts:
                rows.append((style.look(gate).label, style.look(rival).label, str(arms), texts))
    if not rows:
        raise MissingRunsError(
            "the store has no demand at which DIM and a rival have two seeds in common; make such "
            f"runs with: {results.effort.command('mixed')}"
        )
    densities = sorted({density for *_, texts in rows for density in texts})
    return Table(
        "DIM's mean waiting minus a rival's, with the vehicles registered in India [s]",
        ("controller", "minus", "arms", *(f"{density:g}" for density in densities)),
        tuple((*names, *(texts.get(d, "–") for d in densities)) for *names, texts in rows),
        labels=3,
        notes=(
            f"{missing_note(results)}  A column is a demand in PCU/h/lane (IRC:106-1990). Means "
            "are over all vehicles, those still on the road too; differences are paired by common "
            "arrivals, ± half a 95 % interval. Profile fair, lanes of 3.5 m.",
        ),
    )


SECTION = Section(
    "Does it hold for the traffic that the paper names?",
    (
        Item("mixed", "cars alone against Indian vehicles", mixed_figure, ("mixed",)),
        Item("mixed-table", "DIM against its rivals in numbers", mixed_table, ("mixed",)),
    ),
)
