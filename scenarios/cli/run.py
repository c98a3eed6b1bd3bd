"""`minisim run`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import CollisionError, InputError, choice
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import (
    FILES,
    Arrivals,
    AsJson,
    Bearings,
    By,
    ControllerName,
    Density,
    Gui,
    Horizon,
    Host,
    Humans,
    KeepFiles,
    Metrics,
    ProfileName,
    ScenarioName,
    Seed,
    Side,
    Split,
    SumoFcd,
    SumoModel,
    Turns,
    Warmup,
    build_scenario,
    chosen_metrics,
)
from scenarios.cli.shared.simulate import simulate, simulate_in_sumo
from scenarios.cli.shared.terminal import bar, show, show_json

HOSTS = ("minisim", "sumo")


@app.command(
    epilog="Means are over the trips that ended; [bold]with unfinished[/bold] counts all. Exit "
    "codes: 0 done, 1 a collision ended the run, 2 bad input. See also "
    "[bold]minisim controllers[/bold].\n\n"
    "minisim run five-way -c dim:gate=harmonious -d 350 -p fair --json\n\n"
    "minisim run four-way -c fixed-time --split 4:3:2:1 --trips trips.csv"
)
def run(
    scenario: ScenarioName,
    controller: ControllerName = "dim",
    humans: Humans = 0.0,
    density: Density = None,
    split: Split = None,
    turns: Turns = None,
    profile: ProfileName = "paper",
    side: Side = "left",
    bearings: Bearings = None,
    seed: Seed = 0,
    horizon: Horizon = 3600.0,
    warmup: Warmup = 0.0,
    on_collision: Annotated[
        str,
        typer.Option(metavar="DO", show_default=False, help="stop, record, or teleport (SUMO)."),
    ] = "stop",
    no_safety: Annotated[
        bool, typer.Option("--no-safety", help="Do not measure TTC and PET.")
    ] = False,
    metrics: Metrics = None,
    by: By = "lane",
    as_json: AsJson = False,
    arrivals: Arrivals = None,
    trips: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", rich_help_panel=FILES, help="Write the trips (.csv, .parquet)."
        ),
    ] = None,
    trajectories: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", rich_help_panel=FILES, help="Write trajectories (.csv, .parquet)."
        ),
    ] = None,
    fcd: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", rich_help_panel=FILES, help="Write trajectories as SUMO's XML."
        ),
    ] = None,
    host: Host = "minisim",
    sumo_model: SumoModel = None,
    gui: Gui = False,
    keep_files: KeepFiles = None,
    sumo_fcd: SumoFcd = None,
) -> None:
    """Simulate one run: waiting, travel and delay by lane, and how safe it was."""
    from minisim.files import check_apart, check_file, check_table
    from minisim.results.metrics import SAFETY
    from minisim.results.summary import GROUPS
    from minisim.results.trajectories import write_fcd, write_trajectories, write_trips
    from scenarios.controllers import controller_named
    from scenarios.recipe import Recipe

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
    asked, by = chosen_metrics(metrics), choice("--by", by, GROUPS)
    junction = build_scenario(
        scenario, bearings, arrivals, density=density, split=split, turns=turns,
        profile=profile, side=side, horizon=horizon, warmup=warmup,
    )  # fmt: skip
    recipe = Recipe(
        junction,
        controller_named(controller, profile),
        seed,
        humans,
        on_collision=on_collision,
        metrics=(*asked, *(() if no_safety else SAFETY)),
    )
    everything = fcd is not None or trajectories is not None
    record = "all" if everything else None
    sumo = {"model": sumo_model, "gui": gui, "keep_files": keep_files, "fcd": sumo_fcd}
    files = [path for path in (trips, trajectories, fcd, sumo_fcd) if path is not None]
    try:
        if choice("host", host, HOSTS) == "sumo":
            result = recipe.run(simulate_in_sumo, record=record, **sumo)
        else:
            _check_minisim_can(on_collision, **sumo)
            result = recipe.run(simulate, record=record)
    except CollisionError as error:
        error.add_note(_unwritten(files))
        raise
    with bar("measuring"):
        summary = result.summary(recipe.metrics, [by])
        if trips is not None:
            write_trips(result.trips, trips)
        if trajectories is not None:
            write_trajectories(result.trajectories, trajectories)
        if fcd is not None:
            write_fcd(result.trajectories, fcd, result.site)
    if as_json:
        show_json(summary)
        return
    from scenarios.cli.shared.report import (
        number_lines,
        run_table,
        run_title,
        safety_line,
        tally_line,
    )

    show(
        run_title(summary), run_table(summary, asked, by), safety_line(summary),
        *tally_line(result.counts), *number_lines(summary, asked),
    )  # fmt: skip
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
