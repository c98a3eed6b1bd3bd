"""`minisim crossval`."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError, integer
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.terminal import bar

if TYPE_CHECKING:
    from scenarios.scenario import Scenario

#: What is compared by default, and with --quick.
CONTROLLERS = ["dim", "fixed-time"]
DENSITIES = [150.0, 250.0, 350.0]
QUICK_DENSITIES = [150.0, 350.0]

#: How many failed runs are printed on stderr; the report has all.
TOLD = 10


@app.command(
    epilog="Writes crossval.md (the report), crossval.csv (one row per cell, lane and metric) and "
    "the figures. A cell whose controller cannot serve its scenario is refused before anything "
    "runs; a failed run is a row with its error. SUMO's runs are kept in the folder sumo beside "
    "them and reused by the same version; remove the folder to repeat them.\n\n"
    "[bold]Defaults[/bold]\n\n"
    "four-way; dim and fixed-time; 150, 250 and 350 veh/h/lane; balanced; fair. With --replay all "
    "published runs of dim with their own vehicles; there are also fixed-time, adaptive and v2ic."
    "\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim crossval four-way five-way -c dim -c dim:gate=harmonious -d 250 --seeds 5\n\n"
    "minisim crossval --replay -c fixed-time -c v2ic --split 4:1:4:1\n\n"
    "[bold]Exit codes[/bold]\n\n"
    "0 done, whether the hosts agree or not; 1 a run failed; 2 bad input, or SUMO is missing."
)
def crossval(
    context: typer.Context,
    scenarios: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[SCENARIO]...", help="three-way, four-way, five-way, N-way, or a file."
        ),
    ] = None,
    controller: Annotated[
        list[str] | None,
        option("What decides; repeat it for more.", "NAME", "--controller", "-c"),
    ] = None,
    density: Annotated[
        list[float] | None,
        option("Mean inflow per lane; repeat it for more.", "VEH/H", "--density", "-d"),
    ] = None,
    split: Annotated[
        list[str] | None,
        option("Shares of the lanes, or balanced; repeat it for more.", "4:3:2:1"),
    ] = None,
    profile: Annotated[
        str | None,
        option("Vehicle and speeds: fair, paper, as_run or as_run_signals.", "NAME",
               "--profile", "-p"),
    ] = None,
    seeds: Annotated[int | None, option("Runs per cell, 1 … 1000; 3, or 2 with --quick.")] = None,
    horizon: Annotated[float | None, option("Of each run; 3600, or 300 with --quick.", "S")] = None,
    fleet: options.Fleet = None,
    unit: options.Unit = None,
    lane_width: options.LaneWidth = None,
    demand: options.DemandFile = None,
    start: options.Start = None,
    replay: Annotated[
        bool,
        option("Replay published runs: their arrivals, vehicles and controllers; compare with the "
               "paper too. With another --profile only the arrivals are theirs.", None, "--replay"),
    ] = False,
    node: options.Node = None,
    jobs: options.Jobs = None,
    out: options.Folder = Path("out/crossval"),
    quick: options.Quick = False,
) -> None:  # fmt: skip
    """Compare minisim, SUMO and the paper on common arrivals, trip by trip."""
    from minisim.demandfile import read_demand
    from minisim.files import make_folder
    from minisim.sumo.network import sumo_home
    from scenarios.crossval import Case, crossvalidate, film, replayed_cases, write_report
    from scenarios.crossval.report import CSV, REPORT, summary
    from scenarios.library import refuse_beside, scenario_named
    from scenarios.sweep.file import check_can_run

    options.check_distinct({
        "SCENARIO": scenarios, "--controller": controller, "--density": density, "--split": split,
    })  # fmt: skip
    if demand is not None:
        given = {"--replay": replay, "--density": density, "--split": split, "--unit": unit}
        refuse_beside("--demand", [name for name, value in given.items() if value])
    elif start is not None:
        raise InputError("--start needs --demand: it is a time of day there")
    if horizon is None and (quick or demand is None):
        horizon = 300.0 if quick else 3600.0
    who = controller or (["dim"] if replay else CONTROLLERS)
    densities = density or (QUICK_DENSITIES if quick else [] if replay else DENSITIES)
    splits = split or (["balanced"] if quick or not replay else [])
    if replay:
        if seeds is not None:
            raise InputError("--seeds does not go with --replay: published arrivals are not drawn")
        if node is not None:
            raise InputError("--node does not go with --replay: published junctions have no nodes")
        ours = {"--fleet": fleet, "--unit": unit, "--lane-width": lane_width}
        for what in (name for name, value in ours.items() if value is not None):
            raise InputError(
                f"{what} does not go with --replay: published runs are of cars on lanes of 3.2 m"
            )
        cases = replayed_cases(scenarios or [], who, densities, splits, profile, horizon or 0.0)
    else:
        chosen = {
            "horizon": horizon, "fleet": fleet, "unit": unit, "lane_width": lane_width,
            "node": node,
        }  # fmt: skip
        more: dict[str, Any] = {key: value for key, value in chosen.items() if value is not None}
        more["profile"] = profile or "fair"
        make: Callable[..., Scenario] = partial(scenario_named, **more)
        where = scenarios or ["four-way"]
        if demand is None:
            cells = product(where, splits, who, densities)
            cases = [Case(make(name, density=q, split=shares), it) for name, shares, it, q in cells]
        else:
            day = read_demand(demand, start)
            cases = [Case(make(name, demand=day), it) for name, it in product(where, who)]
    options.say_replaced(case.scenario for case in cases)
    count = (2 if quick else 3) if seeds is None else integer("--seeds", seeds, low=1, high=1000)
    numbers = range(1, 1 + count)
    workers = options.processes(jobs)
    sumo_home()
    with bar("checking"):
        check_can_run(case.recipe() for case in cases)
    folder = make_folder(out)
    with bar("simulating in both hosts") as progress:
        results = crossvalidate(cases, numbers, workers, progress, folder)
    with bar("recording where they part") as progress:
        results = film(results, workers, progress)
    from figures.crossval import crossval_figures
    from figures.style import save

    captions = {}
    with bar("drawing"):
        for name, caption, figure in crossval_figures(results):
            save(figure, folder / f"{name}.png")
            save(figure, folder / f"{name}.svg")
            captions[f"{name}.png"] = caption
    write_report(results, folder, _command(context), captions)
    typer.echo(summary(results))
    for name in (REPORT, CSV):
        typer.echo(f"  wrote {folder / name}")
    failures = [(result.case.name, failure) for result in results for failure in result.failures]
    for cell, (host, seed, error) in failures[:TOLD]:
        typer.echo(f"minisim: {cell} in {host}, seed {seed}: {error}", err=True)
    if len(failures) > TOLD:
        typer.echo(f"minisim: {len(failures) - TOLD} more in {folder / REPORT}", err=True)
    if failures:
        raise typer.Exit(1)


def _command(context: typer.Context) -> str:
    words = ["minisim", "crossval"]
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if value and parameter.name not in ("jobs", "out"):
            flag = parameter.opts[:1] if parameter.param_type_name == "option" else []
            for item in value if isinstance(value, list | tuple) else [value]:
                shown = f"{item:g}" if isinstance(item, float) else str(item)
                words += flag if item is True else [*flag, shown]
    return shlex.join(words)
