"""The tour of `minisim demo`: DIM and a fixed-time signal at several densities."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from minisim.errors import InputError, MinisimError, plural
from minisim.files import markdown_table, write_table, write_text
from minisim.parameters import Reals, declared, real, reals, whole
from minisim.results.metrics import heading
from minisim.version import __version__
from scenarios.controllers import controller_named, label_of
from scenarios.library import four_way
from scenarios.recipe import Recipe
from scenarios.statistics import Interval, mean_interval
from scenarios.sweep import sweep
from scenarios.sweep.pool import workers

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

#: Columns of a sweep that are averaged over seeds.
METRICS = ("waiting_time_s", "travel_time_s", "depart_delay_s", "unfinished")

#: Of the table.
HEADINGS = ("veh/h/lane", "controller", *map(heading, METRICS), "collisions")

PROFILE = "fair"


@declared(kw_only=True)
class Tour:
    """What the tour simulates."""

    densities: Reals[tuple[float, ...]] = reals(
        "mean inflows per lane", "veh/h/lane", default=(150.0, 200.0, 250.0, 300.0, 350.0)
    )
    seeds: int = whole("runs per point", low=2, default=5)
    horizon: float = real("of each run", "s", above=0, default=3600.0)
    film_start: float = real("of the animation, at the highest density", "s", low=0, default=600.0)
    film_seconds: float = real("length of the animation", "s", above=0, default=60.0)
    controllers: tuple[str, ...] = ("dim", "dim:gate=harmonious", "fixed-time")

    def __post_init__(self) -> None:
        if not self.densities:
            raise InputError("a tour needs at least one density [veh/h/lane]")

    @classmethod
    def quick(cls, seeds: int = 2) -> Tour:
        """A smoke test of a few seconds."""
        return cls(
            densities=(150.0, 350.0), seeds=seeds, horizon=600.0, film_start=120.0,
            film_seconds=10.0,
        )  # fmt: skip

    def recipes(self) -> list[Recipe]:
        """Every density with every controller and seed."""
        return [
            _recipe(density, name, seed, self.horizon)
            for density in self.densities
            for name in self.controllers
            for seed in range(1, self.seeds + 1)
        ]

    def film(self) -> Run:
        """The run of the animation."""
        end = self.film_start + self.film_seconds
        recipe = _recipe(self.densities[-1], self.controllers[0], 1, end)
        return recipe.run(record="all", record_window=(self.film_start, end))


def _recipe(density: float, controller: str, seed: int, horizon: float) -> Recipe:
    scenario = four_way(density, profile=PROFILE, horizon=horizon)
    return Recipe(scenario, controller_named(controller, PROFILE), seed)


def run_tour(tour: Tour, jobs: int, progress: Callable[[int, int], None]) -> pd.DataFrame:
    """Run the tour and `average` its rows; raises `MinisimError` if a run failed."""
    with workers(jobs) as executor:
        rows = sweep(tour.recipes(), executor, progress)
    failed = rows[rows["error"].notna()]
    if len(failed):
        first = failed.iloc[0]
        raise MinisimError(
            f"{len(failed)} of {plural(len(rows), 'run')} failed; the first "
            f"({first['controller']}, {first['density']:g} veh/h/lane, seed {first['seed']}): "
            f"{first['error']}"
        )
    return average(rows)


def average(rows: pd.DataFrame) -> pd.DataFrame:
    """Means over seeds: one row per controller and density.

    Columns: `controller`, `density`, `seeds`, the sums `trips` and `collisions`, and each of
    `METRICS` with `…_ci95`, the half width of its 95 % interval.
    """
    runs = rows.groupby(["controller", "density"], sort=False)
    points = runs.agg(
        seeds=("seed", "size"), trips=("trips", "sum"), collisions=("collisions", "sum")
    ).astype(int)
    for metric in METRICS:
        intervals = [mean_interval(values) for _, values in runs[metric]]
        points[metric] = [interval.mean for interval in intervals]
        points[f"{metric}_ci95"] = [interval.half_width for interval in intervals]
    return points.reset_index()


def demo_title(tour: Tour) -> str:
    """What the table shows, in one line."""
    return (
        f"4 arms, profile {PROFILE}, {tour.horizon:g} s simulated, "
        f"{plural(tour.seeds, 'seed')} per point: mean ± 95 % confidence interval"
    )


def demo_table(points: pd.DataFrame) -> Table:
    """The points as a table for a terminal."""
    table = Table(box=box.SIMPLE_HEAD)
    for k, title in enumerate(HEADINGS):
        table.add_column(title, justify="left" if k == 1 else "right")
    for _, rows in itertools.groupby(_cells(points), key=lambda row: row[0]):
        for row in rows:
            table.add_row(*row)
        table.add_section()
    return table


def write_tables(points: pd.DataFrame, tour: Tour, folder: Path) -> None:
    """Write demo.csv and demo.md; raises `FileError`."""
    write_table(points, folder / "demo.csv")
    table = markdown_table(HEADINGS, _cells(points), words=(1,))
    write_text(folder / "demo.md", f"{demo_title(tour)}. minisim {__version__}.\n\n{table}\n")


def _cells(points: pd.DataFrame) -> list[list[str]]:
    cells = []
    for point in points.to_dict("records"):
        name = label_of(point["controller"])
        means = (Interval(point[m], point[f"{m}_ci95"], point["seeds"]) for m in METRICS)
        cells.append([f"{point['density']:g}", name, *map(str, means), str(point["collisions"])])
    return cells
