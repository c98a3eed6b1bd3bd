"""Options that several commands share, and the scenario that they describe."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError, integer, number

if TYPE_CHECKING:
    from scenarios.scenario import Scenario

#: A group of options in the help.
FILES = "Files"


def option(help: str, metavar: str | None = None, *flags: str, **more: Any) -> Any:
    """An option whose help text says what its default is."""
    return typer.Option(*flags, metavar=metavar, help=help, show_default=False, **more)


ScenarioName = Annotated[
    str,
    typer.Argument(metavar="SCENARIO", help="three-way, four-way, 6-way, …, custom; or a file."),
]
ControllerName = Annotated[
    str, option("What decides: dim, dim:gate=harmonious, …", "SPEC", "--controller", "-c")
]
Humans = Annotated[float, option("Human drivers among DIM's, 0 … 1.", "SHARE")]
Latency = Annotated[float, option("Delay of messages to and from vehicles.", "S")]
Jitter = Annotated[float, option("How much longer they may take.", "S")]
Loss = Annotated[float, option("Share of messages that get lost, 0 … 1.", "SHARE")]
Density = Annotated[
    float | None, option("Mean inflow per lane; 350 by default.", "VEH/H", "--density", "-d")
]
Split = Annotated[str | None, option("Shares of the lanes a, b, c, …", "4:3:2:1")]
Turns = Annotated[str | None, option("Shares of the exits, clockwise.", "1:2:1")]
Unit = Annotated[str | None, option("Of inflow: veh, pcu, pcu-irc64, pcu-hcm.", "NAME")]
Fleet = Annotated[str | None, option("Vehicle types: india, car:0.9,bus:0.1, …", "MIX")]
LaneWidth = Annotated[float | None, option("Width of every lane; 3.2 by default.", "M")]
ProfileName = Annotated[
    str, option("Vehicle and speeds: paper, fair, as_run.", "NAME", "--profile", "-p")
]
Side = Annotated[str | None, option("Traffic keeps left (the default) or right.", "SIDE")]
Node = Annotated[str | None, option("Of a town's network; see minisim junction.", "ID")]
Bearings = Annotated[str | None, option("Custom's arms, from north.", "0,90,…")]
Seed = Annotated[int, option("Seed of the arrivals; 0 by default.", "N", "--seed", "-s")]
Horizon = Annotated[float | None, option("Simulated time; 3600 by default.", "S")]
DemandTime = Annotated[float | None, option("Vehicles come until then; the horizon.", "S")]
Order = Annotated[
    str,
    typer.Option(
        metavar="size|lanes",
        help="Prefer the largest clique (the paper's text) or the lanes of highest priority "
        "(its published runs).",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]
Folder = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.")]
Jobs = Annotated[int | None, option("Processes to use; one per core by default.", "N")]
Quick = Annotated[bool, typer.Option("--quick", help="Fewer and shorter runs: a smoke test.")]


def _file_name(text: str) -> Path:
    if not text:
        raise typer.BadParameter("'' is not a file name")
    return Path(text)


Arrivals = Annotated[
    Path | None,
    option("Replay these: demand_time_s, lane, manoeuvre.", "FILE", parser=_file_name,
           rich_help_panel=FILES),
]  # fmt: skip

DemandFile = Annotated[
    Path | None,
    option("Draw from these rates by time of day.", "FILE", "--demand", parser=_file_name,
           rich_help_panel=FILES),
]  # fmt: skip

Start = Annotated[str | None, option("Begin here in the file.", "07:00", rich_help_panel=FILES)]


def say_replaced(scenarios: Iterable[Scenario]) -> None:
    """Say on stderr which fleets replace those of the demand."""
    for sentence in dict.fromkeys(it.replaced for it in scenarios if it.replaced):
        typer.echo(f"minisim: {sentence}", err=True)


def processes(jobs: int | None) -> int:
    """The number of processes that --jobs asks for, or one per core."""
    return integer("--jobs", (os.cpu_count() or 1) if jobs is None else jobs, low=1, high=1024)


def check_distinct(given: Mapping[str, Sequence[Any] | None]) -> None:
    """Raise `InputError` if an option has a value twice; None means not given."""
    for name, values in given.items():
        for value, count in Counter(values or ()).items():
            if count > 1:
                raise InputError(f"{name} {value} is given twice")


def build_scenario(
    name: str,
    bearings: str | None,
    file: Path | None = None,
    start: str | None = None,
    demand: Path | None = None,
    **more: Any,
) -> Scenario:
    """The scenario that the options describe; None means not given."""
    from minisim.demandfile import read_demand
    from scenarios.library import refuse_beside, replayed, scenario_named

    given = {key: value for key, value in more.items() if value is not None}
    drawn = [f"--{key}" for key in ("density", "split", "turns", "unit") if key in given]
    if demand is not None:
        refuse_beside("--demand", drawn)
        given["demand"] = read_demand(demand, start)
        drawn = ["--demand"]
    if file is not None:
        refuse_beside("--arrivals", drawn)
    elif demand is None and start is not None:
        raise InputError("--start needs --arrivals or --demand: it is a time of day there")
    made = scenario_named(name, None if bearings is None else _bearings(bearings), **given)
    say_replaced([made])
    return made if file is None else replayed(made, file, start)


def _bearings(text: str) -> list[float]:
    values = []
    for part in text.split(","):
        try:
            values.append(number(part, float(part)))
        except ValueError:
            got = f"got {text!r}: {part!r} is not a finite number"
            raise InputError(f"--bearings must be like 0,80,190,260, {got}") from None
    return values
