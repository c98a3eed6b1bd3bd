"""The `minisim` command: the composition root, which may import everything, and does so late.

Every command imports what it needs when it runs, so that `minisim --help` is quick.
"""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError, MinisimError
from minisim.version import VERSION

if TYPE_CHECKING:
    from rich.progress import Progress

    from minisim.simulation import Run
    from scenarios.scenario import Scenario

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

ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="The junction: three-way, four-way, five-way, N-way (such as 6-way), or custom "
        "with --bearings.",
        show_default=False,
    ),
]
ControllerName = Annotated[
    str,
    typer.Option(
        "--controller", "-c", metavar="NAME",
        help="Who decides: dim (the paper's rules), dim-harmonious (enter beside crossing "
        "vehicles in harmony), dim-lanes, dim-inflow, dim-paper-commit, fixed-time, "
        "fixed-time-equal, unregulated.",
    ),
]  # fmt: skip
Density = Annotated[
    float | None,
    typer.Option(
        "--density", "-d", metavar="VEH/H",
        help="Mean inflow a lane in vehicles per hour; 350 by default.", show_default=False,
    ),
]  # fmt: skip
Split = Annotated[
    str | None,
    typer.Option(metavar="4:3:2:1", help="Shares of the lanes a, b, c, …; equal by default."),
]
Turns = Annotated[
    str | None,
    typer.Option(
        metavar="1:2:1",
        help="Shares of the manoeuvres 1, 2, 3, … (the j-th exit clockwise); equal by default.",
    ),
]
ProfileName = Annotated[
    str,
    typer.Option(
        "--profile", "-p", metavar="NAME",
        help="Vehicle and speeds: paper (what its text prescribes) or fair (one vehicle and "
        "speed limit for every controller).",
    ),
]  # fmt: skip
Side = Annotated[
    str, typer.Option(metavar="left|right", help="Side of the road that traffic keeps to.")
]
Bearings = Annotated[
    str | None,
    typer.Option(
        metavar="0,80,190,260",
        help="Bearings of the arms in degrees clockwise from north, at least 30 apart; "
        "for the scenario custom.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", "-s", help="Of the random arrivals.", min=0)]
Arrivals = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="CSV of recorded arrivals (demand_time_s, lane, manoeuvre) to replay instead of "
        "drawing them.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"minisim {VERSION}")
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
    seeds: Annotated[int, typer.Option(help="Runs a point; at least 2.", min=2, max=1000)] = 5,
    jobs: Annotated[
        int | None,
        typer.Option(help="Processes to use; one a core by default.", show_default=False, min=1),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer points, shorter runs: a smoke test.")
    ] = False,
) -> None:
    """The tour: DIM beside a fixed-time signal, in under a minute."""
    from scenarios.demo import Tour, demo_table, demo_title, run_tour, write_tables
    from scenarios.files import make_folder

    folder = make_folder(out)
    tour = Tour.quick(seeds) if quick else Tour(seeds=seeds)
    with _bar("starting"):
        film = tour.film()  # first, for it compiles the kernel once for all processes
    with _bar("simulating") as bar:
        points = run_tour(tour, jobs or os.cpu_count() or 1, bar)
    from figures.animate import write_animation
    from figures.performance import performance_figure
    from figures.style import save

    write_tables(points, tour, folder)
    save(performance_figure(points, demo_title(tour)), folder / "demo.png")
    with _bar("drawing") as bar:
        write_animation(
            film, folder / "demo.gif", start=tour.film_start, seconds=tour.film_seconds,
            progress=bar,
        )  # fmt: skip
    _print(demo_title(tour), demo_table(points))
    for name in ("demo.csv", "demo.md", "demo.png", "demo.gif"):
        typer.echo(f"  wrote {folder / name}")


@app.command(
    epilog="Times are means over the trips that ended before the horizon, as SUMO and the paper "
    "count them; the last row also counts what the others have waited so far.\n\n"
    "[bold]Examples[/bold]\n\n"
    "minisim run four-way --controller dim --density 300\n\n"
    "minisim run five-way -c dim-harmonious -d 350 --profile fair --json\n\n"
    "minisim run four-way -c fixed-time -d 200 --split 4:3:2:1 --trips trips.csv\n\n"
    "minisim run custom --bearings 0,80,190,260 --side right -c dim --fcd fcd.xml"
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
            metavar="stop|record", help="Stop with a report, or note the collision and go on."
        ),
    ] = "stop",
    as_json: AsJson = False,
) -> None:
    """Simulate one run: waiting, travel and delay by lane, and how safe it was."""
    from minisim.recording import write_fcd, write_trajectories, write_trips
    from minisim.safety import safety_summary
    from scenarios.controllers import controller_named
    from scenarios.files import check_file, check_table

    for table in (trips, trajectories):
        if table is not None:
            check_table(table)
    if fcd is not None:
        check_file(fcd)
    what = _scenario(
        scenario, bearings, arrivals, density, split, turns,
        profile=profile, side=side, horizon=horizon,
    )  # fmt: skip
    who = controller_named(controller, profile)
    everything = fcd is not None or trajectories is not None
    result = _simulate(
        what, who, seed, record="all" if everything else "junction", on_collision=on_collision
    )
    summary = result.summary()
    summary["safety"] = safety_summary(result.trajectories, result.site)
    if trips is not None:
        write_trips(result.trips, trips)
    if trajectories is not None:
        write_trajectories(result.trajectories, trajectories)
    if fcd is not None:
        write_fcd(result.trajectories, fcd, result.site)
    if as_json:
        _print_json(summary)
        return
    from scenarios.report import run_table, run_title, safety_line

    _print(run_title(summary), run_table(summary), safety_line(summary))
    for collision in result.collisions[:10]:
        _print(f"  {collision}")
    for path in (trips, trajectories, fcd):
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
    what = _scenario(scenario, bearings, profile=profile, side=side)
    room = CLEARANCE if clearance is None else clearance
    matrix = HarmonyMatrix.from_geometry(what.intersection, what.profile.vehicle, room)
    if csv:
        typer.echo(matrix.to_text(), nl=False)
    elif as_json:
        _print_json({
            "scenario": what.name,
            "side": side,
            "clearance_m": room,
            "movements": list(matrix.labels),
            "harmony": matrix.values.astype(int).tolist(),
        })  # fmt: skip
    else:
        from scenarios.report import harmony_table

        title = f"{what.name}, {side}-hand traffic: ● harmony, · conflict"
        _print(title, harmony_table(matrix))


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
    what = _scenario(scenario, bearings, profile=profile, side=side)
    site = what.site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    explanation = explain(movements, matrix, order)
    if plot is not None:
        from figures.decision import decision_figure
        from figures.style import save

        save(decision_figure(explanation, site, Dim().start(site).plan), plot)
    if as_json:
        _print_json({
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

    _print(decision_text(explanation))
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
    from scenarios.files import check_file
    from scenarios.scenario import profile_named

    animation_format(out)
    check_file(out)
    frame_times(start, seconds, fps, profile_named(profile).dt)
    what = _scenario(
        scenario, bearings, arrivals, density, split, turns,
        profile=profile, side=side, horizon=start + seconds,
    )  # fmt: skip
    result = _simulate(
        what, controller_named(controller, profile), seed,
        record="all", record_window=(start, start + seconds), on_collision="record",
    )  # fmt: skip
    with _bar("drawing") as bar:
        write_animation(result, out, start=start, seconds=seconds, fps=fps, progress=bar)
    typer.echo(f"wrote {out}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    Bad input is one line on stderr and 2, Ctrl-C is 130. Nothing on purpose is a traceback.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = app(given or ["--help"], prog_name="minisim", standalone_mode=False)
        sys.stdout.flush()
    except MinisimError as error:
        return _fail(str(error))
    except _USAGE_ERROR as error:
        return _fail(str(getattr(error, "format_message", error.__str__)()))
    except (KeyboardInterrupt, typer.Abort):
        print("minisim: interrupted", file=sys.stderr)  # noqa: T201
        return 130
    except BrokenPipeError:
        # The reader of our output has gone (as `head` does): no more to say, and no complaint.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return code if isinstance(code, int) else 0


def _fail(message: str) -> int:
    print("minisim:", " ".join(message.split()), file=sys.stderr)  # noqa: T201
    return 2


def _scenario(
    name: str,
    bearings: str | None,
    arrivals: Path | None = None,
    density: float | None = None,
    split: str | None = None,
    turns: str | None = None,
    **options: Any,
) -> Scenario:
    """The scenario of the options that all commands share."""
    from dataclasses import replace

    from minisim.arrivals import read_arrivals
    from scenarios.library import scenario_named

    drawn = {"--density": density, "--split": split, "--turns": turns}
    if arrivals is not None:
        clash = [option for option, value in drawn.items() if value is not None]
        if clash:
            raise InputError(f"--arrivals replaces {', '.join(clash)}; give one or the other")
    made = scenario_named(
        name,
        None if bearings is None else _numbers("--bearings", bearings, ",", "0,80,190,260"),
        density=350.0 if density is None else density,
        split=None if split is None else _numbers("--split", split, ":", "4:3:2:1"),
        turns=None if turns is None else _numbers("--turns", turns, ":", "1:2:1"),
        **options,
    )
    if arrivals is None:
        return made
    return replace(made, recorded=read_arrivals(arrivals, made.intersection.n))


def _numbers(option: str, text: str, separator: str, example: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(separator))
    except ValueError:
        values = (math.nan,)
    if not all(map(math.isfinite, values)):
        raise InputError(f"{option} is written like {example}, got {text!r}")
    return values


def _simulate(scenario: Scenario, controller: Any, seed: int, **options: Any) -> Run:
    """Run with a progress bar: in parts, which changes nothing in the result."""
    from minisim.simulation import Simulation

    simulation = Simulation(scenario, controller, seed=seed, **options)
    parts = 100
    with _bar("simulating") as bar:
        for part in range(1, parts + 1):
            simulation.advance(scenario.horizon * part / parts)
            bar(part, parts)
    return simulation.run()


class _Bar:
    """Shows `done` of `total`, once there is something to show."""

    def __init__(self, progress: Progress, label: str) -> None:
        self._progress = progress
        self._task = progress.add_task(label, total=None)

    def __call__(self, done: int, total: int) -> None:
        self._progress.update(self._task, completed=done, total=total)


@contextmanager
def _bar(label: str) -> Iterator[_Bar]:
    """A progress bar on stderr that leaves nothing behind; silent where that is no terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn()
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        yield _Bar(progress, label)


def _print(*renderables: Any) -> None:
    """Print for a terminal; where output goes to a file, nothing is wrapped."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=400)
    for renderable in renderables:
        console.print(renderable)


def _print_json(value: Any) -> None:
    typer.echo(json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False))
