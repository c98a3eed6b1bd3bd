"""How far every controller is above the least delay that is possible."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from figures import plots, style
from figures.studies.shared.families import Panel, panels_by_family
from figures.studies.shared.section import Item, Section
from figures.tables import Table
from scenarios.controllers import RIVALS
from scenarios.optimum import ABOVE, LEAST
from scenarios.statistics import mean_interval
from scenarios.studies.optimum import DENSITIES, SCHEDULE
from scenarios.studies.shared.archive import missing_note
from scenarios.studies.shared.study import Results

SERIES = (SCHEDULE, *RIVALS)


def optimum_figure(results: Results) -> Figure:
    """Percent above the least delay over demand, on three, four and five arms."""
    rows = results.good
    columns = [Panel(f"{n} arms", rows[rows["arms"] == n], ABOVE.name) for n in (3, 4, 5)]
    figure, grid = panels_by_family(SERIES, columns, left=0.08)
    for axes in grid.flat:
        plots.log_time(axes, 5.0, 40_000.0)
        plots.density_axis(axes, rows["density"])
    for axes in grid[:, 0]:
        axes.set_ylabel("mean delay above the least\npossible [%], logarithmic", **style.LABEL)
    note = (
        f"{missing_note(results)}  Vehicles come for half of that time, and every one counts.  95 "
        "% intervals over seeds.  The schedule knows all arrivals beforehand."
    )
    title = "Mean delay above the least that is possible, profile fair"
    plots.frame(figure, title, (), note)
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
            rows.append((f"{arms}", style.look(name).label, *_cells(chosen, ABOVE.name, 0)))
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
