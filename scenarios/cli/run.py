"""`minisim run`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from minisim.errors import CollisionError, InputError, choice
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.simulate import simulate, simulate_in_sumo
from scenarios.cli.shared.terminal import bar, show, show_json

_file = partial(option, metavar="FILE", rich_help_panel=options.FILES)
_sumo = partial(option, rich_help_panel="SUMO")


@app.command(
    epilog="Means are over the trips that ended; [bold]with unfinished[/bold] counts all. Exit "
    "codes: 0 done, 1 a collision ended the run, 2 bad input. See also "
    "[bold]minisim controllers[/bold].\n\n"
    "minisim run five-way -c dim:gate=harmonious -d 350 -p fair --json\n\n"
    "minisim run four-way -c fixed-time --split 4:3:2:1 --trips trips.csv"
)
def run(
    scenario: options.ScenarioName,
    controller: options.ControllerName = "dim",
    humans: options.Humans = 0.0,
    latency: options.Latency = 0.0,
    jitter: options.Jitter = 0.0,
    loss: options.Loss = 0.0,
    density: options.Density = None,
    split: options.Split = None,
    turns: options.Turns = None,
    unit: options.Unit = None,
    fleet: options.Fleet = None,
    profile: options.ProfileName = "paper",
    side: options.Side = None,
    bearings: options.Bearings = None,
    node: options.Node = None,
    lane_width: options.LaneWidth = None,
    seed: options.Seed = 0,
    horizon: options.Horizon = None,
    demand_time: options.DemandTime = None,
    warmup: Annotated[float, option("Measure only after this.", "S")] = 0.0,
    on_collision: Annotated[str, option("stop, record, or teleport (SUMO).", "DO")] = "stop",
    no_safety: Annotated[bool, option("Do not measure TTC and PET.", None, "--no-safety")] = False,
    metrics: Annotated[str | None, option("See minisim metrics; or mymodule:name.", "A,B")] = None,
    by: Annotated[str, option("By lane, movement, kind or type.", "X")] = "lane",
    as_json: options.AsJson = False,
    arrivals: options.Arrivals = None,
    demand: options.DemandFile = None,
    start: options.Start = None,
    trips: Annotated[Path | None, _file("Write the trips (.csv, .parquet).")] = None,
    trajectories: Annotated[Path | None, _file("Write trajectories (.csv, .parquet).")] = None,
    fcd: Annotated[Path | None, _file("Write trajectories as SUMO's XML.")] = None,
    host: Annotated[str, _sumo("What moves vehicles: minisim or sumo.", "NAME")] = "minisim",
    sumo_model: Annotated[str | None, _sumo("IDM, Krauss or CC, not its own.", "NAME")] = None,
    gui: Annotated[bool, _sumo("Show the run in sumo-gui.", None, "--gui")] = False,
    keep_files: Annotated[Path | None, _sumo("Keep SUMO's files in a new folder.", "DIR")] = None,
    sumo_fcd: Annotated[Path | None, _sumo("SUMO's own floating-car data (XML).", "FILE")] = None,
) -> None:  # fmt: skip
    """Simulate one run: waiting, travel and delay by lane, and how safe it is."""
    from minisim.files import check_apart, check_file, check_table
    from minisim.pcu import UNITS
    from minisim.results.asked import asked_metrics
    from minisim.results.metric import GROUPS
    from minisim.results.metrics import SAFETY
    from minisim.results.trajectories import write_fcd, write_trajectories, write_trips
    from scenarios.controllers import controller_named
    from scenarios.loading import metrics_named
    from scenarios.recipe import Recipe

    check_apart({
        "--arrivals": arrivals, "--demand": demand, "--trips": trips,
        "--trajectories": trajectories, "--fcd": fcd, "--sumo-fcd": sumo_fcd,
    })  # fmt: skip
    for table in filter(None, (trips, trajectories)):
        check_table(table)
    for xml in filter(None, (fcd, sumo_fcd)):
        check_file(xml, ".xml")
    asked = asked_metrics(() if metrics is None else metrics_named(metrics))
    if no_safety and (unsafe := [it.name for it in asked if it.name in SAFETY]):
        raise InputError(f"--metrics asks for {', '.join(unsafe)}, which --no-safety leaves out")
    choice("--by", by, GROUPS)
    only_sumo = {
        "--sumo-model": sumo_model, "--gui": gui, "--keep-files": keep_files,
        "--sumo-fcd": sumo_fcd, "--on-collision teleport": on_collision == "teleport",
    }  # fmt: skip
    refused = [name for name, value in only_sumo.items() if value]
    if choice("host", host, ("minisim", "sumo")) == "minisim" and refused:
        need = "needs" if len(refused) == 1 else "need"
        raise InputError(f"{' and '.join(refused)} {need} --host sumo")
    junction = options.build_scenario(
        scenario, bearings, arrivals, start, demand, density=density, split=split, turns=turns,
        unit=unit, fleet=fleet, lane_width=lane_width,
        profile=profile, side=side, node=node, horizon=horizon, demand_time=demand_time,
        warmup=warmup,
    )  # fmt: skip
    recipe = Recipe(
        junction, controller_named(controller, profile), seed, humans, latency, jitter, loss,
        on_collision=on_collision, metrics=(*asked, *(() if no_safety else SAFETY)),
    )  # fmt: skip
    recording: dict[str, Any] = {"record": None if fcd is None and trajectories is None else "all"}
    if host == "sumo":
        recording |= {"model": sumo_model, "gui": gui, "keep_files": keep_files, "fcd": sumo_fcd}
    files = [*filter(None, (trips, trajectories, fcd, sumo_fcd))]
    try:
        result = recipe.run(simulate_in_sumo if host == "sumo" else simulate, **recording)
    except CollisionError as error:
        if as_json:
            from scenarios.sweep.rows import identity_of

            touched = [collision._asdict() for collision in error.collisions]
            facts = {"collisions": len(touched), "touched": touched, "error": str(error)}
            show_json(identity_of(recipe) | facts)
        unwritten = f"{', '.join(map(str, files))} not written; " if files else ""
        error.add_note(f"{unwritten}--on-collision record notes collisions and goes on")
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
    from scenarios.cli.shared import report
    from scenarios.library import DENSITY

    inflow = f"{DENSITY if density is None else density:g} {unit}/h/lane" if unit in UNITS else ""
    show(*report.run_parts(summary, asked, by, result.counts, inflow))
    for collision in result.collisions[:10]:
        typer.echo(f"  {collision}")
    for path in files:
        typer.echo(f"  wrote {path}")
    if keep_files is not None:
        typer.echo(f"  SUMO's files are in {keep_files}")
