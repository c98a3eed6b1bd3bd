"""`minisim why`."""

from __future__ import annotations

from typing import Annotated

import typer

from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.simulate import simulate
from scenarios.cli.shared.terminal import show_json


@app.command(
    epilog="Vehicles are numbered in the order in which they come, from 0, as in "
    "[bold]minisim run --trips[/bold].\n\n"
    "minisim why four-way -c dim --vehicle 12 --at 95"
)
def why(
    scenario: options.ScenarioName,
    vehicle: Annotated[int, option("Number of the vehicle.", "N")],
    at: Annotated[float, option("When.", "S")],
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
    as_json: options.AsJson = False,
    arrivals: options.Arrivals = None,
    demand: options.DemandFile = None,
    start: options.Start = None,
) -> None:
    """Say why a vehicle waited or went at a time, in the run that `run` makes."""
    from minisim.errors import number
    from scenarios.controllers import controller_named
    from scenarios.recipe import Recipe

    junction = options.build_scenario(
        scenario, bearings, arrivals, start, demand, density=density, split=split, turns=turns,
        unit=unit, fleet=fleet, lane_width=lane_width, profile=profile, side=side, node=node,
        horizon=horizon, demand_time=demand_time,
    )  # fmt: skip
    number("--at [s]", at, low=0, high=junction.horizon)
    recipe = Recipe(
        junction, controller_named(controller, profile), seed, humans, latency, jitter, loss,
        on_collision="record",
    )  # fmt: skip
    run = recipe.run(simulate, record="all", explain=True, until=at)
    chain = run.explained.chain(vehicle, at)
    if as_json:
        show_json({"time_s": at, "reasons": [reason.as_dict() for reason in chain]})
        return
    for reason in chain:
        typer.echo(reason.sentence)
