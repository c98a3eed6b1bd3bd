"""The `minisim` command: the composition root, which may import everything, and does so late.

Every command imports what it needs when it runs, so that `minisim --help` is quick.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from minisim.errors import (
    CollisionError,
    InputError,
    MinisimError,
    choice,
    integer,
    number,
)
from minisim.version import __version__
from scenarios.options import (
    Arrivals,
    AsJson,
    Bearings,
    ControllerName,
    Density,
    Gui,
    Host,
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
from scenarios.terminal import bar, drop_output, prepare_streams, show, show_json

if TYPE_CHECKING:
    import pandas as pd

    from minisim.simulation import Run
    from scenarios.scenario import Scenario

HOSTS = ("minisim", "sumo")
COMMANDS = ("demo", "run", "harmony", "decide", "animate")

#: What typer raises for a wrong command line: the parent of its public `BadParameter`.
_USAGE_ERROR: type[Exception] = typer.BadParameter.__mro__[1]

app = typer.Typer(
    name="minisim",
    help="Simulate an intersection: decentralised vehicles (DIM) beside signals.",
    epilog="Start with [bold]minisim demo[/bold], then [bold]minisim run --help[/bold].",
    add_completion=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"minisim {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    pass


@app.command(
    epilog="Simulates an hour of the 4-arm junction at 150 to 350 veh/h/lane under DIM with the "
    "paper's gate, DIM with the harmonious gate, and a fixed-time signal, all with the same "
    "vehicles and arrivals. Prints a table with 95 % confidence intervals and writes demo.csv, "
    "demo.md, demo.png and demo.gif."
)
def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for table, plot and GIF.")] = (
        Path("out")
    ),
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Runs a point, 2 … 1000; 5 by default, 2 with --quick.", show_default=False
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(help="Processes to use; one a core by default.", show_default=False),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer points, shorter runs: a smoke test.")
    ] = False,
) -> None:
    """The tour: DIM beside a fixed-time signal, in under a minute."""
    from scenarios.demo import Tour, demo_table, demo_title, run_tour, write_tables
    from scenarios.files import make_folder

    runs = (2 if quick else 5) if seeds is None else integer("--seeds", seeds, low=2, high=1000)
    tour = Tour.quick(runs) if quick else Tour(seeds=runs)
    processes = integer("--jobs", (os.cpu_count() or 1) if jobs is None else jobs, low=1, high=1024)
    folder = make_folder(out)
    with bar("starting"):
        film = tour.film()  # first, for it compiles the kernel once for all processes
    with bar("simulating") as progress:
        points = run_tour(tour, processes, progress)
    from figures.animate import write_animation
    from figures.performance import performance_figure
    from figures.style import save

    write_tables(points, tour, folder)
    save(performance_figure(points, demo_title(tour)), folder / "demo.png")
    with bar("drawing") as progress:
        write_animation(
            film, folder / "demo.gif", start=tour.film_start, seconds=tour.film_seconds,
            progress=progress,
        )  # fmt: skip
    typer.echo(demo_title(tour))
    show(demo_table(points))
    for name in ("demo.csv", "demo.md", "demo.png", "demo.gif"):
        typer.echo(f"  wrote {folder / name}")


@app.command(
    epilog="Times are means over the trips that ended before the horizon, as SUMO and the paper "
    "count them; the last row also counts what the others have waited so far.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim run four-way --controller dim --density 300\n\n"
    "minisim run five-way -c dim-harmonious -d 350 --profile fair --json\n\n"
    "minisim run four-way -c fixed-time -d 200 --split 4:3:2:1 --trips trips.csv\n\n"
    "minisim run custom --bearings 0,80,190,260 --side right -c dim --fcd fcd.xml\n\n"
    "minisim run four-way -c dim -d 200 --profile fair --host sumo\n\n"
    "[bold]Exit codes[/bold]\n\n"
    "0 done; 1 a collision stopped the run, or stdout cannot be written; 2 bad input."
)
def run(
    scenario: ScenarioName,
    controller: ControllerName = "dim",
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
    from minisim.recording import write_fcd, write_trajectories, write_trips
    from minisim.safety import safety_summary
    from scenarios.controllers import controller_named
    from scenarios.files import check_apart, check_fcd, check_table

    check_apart({
        "--arrivals": arrivals, "--trips": trips, "--trajectories": trajectories, "--fcd": fcd,
        "--sumo-fcd": sumo_fcd,
    })  # fmt: skip
    for table in (trips, trajectories):
        if table is not None:
            check_table(table)
    for xml in (fcd, sumo_fcd):
        if xml is not None:
            check_fcd(xml)
    what = build_scenario(
        scenario, bearings, arrivals, density, split, turns,
        profile=profile, side=side, horizon=horizon,
    )  # fmt: skip
    who = controller_named(controller, profile)
    everything = fcd is not None or trajectories is not None
    options = {
        "record": "all" if everything else "junction" if safety else None,
        "on_collision": on_collision,
    }
    sumo = {"model": sumo_model, "gui": gui or None, "keep_files": keep_files, "fcd": sumo_fcd}
    asked = {name: value for name, value in sumo.items() if value is not None}
    if choice("host", host, HOSTS) == "sumo":
        result = _simulate_in_sumo(what, who, seed, **options, **asked)
    elif asked:
        raise InputError("--sumo-model, --gui, --keep-files and --sumo-fcd need --host sumo")
    else:
        result = _simulate(what, who, seed, **options)
    summary = result.summary()
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
    from scenarios.report import run_table, run_title, safety_line

    show(run_title(summary), run_table(summary), safety_line(summary))
    for collision in result.collisions[:10]:
        typer.echo(f"  {collision}")
    for path in (trips, trajectories, fcd, sumo_fcd):
        if path is not None:
            typer.echo(f"  wrote {path}")


@app.command(
    epilog="A movement is a lane and an exit: c2 comes from lane c and leaves by the 2nd exit "
    "clockwise.\n\n[bold]Example[/bold]\n\nminisim harmony custom --bearings 0,80,190,260 --csv"
)
def harmony(
    scenario: ScenarioName,
    bearings: Bearings = None,
    side: Side = "left",
    profile: ProfileName = "paper",
    clearance: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="Room between the ways of two bodies in metres; 0.5 by default."
        ),
    ] = None,
    csv: Annotated[bool, typer.Option("--csv", help="Print the matrix as CSV.")] = False,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Print which movements can be driven at once: the harmony matrix."""
    from dim import HarmonyMatrix
    from minisim.control import CLEARANCE

    if csv and as_json:
        raise InputError("--csv and --json exclude each other; give one")
    what = build_scenario(scenario, bearings, profile=profile, side=side)
    room = CLEARANCE if clearance is None else clearance
    matrix = HarmonyMatrix.from_geometry(what.intersection, what.profile.vehicle, room)
    if csv:
        typer.echo(matrix.to_text(), nl=False)
    elif as_json:
        show_json({
            "scenario": what.name,
            "side": side,
            "clearance_m": room,
            "movements": list(matrix.labels),
            "harmony": matrix.values.astype(int).tolist(),
        })  # fmt: skip
    else:
        from rich.text import Text

        from scenarios.report import harmony_table

        title = Text(f"{what.name}, {side}-hand traffic: ● harmony, · conflict")
        show(title, harmony_table(matrix))


@app.command(
    epilog="[bold]Examples[/bold]\n\n"
    "minisim decide four-way a1 b2 c2 d2\n\n"
    "minisim decide five-way a1 b3 c4 d2 e1 --plot decision.png"
)
def decide(
    scenario: ScenarioName,
    movements: Annotated[
        list[str],
        typer.Argument(
            metavar="MOVEMENTS...", show_default=False,
            help="What the front vehicle of each lane wants, such as a1 b2 c2 d2: lane a to the "
            "1st exit clockwise, and so on; at most one a lane.",
        ),
    ],
    order: Annotated[
        str,
        typer.Option(
            metavar="size|lanes",
            help="Prefer the largest clique (the paper's words) or the highest-priority lanes "
            "(its published runs).",
        ),
    ] = "size",
    bearings: Bearings = None,
    side: Side = "left",
    profile: ProfileName = "paper",
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Draw junction and harmony graph (.png, .pdf or .svg)."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:  # fmt: skip
    """Show how DIM decides: graph, cliques, right of way, and why."""
    from dim import Dim, HarmonyMatrix, explain
    from scenarios.files import check_file

    if plot is not None:
        from figures.style import figure_format

        figure_format(plot)
        check_file(plot)
    what = build_scenario(scenario, bearings, profile=profile, side=side)
    site = what.site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    explanation = explain(movements, matrix, order)
    if plot is not None:
        from figures.decision import decision_figure
        from figures.style import save

        save(decision_figure(explanation, site, Dim().start(site).plan), plot)
    if as_json:
        show_json({
            "scenario": what.name,
            "order": order,
            "participants": list(map(str, explanation.participants)),
            "edges": [[str(a), str(b)] for a, b in explanation.edges],
            "cliques": [list(map(str, clique)) for clique in explanation.cliques],
            "tied": [list(map(str, clique)) for clique in explanation.tied],
            "right_of_way": list(map(str, explanation.right_of_way)),
            "reason": explanation.reason,
        })  # fmt: skip
        return
    from scenarios.report import decision_text

    show(decision_text(explanation))
    if plot is not None:
        typer.echo(f"wrote {plot}")


@app.command(
    epilog="[bold]Examples[/bold]\n\n"
    "minisim animate four-way -c dim -d 350 -o dim.gif\n\n"
    "minisim animate five-way -c fixed-time -d 300 --start 600 --seconds 120 -o signal.html"
)
def animate(
    scenario: ScenarioName,
    out: Annotated[
        Path,
        typer.Option(
            "--out", "-o", metavar="FILE", show_default=False,
            help="What to write: .gif, .mp4 (needs ffmpeg) or .html (a page with a player).",
        ),
    ],
    controller: ControllerName = "dim",
    start: Annotated[float, typer.Option(metavar="S", help="Simulated time to begin at.")] = 300.0,
    seconds: Annotated[float, typer.Option(metavar="S", help="Simulated time to show.")] = 60.0,
    fps: Annotated[float, typer.Option(help="Frames a second; at most one a step.")] = 10.0,
    density: Density = None,
    split: Split = None,
    turns: Turns = None,
    profile: ProfileName = "paper",
    side: Side = "left",
    bearings: Bearings = None,
    seed: Seed = 0,
    arrivals: Arrivals = None,
) -> None:  # fmt: skip
    """Write an animation: who waits, who has the right of way, who crosses."""
    from figures.animate import frame_times, write_animation
    from figures.encode import animation_format
    from scenarios.controllers import controller_named
    from scenarios.files import check_apart, check_file
    from scenarios.scenario import profile_named

    check_apart({"--arrivals": arrivals, "--out": out})
    animation_format(out)
    check_file(out)
    number("--start [s]", start, low=0, high=9e6)
    number("--seconds", seconds, above=0, high=3600)
    frame_times(start, seconds, fps, profile_named(profile).dt)
    what = build_scenario(
        scenario, bearings, arrivals, density, split, turns,
        profile=profile, side=side, horizon=start + seconds,
    )  # fmt: skip
    result = _simulate(
        what, controller_named(controller, profile), seed,
        record="all", record_window=(start, start + seconds), on_collision="record",
    )  # fmt: skip
    with bar("drawing") as progress:
        write_animation(result, out, start=start, seconds=seconds, fps=fps, progress=progress)
    typer.echo(f"wrote {out}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    Bad input is one line on stderr and 2, a collision that stops a run or a stdout that cannot be
    written is 1, Ctrl-C is 130. Nothing on purpose is a traceback.
    """
    prepare_streams()
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = app(given or ["--help"], prog_name="minisim", standalone_mode=False)
        sys.stdout.flush()
    except CollisionError as error:
        return _fail(str(error), 1)
    except MinisimError as error:
        return _fail(str(error))
    except _USAGE_ERROR as error:
        message = str(getattr(error, "format_message", error.__str__)()).rstrip(".")
        help_of = [name for name in given[:1] if name in COMMANDS]
        see = shlex.join(["minisim", *help_of, "--help"])
        return _fail(f"{message} (typed: {shlex.join(given)}; see {see})")
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except BrokenPipeError:
        # The reader of our output has gone (as `head` does): no more to say, and no complaint.
        drop_output()
        return 1
    except OSError as error:
        if error.filename is not None:
            raise
        drop_output()
        return _fail(f"cannot write to stdout: {error.strerror or error}", 1)
    if code == 130:
        typer.echo("minisim: interrupted", err=True)
    return code if isinstance(code, int) else 0


def _fail(message: str, code: int = 2) -> int:
    typer.echo(f"minisim: {' '.join(message.split())}", err=True)
    return code


def _simulate(scenario: Scenario, controller: Any, seed: int, **options: Any) -> Run:
    """Run with a progress bar: in parts, which changes nothing in the result."""
    from minisim.simulation import Simulation

    simulation = Simulation(scenario, controller, seed=seed, **options)
    parts = 100
    with bar("simulating") as progress:
        for part in range(1, parts + 1):
            simulation.advance(scenario.horizon * part / parts)
            progress(part, parts)
    return simulation.run()


def _simulate_in_sumo(scenario: Scenario, controller: Any, seed: int, **options: Any) -> Run:
    from minisim.sumo import simulate

    with bar("simulating in SUMO") as progress:
        return simulate(scenario, controller, seed, progress=progress, **options)


def _near_junction(run: Run) -> pd.DataFrame:
    """The trajectories as far as `record="junction"` keeps them.

    A recording of everything then gives the same safety numbers.
    """
    from minisim.recording import S, movement_index
    from minisim.state import RECORD_BEFORE, RECORD_PAST

    frame, paths = run.trajectories, run.site.intersection.paths
    if run.record == "junction":
        return frame
    last = np.array([path.exit + RECORD_PAST for path in paths])
    s = frame[S].to_numpy()
    near = (s >= paths[0].entry - RECORD_BEFORE) & (s <= last[movement_index(frame, run.site)])
    return frame[near]
