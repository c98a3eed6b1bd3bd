"""`minisim crossval`."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from minisim.errors import InputError, integer
from scenarios.cli.shared.app import app
from scenarios.cli.shared.terminal import bar

if TYPE_CHECKING:
    from scenarios.crossval import Case

CONTROLLERS = ("dim", "fixed-time")
DENSITIES = (150.0, 250.0, 350.0)
QUICK_DENSITIES = (150.0, 350.0)
QUICK_HORIZON = 300.0

#: Failed runs that are told on stderr; the report has all.
TOLD = 10


class Wanted(NamedTuple):
    """What the command line asks for; None and empty where it says nothing."""

    scenarios: list[str]
    controllers: list[str]
    densities: list[float]
    splits: list[str]
    profile: str | None
    seeds: int | None
    horizon: float | None
    replay: bool
    quick: bool


@app.command(
    epilog="Writes crossval.md (the report), crossval.csv (one row a cell, lane and metric) and "
    "the figures. A cell whose controller cannot serve its scenario is refused before anything "
    "runs; a run that fails is a row with its error. SUMO's runs are kept in the folder sumo "
    "beside them and used again by the same version; remove it to run them anew.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim crossval --quick\n\n"
    "minisim crossval four-way five-way -c dim -c dim:gate=harmonious -d 250 --seeds 5\n\n"
    "minisim crossval --replay four-way -d 150 -d 350 --split balanced\n\n"
    "minisim crossval --replay -c fixed-time -c v2ic --split 4:1:4:1\n\n"
    "[bold]Exit codes[/bold]\n\n"
    "0 done, whether the hosts agree or not; 1 a run failed; 2 bad input, or SUMO is missing."
)
def crossval(
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENARIO]...", show_default=False,
            help="Junctions: three-way, four-way, five-way or N-way; four-way by default, with "
            "--replay all that were published.",
        ),
    ] = None,
    controller: Annotated[
        list[str] | None,
        typer.Option(
            "--controller", "-c", metavar="NAME", show_default=False,
            help="Who decides, as for minisim run; repeat it for more. dim and fixed-time by "
            "default. With --replay whose published runs: dim (the default), fixed-time, adaptive "
            "or v2ic.",
        ),
    ] = None,
    density: Annotated[
        list[float] | None,
        typer.Option(
            "--density", "-d", metavar="VEH/H", show_default=False,
            help="Mean inflow a lane; repeat it for more. 150, 250 and 350 by default, with "
            "--replay all that were published.",
        ),
    ] = None,
    split: Annotated[
        list[str] | None,
        typer.Option(
            metavar="4:3:2:1", show_default=False,
            help="Shares of the lanes, or balanced; repeat it for more. balanced by default, with "
            "--replay all that were published.",
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option(
            "--profile", "-p", metavar="NAME", show_default=False,
            help="Vehicle and speeds: fair (the default), paper, as_run or as_run_signals; with "
            "--replay those of the published runs by default.",
        ),
    ] = None,
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Runs a cell, 1 … 1000; 3 by default, 2 with --quick.", show_default=False
        ),
    ] = None,
    horizon: Annotated[
        float | None,
        typer.Option(
            metavar="S", show_default=False,
            help="Simulated time; 3600 by default, 300 with --quick.",
        ),
    ] = None,
    replay: Annotated[
        bool,
        typer.Option(
            "--replay",
            help="Replay published runs: their arrivals, vehicles and controllers; compare with "
            "the paper too. With another --profile the arrivals alone are theirs.",
        ),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(help="Processes to use; one a core by default.", show_default=False),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Where to write.")] = (
        Path("out/crossval")
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer and shorter runs: a smoke test.")
    ] = False,
) -> None:  # fmt: skip
    """Compare minisim, SUMO and the paper on common arrivals, trip by trip."""
    from minisim.files import make_folder
    from minisim.sumo.host import sumo_home

    wanted = Wanted(
        scenarios or [], controller or [], density or [], split or [], profile, seeds, horizon,
        replay, quick,
    )  # fmt: skip
    cases = _cases(wanted)
    numbers = _seeds(wanted)
    processes = integer("--jobs", (os.cpu_count() or 1) if jobs is None else jobs, low=1, high=1024)
    sumo_home()
    _check(cases)
    failed = _compare(cases, numbers, processes, make_folder(out), _command(wanted))
    if failed:
        raise typer.Exit(1)


def _cases(wanted: Wanted) -> list[Case]:
    from scenarios.crossval import drawn_cases, replayed_cases

    usual = QUICK_HORIZON if wanted.quick else 3600.0
    horizon = usual if wanted.horizon is None else wanted.horizon
    if wanted.replay:
        return replayed_cases(
            wanted.scenarios,
            wanted.controllers or ["dim"],
            wanted.densities or (list(QUICK_DENSITIES) if wanted.quick else []),
            wanted.splits or (["balanced"] if wanted.quick else []),
            wanted.profile,
            horizon,
        )
    return drawn_cases(
        wanted.scenarios or ["four-way"],
        wanted.controllers or CONTROLLERS,
        wanted.densities or (QUICK_DENSITIES if wanted.quick else DENSITIES),
        wanted.splits or ["balanced"],
        "fair" if wanted.profile is None else wanted.profile,
        horizon,
    )


def _check(cases: list[Case]) -> None:
    """Raise `InputError` for a cell that cannot run, before any does."""
    from scenarios.sweep.file import check_can_run

    with bar("checking"):
        check_can_run(case.recipe() for case in cases)


def _seeds(wanted: Wanted) -> range:
    if wanted.replay and wanted.seeds is not None:
        raise InputError("--seeds does not go with --replay: published arrivals are not drawn")
    count = (2 if wanted.quick else 3) if wanted.seeds is None else wanted.seeds
    return range(1, 1 + integer("--seeds", count, low=1, high=1000))


def _compare(cases: list[Case], seeds: range, processes: int, folder: Path, command: str) -> bool:
    """Run, write, and tell; whether a run failed."""
    from scenarios.crossval import crossvalidate, film, write_report
    from scenarios.crossval.report import CSV, REPORT, summary

    with bar("simulating in both hosts") as progress:
        results = crossvalidate(cases, seeds, None, progress, folder, jobs=processes)
    with bar("recording where they part") as progress:
        results = film(results, None, progress, jobs=processes)
    from figures.crossval import crossval_figures
    from figures.style import save

    captions = {}
    with bar("drawing"):
        for name, caption, figure in crossval_figures(results):
            save(figure, folder / f"{name}.png")
            save(figure, folder / f"{name}.svg")
            captions[f"{name}.png"] = caption
    write_report(results, folder, command, captions)
    typer.echo(summary(results))
    for name in (REPORT, CSV):
        typer.echo(f"  wrote {folder / name}")
    failures = [(result.case.name, failure) for result in results for failure in result.failures]
    for cell, (host, seed, error) in failures[:TOLD]:
        typer.echo(f"minisim: {cell} in {host}, seed {seed}: {error}", err=True)
    if len(failures) > TOLD:
        typer.echo(f"minisim: {len(failures) - TOLD} more in {folder / REPORT}", err=True)
    return bool(failures)


def _command(wanted: Wanted) -> str:
    """The command line that makes the same report."""
    words = ["minisim", "crossval", *wanted.scenarios]
    for option, values in (
        ("--controller", wanted.controllers),
        ("--density", [f"{density:g}" for density in wanted.densities]),
        ("--split", wanted.splits),
        ("--profile", [wanted.profile] if wanted.profile else []),
        ("--seeds", [] if wanted.seeds is None else [str(wanted.seeds)]),
        ("--horizon", [] if wanted.horizon is None else [f"{wanted.horizon:g}"]),
    ):
        words += [word for value in values for word in (option, value)]
    words += [f"--{name}" for name in ("replay", "quick") if getattr(wanted, name)]
    return shlex.join(words)
