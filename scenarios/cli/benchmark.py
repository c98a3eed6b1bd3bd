"""`minisim benchmark`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from minisim.errors import InputError, plural
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar, show

if TYPE_CHECKING:
    from scenarios.benchmark.results import Result


@app.command(
    epilog="Runs every controller that promises no collision, and those of installed packages, on "
    "the same arrivals. Writes DIR/report.md, its figures, cells.csv (means of all measures with "
    "intervals), benchmark.json (every row) and the store. Runs in the store are not repeated, so "
    "an interrupted command continues. A controller that cannot serve a cell has a row that says "
    "so. See docs/howto/benchmark.md.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim benchmark --quick\n\n"
    "minisim benchmark --add 'mine:Mine(k=3)' --out mine\n\n"
    "minisim benchmark --compare mine theirs/benchmark.json\n\n"
    "[bold]Exit codes[/bold]\n\n"
    "0 done, or two equal results; 1 two results differ; 2 bad input."
)
def benchmark(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE.toml", help="Your own set; that of minisim by default."),
    ] = None,
    out: options.Folder = Path("benchmark"),
    controller: Annotated[
        list[str] | None,
        option("Only this one; repeat it for more.", "SPEC", "--controller", "-c"),
    ] = None,
    add: Annotated[
        list[str] | None, option("Your own, beside the others; repeat it for more.", "SPEC")
    ] = None,
    quick: options.Quick = False,
    jobs: options.Jobs = None,
    compare: Annotated[
        tuple[Path, Path] | None,
        option("Compare two results, files or folders, and run nothing.", "A B"),
    ] = None,
) -> None:
    """Measure and rank every controller on a fixed set of scenarios, against the optimum."""
    if compare is not None:
        given = {"FILE.toml": file, "--controller": controller, "--add": add, "--jobs": jobs,
                 "--quick": quick or None}  # fmt: skip
        if clash := [name for name, value in given.items() if value is not None]:
            raise InputError(f"--compare runs nothing, so {' and '.join(clash)} cannot be given")
        _compare(*compare)
        return
    from figures.benchmark_report import write_page
    from minisim.files import make_folder
    from scenarios.benchmark.definition import entrants, read_benchmark
    from scenarios.benchmark.results import FILE, measured
    from scenarios.cli.shared.benchmark_report import benchmark_table
    from scenarios.sweep.store import Store

    options.check_distinct({"--controller": controller, "--add": add})
    workers = options.processes(jobs)
    made = read_benchmark(file, quick=quick)
    named = entrants(controller, add or ())
    folder = make_folder(out)
    began = time.monotonic()
    with Store(folder / "runs.sqlite") as store:
        with bar(f"benchmark {made.name} {made.version}") as progress:
            result = measured(made, named, store, workers, progress)
        if store.outdated:
            typer.echo(f"minisim: {store.outdated}", err=True)
    facts = (
        f"{plural(len(result.rows), 'row')}; this call took {time.monotonic() - began:.0f} s with "
        f"{plural(workers, 'process', 'processes')}."
    )
    with bar("drawing") as progress:
        write_page(result, folder, facts, progress)
    show(benchmark_table(result))
    typer.echo(f"  {facts}")
    typer.echo(f"  wrote {folder / 'report.md'} and {folder / FILE}")


def _compare(one: Path, other: Path) -> None:
    from scenarios.benchmark.results import compare, load
    from scenarios.cli.shared.benchmark_report import comparison_parts

    first, second = load(one), load(other)
    made = compare(first, second)
    show(*comparison_parts(_called(first), _called(second), made))
    if made.equal < made.common or made.only_first or made.only_second:
        raise typer.Exit(1)


def _called(result: Result) -> str:
    head = result.head
    return f"minisim {head['minisim']}, results {head['results']}, commit {head['commit']}"
