"""`minisim animate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import number
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import (
    Arrivals,
    Bearings,
    ControllerName,
    Density,
    Humans,
    ProfileName,
    ScenarioName,
    Seed,
    Side,
    Split,
    Turns,
    build_scenario,
)
from scenarios.cli.shared.simulate import simulate
from scenarios.cli.shared.terminal import bar


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
    humans: Humans = 0.0,
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
    from figures.film.animate import frame_times, write_animation
    from figures.film.encode import animation_format
    from minisim.files import check_apart, check_file
    from scenarios.controllers import controller_named
    from scenarios.recipe import Recipe
    from scenarios.scenario import profile_named

    check_apart({"--arrivals": arrivals, "--out": out})
    animation_format(out)
    check_file(out)
    number("--start [s]", start, low=0, high=9e6)
    number("--seconds", seconds, above=0, high=3600)
    frame_times(start, seconds, fps, profile_named(profile).dt)
    junction = build_scenario(
        scenario, bearings, arrivals, density=density, split=split, turns=turns,
        profile=profile, side=side, horizon=start + seconds,
    )  # fmt: skip
    recipe = Recipe(
        junction, controller_named(controller, profile), seed, humans, on_collision="record"
    )
    result = recipe.run(simulate, record="all", record_window=(start, start + seconds))
    with bar("drawing") as progress:
        write_animation(result, out, start=start, seconds=seconds, fps=fps, progress=progress)
    typer.echo(f"wrote {out}")
