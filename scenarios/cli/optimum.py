"""`minisim optimum`."""

from __future__ import annotations

from typing import Annotated, Any

from minisim.errors import choice
from scenarios.cli.shared import options
from scenarios.cli.shared.app import app
from scenarios.cli.shared.options import option
from scenarios.cli.shared.simulate import simulate, simulate_in_sumo
from scenarios.cli.shared.terminal import show, show_json


@app.command(
    epilog="The delay counts against driving on at the roads' limits, from demand to arrival, over "
    "all vehicles: runs go on until the last one has arrived. No controller can have less than the "
    "bound. By its own rules, the best order reaches it; what that is above it is the gap of the "
    "search. The schedule keeps more room, and knows all arrivals beforehand. See "
    "docs/howto/optimum.md.\n\n"
    "minisim optimum four-way -p fair -d 250 -c reservation -c dim:gate=harmonious"
)
def optimum(
    scenario: options.ScenarioName,
    controller: Annotated[
        list[str] | None,
        option("Compared; all rivals by default.", "SPEC", "--controller", "-c"),
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
    as_json: options.AsJson = False,
    arrivals: options.Arrivals = None,
    demand: options.DemandFile = None,
    start: options.Start = None,
    host: Annotated[str, option("What moves vehicles: minisim or sumo.", "NAME")] = "minisim",
) -> None:
    """Print the least delay that is possible, and how far above it controllers are."""
    from scenarios.cli.shared import report
    from scenarios.controllers import RIVALS, controller_named
    from scenarios.optimum import compared, optimum

    given = controller or list(RIVALS)
    options.check_distinct({"--controller": given})
    hosts = {"minisim": simulate, "sumo": simulate_in_sumo}
    chosen = hosts[choice("host", host, hosts)]
    junction = options.build_scenario(
        scenario, bearings, arrivals, start, demand, density=density, split=split, turns=turns,
        unit=unit, fleet=fleet, lane_width=lane_width,
        profile=profile, side=side, node=node, horizon=horizon,
    )  # fmt: skip
    named = [controller_named(it, profile) for it in given]
    least = optimum(junction, seed)
    rows: list[dict[str, Any]] = list(compared(junction, named, seed, least, chosen))
    if as_json:
        facts = {"scenario": junction.name, "profile": junction.profile_name, "seed": seed}
        show_json(facts | {"host": host} | least.facts | {"controllers": rows})
        return
    show(*report.optimum_parts(f"{junction.name}, {junction.profile_name}", least, rows))
