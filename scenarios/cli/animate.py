"""`minisim animate`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from minisim.errors import InputError, number
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.simulate import simulate
from scenarios.cli.shared.terminal import bar

#: What matplotlib draws, frame by frame.
FILMS = ("gif", "mp4")
#: What is shown by default: from then on, for so long [s].
BEGIN, SECONDS = 300.0, 60.0


@app.command(
    epilog="[bold]Example[/bold]\n\n"
    "minisim animate five-way -c fixed-time -d 300 --from 600 --seconds 120 -o signal.html\n\n"
    "minisim animate four-way -c dim --beside fixed-time -o two.html"
)
def animate(
    scenario: options.ScenarioName,
    controller: options.ControllerName = "dim",
    humans: options.Humans = 0.0,
    latency: options.Latency = 0.0,
    jitter: options.Jitter = 0.0,
    loss: options.Loss = 0.0,
    since: Annotated[
        float | None,
        options.option("When to begin; 300 by default, 0 in a short run.", "S", "--from"),
    ] = None,
    length: Annotated[
        float | None, options.option("Simulated time to show; 60 by default.", "S", "--seconds")
    ] = None,
    out: Annotated[
        Path,
        options.option("What to write: .html (a page with a player; film.html by default), .gif, "
                       ".mp4 (needs ffmpeg) or .json (a scene).", "FILE", "--out", "-o"),
    ] = Path("film.html"),
    beside: Annotated[
        str | None, options.option("A second controller beside it, in a page.", "SPEC")
    ] = None,
    fps: Annotated[
        float | None,
        options.option("Of a .gif or .mp4, 10 by default: at most one per step, and 50 in a .gif."),
    ] = None,
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
    arrivals: options.Arrivals = None,
    demand: options.DemandFile = None,
    start: options.Start = None,
) -> None:  # fmt: skip
    """Show a run: a page that says why each vehicle waits, or an animation."""
    from figures.film.animate import frame_times, write_animation
    from figures.film.encode import animation_format
    from figures.player.page import play
    from figures.player.scene import scene as scene_of
    from figures.player.scene import write_scene
    from figures.style import suffix_of
    from minisim.files import check_apart, check_file
    from scenarios.controllers import controller_named
    from scenarios.recipe import Recipe

    check_apart({"--arrivals": arrivals, "--demand": demand, "--out": out})
    kind = suffix_of(out, "an animation", ("html", "gif", "mp4", "json"))
    film = kind in FILMS
    if film:
        animation_format(out)
    elif fps is not None:
        raise InputError(f"--fps is for a .gif or .mp4; a .{kind} has every step")
    if beside is not None and kind != "html":
        raise InputError(f"--beside is for a .html, which plays two runs; got {str(out)!r}")
    check_file(out)
    junction = options.build_scenario(
        scenario, bearings, arrivals, start, demand, density=density, split=split, turns=turns,
        unit=unit, fleet=fleet, lane_width=lane_width, profile=profile, side=side, node=node,
        horizon=horizon, demand_time=demand_time,
    )  # fmt: skip
    begin = (BEGIN if junction.horizon > BEGIN else 0.0) if since is None else since
    number("--from [s]", begin, low=0, below=junction.horizon)
    rest = junction.horizon - begin
    seconds = min(SECONDS, rest) if length is None else length
    number("--seconds", seconds, above=0, high=min(3600.0, rest))
    rate = 10.0 if fps is None else fps
    if film:
        frame_times(begin, seconds, rate, junction.profile.dt)
    recipes = [
        Recipe(junction, controller_named(name, profile), seed, humans, latency, jitter, loss,
               on_collision="record")
        for name in (controller, beside) if name is not None
    ]  # fmt: skip
    end = begin + seconds
    recording = {"record": "all", "record_window": (begin, math.inf), "explain": not film}
    runs = [recipe.run(simulate, until=end, **recording) for recipe in recipes]
    with bar("drawing") as progress:
        if film:
            write_animation(runs[0], out, start=begin, seconds=seconds, fps=rate, progress=progress)
        elif kind == "html":
            play(*runs, start=begin, seconds=seconds).save(out)
        else:
            write_scene(scene_of(runs[0], start=begin, seconds=seconds), out)
    typer.echo(f"wrote {out}")
