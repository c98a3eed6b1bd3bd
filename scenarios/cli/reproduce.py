"""`minisim reproduce`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import plural
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar
from scenarios.studies import NAMES, study_named


@app.command(
    epilog="Simulates the paper's grid twice: as its text prescribes, and as the published runs "
    "were made. Then comes what the paper leaves open: every controller on equal terms, gates, "
    "rules of priority and capacities. Writes DIR/report.md, DIR/figures and the store. A run in "
    "the store is not repeated, so an interrupted command continues where it stopped.\n\n"
    "[bold]How long[/bold]\n\n"
    "In minutes of processor time, with 10 seeds: text (the "
    "paper's grid, 700 hours, comes first) 2.5; optimum 15; gap 4; gate 0.7; fairness 0.2; "
    "perception 26 and confidence 3 (at most 5 seeds); messages 19; as-run (step 0.01 s) 25. fair, "
    "mixed and capacity (1800, 4500 and 1680 hours) take an hour or more each: slots and platoons "
    "plan for all vehicles in sight, so an hour takes them 0.2 s at 50 veh/h/lane, 2 s at 350 and "
    "20 s once queues fill the roads. Two processes halve the time. For the paper's grid alone: "
    "[bold]minisim reproduce --only text[/bold].\n\n"
    "The report says what each study took, and CPU seconds per simulated hour by controller."
)
def reproduce(
    out: options.Folder = Path("out"),
    store: Annotated[Path | None, option("Keeps the runs; else DIR/runs.sqlite.", "STORE")] = None,
    seeds: Annotated[int | None, option("Runs per case, 2 or more; 10, or 2 with --quick.")] = None,
    jobs: options.Jobs = None,
    only: Annotated[
        list[str] | None,
        option(f"Only this study, with figures; repeat it for more. {', '.join(NAMES)}.", "STUDY"),
    ] = None,
    quick: Annotated[bool, option("A smoke test: two demands, 150 s.", None, "--quick")] = False,
) -> None:
    """Run the paper's experiments and ours, draw every figure, and write a report."""
    from figures.reproduction_report import write_report
    from minisim.files import make_folder
    from scenarios.studies.shared.archive import Archive, find_in
    from scenarios.studies.shared.effort import Effort
    from scenarios.studies.shared.reproduction import reproduce as make
    from scenarios.sweep.store import Store

    options.check_distinct({"--only": only})
    effort = Effort.of(quick=quick, seeds=seeds)
    names = [study_named(name).name for name in only or NAMES]
    workers = options.processes(jobs)
    if store is not None and store.exists():
        Store(store, create=False).close()  # refuses a wrong one before a folder is made
    folder = make_folder(out)
    with Store(folder / "runs.sqlite" if store is None else store) as rows:
        made = []
        for name in names:
            with bar(f"simulating {name}") as progress:
                done = make(name, effort, rows, workers, progress)
            made.append(done)
            took = f"{done.computed} of {plural(done.runs, 'run')} computed in {done.wall_s:.0f} s"
            failed = f", {len(done.failed)} failed" if done.failed else ""
            typer.echo(f"{name}: {took}{failed}", err=True)
        if rows.outdated:
            typer.echo(f"minisim: {rows.outdated}", err=True)
        with bar("drawing") as progress:
            archive = Archive(find_in(rows), effort)
            files = write_report(archive, made, workers, folder, progress, parts=names)
    drawn = plural(files, "figure or table", "figures and tables")
    typer.echo(f"wrote {drawn} to {folder / 'figures'}")
    typer.echo(f"wrote {folder / 'report.md'}")
    if broken := sum(len(part.failed) for part in made):
        typer.echo(f"{plural(broken, 'run')} failed; the report says which", err=True)
