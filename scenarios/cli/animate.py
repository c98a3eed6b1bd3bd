"""`minisim animate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import number
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.simulate import simulate
from scenarios.cli.shared.terminal import bar


@app.command(
    epilog="[bold]Example[/bold]\n\n"
    "minisim animate five-way -c fixed-time -d 300 --from 600 --seconds 120 -o signal.html"
)
def animate(
    scenario: options.ScenarioName,
    out: Annotated[
        Path,
        options.option("What to write: .gif, .mp4 (needs ffmpeg) or .html (a page with a player).",
                       "FILE", "--out", "-o"),
    ],
    controller: options.ControllerName = "dim",
    humans: options.Humans = 0.0,
    latency: options.Latency = 0.0,
    jitter: options.Jitter = 0.0,
    loss: options.Loss = 0.0,
    begin: Annotated[float, typer.Option("--from", metavar="S", help="When to begin.")] = 300.0,
    seconds: Annotated[float, typer.Option(metavar="S", help="Simulated time to show.")] = 60.0,
    fps: Annotated[float, typer.Option(help="At most one per step, and 50 in a .gif.")] = 10.0,
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
    arrivals: options.Arrivals = None,
    demand: options.DemandFile = None,
    start: options.Start = None,
) -> None:  # fmt: skip
    """Write an animation of a run: which vehicles wait, have right of way, and cross."""
    from figures.film.animate import frame_times, write_animation
    from figures.film.encode import animation_format
    from minisim.files import check_apart, check_file
    from scenarios.controllers import controller_named
    from scenarios.recipe import Recipe

    check_apart({"--arrivals": arrivals, "--demand": demand, "--out": out})
    animation_format(out)
    check_file(out)
    junction = options.build_scenario(
        scenario, bearings, arrivals, start, demand, density=density, split=split, turns=turns,
        unit=unit, fleet=fleet, lane_width=lane_width,
        profile=profile, side=side, node=node, horizon=horizon,
    )  # fmt: skip
    number("--from [s]", begin, low=0, below=junction.horizon)
    number("--seconds", seconds, above=0, high=min(3600.0, junction.horizon - begin))
    frame_times(begin, seconds, fps, junction.profile.dt)
    who = controller_named(controller, profile)
    recipe = Recipe(junction, who, seed, humans, latency, jitter, loss, on_collision="record")
    end = begin + seconds
    result = recipe.run(simulate, until=end, record="all", record_window=(begin, end))
    with bar("drawing") as progress:
        write_animation(result, out, start=begin, seconds=seconds, fps=fps, progress=progress)
    typer.echo(f"wrote {out}")
