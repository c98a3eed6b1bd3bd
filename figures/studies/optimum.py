"""How far every controller is above the least delay that is possible."""

from __future__ import annotations

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
        plots.log_time(axes, 5.0, 20_000.0)
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
    good = results.good
    places = [(arms, density) for arms in (3, 4, 5) for density in DENSITIES]

    def shown(series: str | None, place: tuple[int, float], column: str) -> str:
        rows = good[(good["arms"] == place[0]) & (good["density"] == place[1])]
        if series is None:
            rows = rows.drop_duplicates("seed")
        else:
            rows = rows[rows["series"] == series]
        values = rows[column].dropna().astype(float).tolist()
        if not values:
            return "–"
        it = mean_interval(values)
        return f"{it.mean:.2f}" if series is None else f"{it.mean:.0f} ± {it.half_width:.0f}"

    least = tuple(shown(None, place, LEAST.name) for place in places)
    return Table(
        "Mean delay above the least possible [%], with 95 % intervals",
        ("arms, veh/h/lane", *(f"{arms}, {density:g}" for arms, density in places)),
        (
            ("least delay [s]", *least),
            *(
                (label_of(series), *(shown(series, place, ABOVE.name) for place in places))
                for series in SERIES
            ),
        ),
        notes=(f"{missing_note(results)}  Vehicles come for half of that time.",),
    )


SECTION = Section(
    "Above the optimum",
    (
        Item("optimum", "delay above the least possible", optimum_figure, ("optimum",)),
        Item("optimum-table", "the same in numbers", optimum_table, ("optimum",)),
    ),
)
