"""`minisim train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar


@app.command(
    epilog="CMA-ES on the weights of a linear policy for four arms: which of the vehicles that "
    "wait go first, as far as that is safe. Writes DIR/learnt.json (weights, and what each "
    "generation cost), DIR/learnt.csv (the runs of the comparison) and DIR/learnt.png. Needs the "
    "extra gym. See docs/howto/learning.md.\n\n"
    "minisim train --generations 20 --out try"
)
def train(
    generations: Annotated[int, option("Of the evolution strategy.", "N")] = 200,
    density: Annotated[
        float, option("Mean inflow per lane in training.", "VEH/H", "--density", "-d")
    ] = 450.0,
    seed: options.Seed = 0,
    runs: Annotated[int, option("Of the comparison, for each controller and demand.", "N")] = 10,
    jobs: options.Jobs = None,
    out: options.Folder = Path("learnt"),
) -> None:
    """Train a policy from scratch, and compare it with others on arrivals that it has not seen."""
    from minisim.errors import integer

    integer("--runs", runs, low=2)
    import scenarios.environments  # noqa: F401  (says what to install)
    from figures.learning import learning_figure, learning_table
    from figures.style import save
    from minisim.files import make_folder, write_table
    from scenarios.environments.evaluation import compared
    from scenarios.environments.training import train as trained
    from scenarios.library import four_way
    from scenarios.optimum import DELAY

    workers = options.processes(jobs)
    folder = make_folder(out)
    scenario = four_way(density, profile="fair", horizon=600.0, warmup=0.0)
    with bar("training") as progress:
        done = trained(scenario, generations=generations, seed=seed, told=progress)
    done.save(folder / "learnt.json")
    with bar("comparing") as progress:
        rows = compared(done.weights, seeds=runs, jobs=workers, progress=progress)
    write_table(rows, folder / "learnt.csv")
    good = rows[rows[DELAY.name].notna()]
    if len(good) < len(rows):
        why = next(iter(rows["error"].dropna()), "no reason is known")
        failed = f"{len(rows) - len(good)} of {len(rows)} runs failed"
        typer.echo(f"minisim: {failed}, and are left out: {why}", err=True)
    save(learning_figure(done, good), folder / "learnt.png")
    typer.echo(learning_table(good).markdown())
    typer.echo(f"  wrote learnt.json, learnt.csv and learnt.png to {folder}")
