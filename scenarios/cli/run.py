"""`minisim run`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from minisim.errors import CollisionError, InputError, choice
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import (
    Arrivals,
    AsJson,
    Bearings,
    ControllerName,
    Density,
    ErrorKind,
    Gui,
    Host,
    Humans,
    IntentError,
    KeepFiles,
    ProfileName,
    ScenarioName,
    Seed,
    Side,
    Split,
    SumoFcd,
    SumoModel,
    Turns,
    build_scenario,
)
from scenarios.cli.shared.simulate import simulate, simulate_in_sumo
from scenarios.cli.shared.terminal import bar, show, show_json

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

HOSTS = ("minisim", "sumo")


@app.command(
    epilog="Times are means over the trips that ended before the horizon, as SUMO and the paper "
    "count them; the last row also counts what the others have waited so far.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim run four-way --controller dim --density 300\n\n"
    "minisim run five-way -c dim-harmonious -d 350 --profile fair --json\n\n"
    "minisim run four-way -c fixed-time -d 200 --split 4:3:2:1 --trips trips.csv\n\n"
    "minisim run four-way -c dim-harmonious -d 200 --profile fair --humans 0.3\n\n"
    "minisim run four-way -d 250 --intent-error 0.15 --on-collision record\n\n"
    "minisim run custom --bearings 0,80,190,260 --side right -c dim --fcd fcd.xml\n\n"
    "minisim run four-way -c dim -d 200 --profile fair --host sumo\n\n"
    "[bold]Exit codes[/bold]\n\n"
    "0 done; 1 a collision stopped the run (no file is written then), or stdout cannot be written; "
    "2 bad input."
)
def run(
    scenario: ScenarioName,
    controller: ControllerName = "dim",
    humans: Humans = 0.0,
    intent_error: IntentError = 0.0,
    error_kind: ErrorKind = None,
    density: Density = None,
    split: Split = None,
    turns: Turns = None,
    profile: ProfileName = "paper",
    side: Side = "left",
    bearings: Bearings = None,
    seed: Seed = 0,
    horizon: Annotated[float, typer.Option(metavar="S", help="Simulated time.")] = 3600.0,
    arrivals: Arrivals = None,
    trips: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write one row a trip (.csv or .parquet)."),
    ] = None,
    fcd: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write trajectories as SUMO floating-car data (XML)."),
    ] = None,
    trajectories: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write trajectories as a table (.csv or .parquet)."),
    ] = None,
    on_collision: Annotated[
        str,
        typer.Option(
            metavar="stop|record|teleport",
            help="Stop with a report; note the collision and go on; or, in SUMO only, what it does "
            "by default and did in the published runs: take who ran into another off the road.",
        ),
    ] = "stop",
    safety: Annotated[
        bool,
        typer.Option(
            "--safety/--no-safety",
            help="Measure TTC and PET, which keeps all trajectories near the junction in memory "
            "(some 36 MB per 1000 s).",
        ),
    ] = True,
    host: Host = "minisim",
    sumo_model: SumoModel = None,
    gui: Gui = False,
    keep_files: KeepFiles = None,
    sumo_fcd: SumoFcd = None,
    as_json: AsJson = False,
) -> None:
    """Simulate one run: waiting, travel and delay by lane, and how safe it was."""
    from dim import NoisyPerception
    from minisim.files import check_apart, check_file, check_table
    from minisim.results.safety import safety_summary
    from minisim.results.trajectories import write_fcd, write_trajectories, write_trips
    from scenarios.controllers import controller_named
    from scenarios.misreading import counted, with_perception
    from scenarios.mixing import driver_means, with_humans

    check_apart({
        "--arrivals": arrivals, "--trips": trips, "--trajectories": trajectories, "--fcd": fcd,
        "--sumo-fcd": sumo_fcd,
    })  # fmt: skip
    for table in (trips, trajectories):
        if table is not None:
            check_table(table)
    for xml in (fcd, sumo_fcd):
        if xml is not None:
            check_file(xml, ".xml")
    what = build_scenario(
        scenario, bearings, arrivals, density, split, turns,
        profile=profile, side=side, horizon=horizon,
    )  # fmt: skip
    senses = NoisyPerception(intent_error, error_kind or "missed")
    if error_kind is not None and senses.period is None:
        raise InputError(f"--error-kind {error_kind} needs --intent-error P above 0")
    dim = with_perception(controller_named(controller, profile), senses)
    who = counted(with_humans(dim, humans))
    everything = fcd is not None or trajectories is not None
    options = {
        "record": "all" if everything else "junction" if safety else None,
        "on_collision": on_collision,
    }
    sumo = {"model": sumo_model, "gui": gui, "keep_files": keep_files, "fcd": sumo_fcd}
    files = [path for path in (trips, trajectories, fcd, sumo_fcd) if path is not None]
    try:
        if choice("host", host, HOSTS) == "sumo":
            result = simulate_in_sumo(what, who, seed, **options, **sumo)
        else:
            _check_minisim_can(on_collision, **sumo)
            result = simulate(what, who, seed, **options)
    except CollisionError as error:
        error.add_note(_unwritten(files))
        raise
    summary = result.summary()
    if drivers := driver_means(result):
        summary["drivers"] = drivers
    with bar("measuring"):
        summary["safety"] = safety_summary(_near_junction(result), result.site) if safety else None
        if trips is not None:
            write_trips(result.trips, trips)
        if trajectories is not None:
            write_trajectories(result.trajectories, trajectories)
        if fcd is not None:
            write_fcd(result.trajectories, fcd, result.site)
    if as_json:
        show_json(summary)
        return
    from scenarios.cli.shared.report import run_table, run_title, safety_line, tally_line

    show(run_title(summary), run_table(summary), safety_line(summary), *tally_line(result.counts))
    for collision in result.collisions[:10]:
        typer.echo(f"  {collision}")
    for path in files:
        typer.echo(f"  wrote {path}")
    if keep_files is not None:
        typer.echo(f"  SUMO's files are in {keep_files}")


def _check_minisim_can(on_collision: str, **sumo: object) -> None:
    """Raise `InputError` where an option asks for what only SUMO can do."""
    names = {
        "model": "--sumo-model", "gui": "--gui", "keep_files": "--keep-files", "fcd": "--sumo-fcd",
    }  # fmt: skip
    asked = [option for name, option in names.items() if sumo[name]]
    if on_collision == "teleport":
        asked.append("--on-collision teleport")
    if asked:
        need = "needs" if len(asked) == 1 else "need"
        raise InputError(f"{' and '.join(asked)} {need} --host sumo")


def _unwritten(files: Sequence[Path]) -> str:
    """What is not there after a collision has stopped the run, and how to get it."""
    wrote = f"{', '.join(map(str, files))} not written; " if files else ""
    return f"{wrote}--on-collision record notes collisions and goes on"


def _near_junction(run: Run) -> pd.DataFrame:
    """The trajectories as far as `record="junction"` keeps them.

    A recording of everything then gives the same safety numbers.
    """
    from minisim.engine.state import RECORD_BEFORE, RECORD_PAST
    from minisim.results.trajectories import S, movement_index

    frame, paths = run.trajectories, run.site.intersection.paths
    if run.record == "junction":
        return frame
    last = np.array([path.exit + RECORD_PAST for path in paths])
    s = frame[S].to_numpy()
    near = (s >= paths[0].entry - RECORD_BEFORE) & (s <= last[movement_index(frame, run.site)])
    return frame[near]
