"""`minisim sweep`."""

from __future__ import annotations

import os
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from minisim.errors import InputError, choice, integer, number, plural
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar, show
from scenarios.defaults import AXES, CUSTOM, SINGLE
from scenarios.studies import NAMES, SEARCHES, study_named
from scenarios.termination import Terminated

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import pandas as pd

    from scenarios.recipe import Recipe
    from scenarios.sweep.store import Store

#: The keys of a file, and the defaults of those that it may leave out.
KEYS = {**AXES, **SINGLE}
LEFT_OUT = ", ".join(
    f"{key} {value if isinstance(value, str) else f'{value:g}'}"
    for key, value in KEYS.items()
    if value not in (None, ())
)

#: A junction in the help text, in which brackets are escaped.
JUNCTION = CUSTOM.replace("[", r"\[")

#: Studies that are lists of experiments.
STUDIES = tuple(name for name in NAMES if name not in SEARCHES)


@app.command(
    epilog="FILE.toml lists what to combine:\n\n"
    '  scenario = \\["four-way", "five-way"]\n\n'
    '  controller = \\["dim", "fixed-time"]\n\n'
    "  density = \\[150, 250, 350]\n\n"
    f"and also any other of {', '.join(KEYS)} (minisim metrics lists metrics; mymodule:name is "
    f"yours). What it leaves out is {LEFT_OUT}. Your own junction is written\n\n"
    f"  scenario = {JUNCTION}\n\n"
    "\\[\\[experiment]] begins a block of its own. A run that failed is tried again the next time; "
    "a stored one is not repeated, whether a file, a study or [bold]minisim reproduce[/bold] asked "
    "for it.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim sweep fair --seeds 3 --out fair.db --export fair.csv\n\n"
    "minisim sweep mine.toml --jobs 2 --out mine.db --export mine.csv\n\n"
    "minisim sweep mine.toml --scheduler tcp://10.0.0.1:8786 --out mine.db\n\n"
    "[bold]Exit codes[/bold]\n\n"
    "0 done; 1 some runs failed (their rows say why); 2 bad input or a store that cannot be "
    "written; 130 interrupted; 143 terminated. Finished runs are in the store."
)
def sweep(
    what: Annotated[
        str,
        typer.Argument(
            metavar="FILE.toml|paper|STUDY",
            help="A file of experiments; or paper, the grid of its text: four controllers, five "
            "densities and three splits on 4 arms, DIM alone on 3 and 5; or another study of "
            f"minisim reproduce: {', '.join(STUDIES)}.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="STORE", help="Keeps the results; made if missing."),
    ] = Path("sweep.db"),
    seeds: Annotated[int | None, option("Seeds 1 … N per cell; the file's, or 10.", "N")] = None,
    jobs: options.Jobs = None,
    scheduler: Annotated[
        str | None,
        option("Run on a Dask cluster (pip install 'minisim-traffic\\[dask]').", "ADDRESS"),
    ] = None,
    export: Annotated[Path | None, option("One row per run (.csv or .parquet).", "FILE")] = None,
    horizon: Annotated[float | None, option("Simulated time; the file's, or 3600.", "S")] = None,
) -> None:
    """Run many experiments over seeds, and keep the results; stored runs are not repeated."""
    from minisim.files import check_apart, check_table, write_table
    from minisim.inflow import MAX_TIME
    from scenarios.cli.shared.report import sweep_notes, sweep_table
    from scenarios.sweep.cells import cells
    from scenarios.sweep.cluster import cluster
    from scenarios.sweep.processes import start_server
    from scenarios.sweep.store import Store

    if seeds is not None:
        integer("--seeds", seeds, low=1, high=100_000)
    if jobs is not None and scheduler is not None:
        raise InputError("--jobs is for this machine, --scheduler for a cluster; give one")
    workers = options.processes(jobs)
    if horizon is not None:
        number("--horizon [s]", horizon, above=0, high=MAX_TIME)
    check_apart({"FILE.toml": Path(what), "--out": out, "--export": export})
    if export is not None:
        check_table(export)
    experiments = _experiments(what, seeds, horizon)
    if workers > 1 and scheduler is None:
        start_server()  # before a bar has a thread
    options.say_replaced(recipe.scenario for recipe in experiments)
    remote = nullcontext() if scheduler is None else cluster(scheduler)
    with remote as executor, Store(out) as store:
        rows = _run(experiments, executor, workers, store, out)
        outdated = store.outdated
    averaged = cells(rows)
    show(sweep_table(averaged, experiments), sweep_notes(rows, averaged, experiments))
    typer.echo(f"  {plural(len(rows), 'run')} in {out}")
    if outdated:
        typer.echo(f"  {outdated}")
    if export is not None:
        write_table(rows, export)
        typer.echo(f"  wrote {export}")
    if rows["error"].notna().any():
        raise typer.Exit(1)


def _experiments(what: str, seeds: int | None, horizon: float | None) -> list[Recipe]:
    """The runs of a study or file; a word without a suffix names a study unless it is a file."""
    from scenarios.sweep.file import check_can_run, read_experiments

    studies = ("paper", *STUDIES)
    if what in SEARCHES:
        raise InputError(f"{what} picks runs by earlier ones: use minisim reproduce --only {what}")
    if what in studies or not (Path(what).suffix or os.path.exists(what)):
        study = study_named("text" if what == "paper" else choice("study", what, studies))
        recipes = [recipe for _, recipe in study.runs(seeds or 10, horizon or 3600.0)]
    else:
        recipes = read_experiments(what, seeds=seeds, horizon=horizon)
    with bar("checking"):
        check_can_run(recipes)
    return recipes


def _run(
    experiments: list[Recipe], executor: Executor | None, jobs: int, store: Store, out: Path
) -> pd.DataFrame:
    """The rows in the order of the experiments, with a bar that counts failures."""
    import pandas as pd

    from scenarios.sweep.keys import key_of
    from scenarios.sweep.runner import finished

    rows: dict[int, dict[str, object]] = {}
    lost, total = 0, len(experiments)
    try:
        with bar("starting") as progress:
            for k, row in finished(experiments, executor, jobs=jobs, store=store):
                rows[k] = row
                lost += row["error"] is not None
                progress.label(f"{len(rows)} of {plural(total, 'run')}, {lost} failed")
                progress(len(rows), total)
    except (KeyboardInterrupt, Terminated):
        kept = len(store.valid(map(key_of, experiments)))
        note = f"{kept} of {plural(total, 'run')} are in {out}; repeat the command to continue"
        typer.echo(f"minisim: {note}", err=True)
        raise
    return pd.DataFrame([rows[k] for k in range(total)])
