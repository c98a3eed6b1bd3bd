"""Effects of misread intents against the probability of an error."""

from __future__ import annotations

from functools import partial
from itertools import product

import pandas as pd
from matplotlib.figure import Figure

from dim.senses.intent import KINDS, RATES
from dim.senses.noise import CLASSIFIER
from figures import plots, style
from figures.studies.shared import outcomes
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.statistics import mean_interval
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.intent_errors import CROSSINGS, DENSITY, MANNERS, MISREADERS, rate_of
from scenarios.studies.shared.study import TOTAL_DELAY, Results, with_total_delay

#: (shared, persistent) -> look.
LOOKS = {
    (True, True): style.Look(MANNERS[True, True], style.BLUE, "o", "-"),
    (True, False): style.Look(MANNERS[True, False], style.SKY, "p", "-"),
    (False, True): style.Look(MANNERS[False, True], style.VERMILLION, "s", "--"),
    (False, False): style.Look(MANNERS[False, False], style.ORANGE, "^", "-."),
}
#: Unsignalled turns, at the published rates.
SILENT = style.Look("turns without signal, published rates", style.INK, "", ":")


def perception_figure(results: Results, series: str) -> Figure:
    """Collisions, false grants and delay under a controller against the probability of an error."""
    rows = outcomes.select(with_total_delay(results.good), series=series)
    parts = list(product(KINDS, outcomes.OUTCOMES))
    figure, panels = plots.panels(
        11.5, 7.4, len(parts), rows=len(KINDS), sharey=False, left=0.07, right=0.988, top=0.815,
        bottom=0.095, wspace=0.28, hspace=0.42,
    )  # fmt: skip
    silent = rows[rows["unsignalled"].astype(bool)]
    signalled = rows[~rows["unsignalled"].astype(bool)]
    exact = outcomes.select(signalled, rate=0.0)
    for axes, (kind, outcome) in zip(panels, parts, strict=True):
        for place, ((shared, persistent), look) in enumerate(LOOKS.items()):
            line = outcomes.select(signalled, kind=kind, shared=shared, persistent=persistent)
            cells = [exact, *(outcomes.select(line, rate=rate) for rate in RATES[1:])]
            # Side by side, so that error bars do not overlap; ticks are evenly spaced.
            places = [k + 0.13 * (place - 1.5) for k in range(len(RATES))]
            outcomes.draw(axes, places, cells, outcome, look)
        level = outcomes.estimated(silent, outcome)
        if kind == "missed" and level is not None:
            axes.axhline(level.value, color=SILENT.colour, linestyle=SILENT.dashes, linewidth=1.4)
        outcomes.dress(axes, outcome, f"{outcome}, {outcomes.KIND_LOOKS[kind].label}",
                     "probability of an error", [f"{rate:g}" for rate in RATES])  # fmt: skip
    label = style.look(series).label
    title = f"What misread intents do: {label}, four arms, {DENSITY:g} veh/h/lane, profile fair"
    missing = missing_note(results, wanted=lambda point: point.series == series)
    note = f"{outcomes.NOTE}  {missing}"
    plots.frame(figure, title, [*LOOKS.values(), SILENT], note, ncols=3)
    return figure


def perception_table(results: Results) -> Table:
    """All outcomes at the error rate of published classifiers."""
    rows = with_total_delay(results.good)
    chosen = rows[rows["rate"].isin([0.0, CLASSIFIER])]
    keys = ["series", "rate", "unsignalled", "kind", "shared", "persistent"]
    listed = []
    for (series, rate, silent, kind, shared, persistent), cell in chosen.groupby(keys, sort=False):
        error = outcomes.KIND_LOOKS[str(kind)].label if rate else "exact"
        error = "turns without signal" if silent else error
        manner = MANNERS[bool(shared), bool(persistent)] if rate or silent else ""
        listed.append((style.look(str(series)).label, error, manner, *_outcomes(cell)))
    return Table(
        f"What misread intents do at an error rate of {CLASSIFIER:.0%}, four arms, {DENSITY:g} "
        "veh/h/lane",
        ("controller", "error", "manner", "crossings", f"collisions / {CROSSINGS:,} crossings",
         f"false grants / {CROSSINGS:,}", "disagreement [% of time]", "deadlock [% of time]",
         "unfinished [%]", "delay [s]"),
        tuple(listed), labels=3, notes=(f"{outcomes.NOTE}  {missing_note(results)}",),
    )  # fmt: skip


def _outcomes(cell: pd.DataFrame) -> tuple[str, ...]:
    seconds = float(cell["horizon_s"].sum())
    disagreement, deadlock = (
        100.0 * float(cell[column].fillna(0.0).sum()) / seconds if column in cell else 0.0
        for column in ("disagreement_s", "deadlock_s")
    )
    collisions = rate_of(cell, "collisions")
    unfinished = 100.0 * float(cell["unfinished"].sum()) / float(cell["trips"].sum())
    return (
        f"{collisions.crossings:,}" if collisions else "0", _count(cell, "collisions"),
        _count(cell, "false_grants"), f"{disagreement:.1f}", f"{deadlock:.1f}", f"{unfinished:.1f}",
        str(mean_interval(cell[TOTAL_DELAY].astype(float).tolist())),
    )  # fmt: skip


def _count(rows: pd.DataFrame, events: str) -> str:
    rate = rate_of(rows, events)
    return f"{rate.value:.0f} ({rate.low:.0f} … {rate.high:.0f})" if rate else "–"


SECTION = Section(
    "Wrong perception",
    (
        Item("perception", "collisions, false grants and delay over intent errors",
             partial(perception_figure, series=MISREADERS[0]), ("perception",)),
        Item("perception-monitored", "the same with a safety monitor in every vehicle",
             partial(perception_figure, series=MISREADERS[1]), ("perception",)),
        Item("perception-table", "outcomes of 15 % misread intents", perception_table,
             ("perception",)),
    ),
)  # fmt: skip
