"""`minisim demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import integer
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import bar, show


@app.command(
    epilog="Simulates an hour of the 4-arm junction at 150 to 350 veh/h/lane under DIM with the "
    "paper's gate, DIM with the harmonious gate, and a fixed-time signal, all with the same "
    "vehicles and arrivals. Prints a table with 95 % confidence intervals and writes demo.csv, "
    "demo.md, demo.png and demo.gif."
)
def demo(
    out: options.Folder = Path("out"),
    seeds: Annotated[
        int | None, options.option("Runs per point, 2 … 1000; 5 by default, 2 with --quick.")
    ] = None,
    jobs: options.Jobs = None,
    quick: options.Quick = False,
) -> None:
    """The tour: DIM beside a fixed-time signal, in under a minute."""
    from minisim.files import make_folder
    from scenarios.demo import Tour, demo_table, demo_title, run_tour, write_tables

    runs = (2 if quick else 5) if seeds is None else integer("--seeds", seeds, low=2, high=1000)
    tour = Tour.quick(runs) if quick else Tour(seeds=runs)
    workers = options.processes(jobs)
    folder = make_folder(out)
    with bar("starting"):
        film = tour.film()  # first: it compiles the kernel once for all processes
    with bar("simulating") as progress:
        points = run_tour(tour, workers, progress)
    from figures.demo import performance_figure
    from figures.film.animate import write_animation
    from figures.style import save

    write_tables(points, tour, folder)
    save(performance_figure(points, demo_title(tour)), folder / "demo.png")
    when = {"start": tour.film_start, "seconds": tour.film_seconds}
    with bar("drawing") as progress:
        write_animation(film, folder / "demo.gif", **when, progress=progress)
    typer.echo(demo_title(tour))
    show(demo_table(points))
    for name in ("demo.csv", "demo.md", "demo.png", "demo.gif"):
        typer.echo(f"  wrote {folder / name}")
