"""How far every controller is above the least delay that is possible."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.controllers import RIVALS, label_of
from scenarios.optimum import ABOVE, LEAST
from scenarios.statistics import mean_interval
from scenarios.studies.optimum import DENSITIES, SCHEDULE
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results

SERIES = (SCHEDULE, *RIVALS)


def optimum_figure(results: Results) -> Figure:
    """Percent above the least delay over demand, on three, four and five arms."""
    rows = results.good
    figure, panels = plots.panels(
        11.5, 5.4, 3, left=0.07, right=0.99, top=0.735, bottom=0.135, wspace=0.06
    )
    for axes, arms in zip(panels, (3, 4, 5), strict=True):
        chosen = rows[rows["arms"] == arms]
        plots.draw_means(axes, chosen, ABOVE.name, SERIES)
        style.plot_axes(axes, f"{arms} arms", plots.DENSITY_LABEL, "")
        plots.log_time(axes, 5.0, 40_000.0)
        plots.density_axis(axes, rows["density"])
    panels[0].set_ylabel("mean delay above the least possible [%], logarithmic", **style.LABEL)
    note = (
        f"{missing_note(results)}  Vehicles come for half of that time, and every one counts.  The "
        "schedule knows all arrivals beforehand."
    )
    looks = map(style.look, SERIES)
    title = "Mean delay above the least that is possible, profile fair"
    plots.frame(figure, title, looks, note, ncols=4)
    return figure


def optimum_table(results: Results) -> Table:
    """The same in numbers, and the least delays themselves."""
    rows = []
    for arms in (3, 4, 5):
        good = results.good[results.good["arms"] == arms]
        once = good.drop_duplicates(["density", "seed"])
        rows.append((f"{arms}", "least delay [s]", *_cells(once, LEAST.name, 2)))
        for name in SERIES:
            chosen = good[good["series"] == name]
            rows.append((f"{arms}", label_of(name), *_cells(chosen, ABOVE.name, 0)))
    return Table(
        "Mean delay above the least possible [%], with 95 % intervals",
        ("arms", "controller", *(f"{density:g} veh/h/lane" for density in DENSITIES)),
        tuple(rows), labels=2,
        notes=(f"{missing_note(results)}  Vehicles come for half of that time.",),
    )  # fmt: skip


def _cells(rows: pd.DataFrame, column: str, digits: int) -> list[str]:
    """Mean and interval at each demand."""
    values = [
        rows[column][rows["density"] == density].dropna().astype(float).tolist()
        for density in DENSITIES
    ]
    means = [mean_interval(each) if each else None for each in values]
    return [
        "–" if it is None else f"{it.mean:.{digits}f} ± {it.half_width:.{digits}f}" for it in means
    ]


SECTION = Section(
    "Above the optimum",
    (
        Item("optimum", "delay above the least possible", optimum_figure, ("optimum",)),
        Item("optimum-table", "the same in numbers", optimum_table, ("optimum",)),
    ),
)
