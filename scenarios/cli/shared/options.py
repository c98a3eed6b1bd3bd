"""Options that several commands share, and the scenario that they describe."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError
from minisim.junction.movements import ARM_NAMES

if TYPE_CHECKING:
    from minisim.arrivals import Arrivals as ArrivalTable
    from minisim.results.metrics import Metric
    from scenarios.scenario import Scenario

#: Groups of the options of `minisim run` in its help.
FILES = "Files"
SUMO = "SUMO"

ScenarioName = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        show_default=False,
        help="three-way, four-way, 6-way, … or custom.",
    ),
]
ControllerName = Annotated[
    str,
    typer.Option(
        "--controller",
        "-c",
        metavar="SPEC",
        show_default=False,
        help="Who decides: dim, dim:gate=harmonious, …",
    ),
]
Humans = Annotated[
    float,
    typer.Option(metavar="SHARE", show_default=False, help="Human drivers among DIM's, 0 … 1."),
]
Density = Annotated[
    float | None,
    typer.Option(
        "--density",
        "-d",
        metavar="VEH/H",
        show_default=False,
        help="Mean inflow a lane; 350 unless told.",
    ),
]
Split = Annotated[
    str | None, typer.Option(metavar="4:3:2:1", help="Shares of the lanes a, b, c, …")
]
Turns = Annotated[str | None, typer.Option(metavar="1:2:1", help="Shares of the exits, clockwise.")]
ProfileName = Annotated[
    str,
    typer.Option(
        "--profile",
        "-p",
        metavar="NAME",
        show_default=False,
        help="Vehicle and speeds: paper, fair, as_run.",
    ),
]
Side = Annotated[
    str,
    typer.Option(
        metavar="SIDE",
        show_default=False,
        help="Of the traffic: left or right.",
    ),
]
Bearings = Annotated[
    str | None,
    typer.Option(metavar="0,90,…", help="Of custom's arms, from north."),
]
Seed = Annotated[
    int,
    typer.Option(
        "--seed",
        "-s",
        metavar="N",
        show_default=False,
        help="Of the random arrivals; 0 unless told.",
    ),
]
Horizon = Annotated[
    float, typer.Option(metavar="S", show_default=False, help="Simulated time; 3600 unless told.")
]
Warmup = Annotated[
    float, typer.Option(metavar="S", show_default=False, help="Earlier trips do not count.")
]


def _file_name(text: str) -> Path:
    if not text:
        raise typer.BadParameter("'' is no file name")
    return Path(text)


Arrivals = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        parser=_file_name,
        rich_help_panel=FILES,
        help="Replay these: demand_time_s, lane, manoeuvre.",
    ),
]
Host = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        show_default=False,
        rich_help_panel=SUMO,
        help="What moves vehicles: minisim or sumo.",
    ),
]
SumoModel = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        rich_help_panel=SUMO,
        help="IDM, Krauss or CC, if not its own.",
    ),
]
Gui = Annotated[bool, typer.Option("--gui", rich_help_panel=SUMO, help="Show the run in sumo-gui.")]
KeepFiles = Annotated[
    Path | None,
    typer.Option(metavar="DIR", rich_help_panel=SUMO, help="Keep SUMO's files in a new folder."),
]
Order = Annotated[
    str,
    typer.Option(
        metavar="size|lanes",
        help="Prefer the largest clique (the paper's words) or the highest-priority lanes "
        "(its published runs).",
    ),
]
SumoFcd = Annotated[
    Path | None,
    typer.Option(metavar="FILE", rich_help_panel=SUMO, help="SUMO's own floating-car data (XML)."),
]
Metrics = Annotated[
    str | None,
    typer.Option(metavar="A,B", help="Measure these; minisim metrics lists them."),
]
By = Annotated[
    str, typer.Option(metavar="X", show_default=False, help="Table by lane, movement or kind.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]


def chosen_metrics(text: str | None) -> tuple[Metric, ...]:
    """The metrics that an option names; raises `InputError` for an unknown one."""
    from minisim.results.metrics import asked_metrics

    return asked_metrics([] if text is None else [name.strip() for name in text.split(",")])


def build_scenario(
    name: str, bearings: str | None, arrivals: Path | None = None, **options: Any
) -> Scenario:
    """The scenario that the options describe; None stands for an option that was not given.

    Raises:
        MinisimError: an option that is not allowed.
    """
    from minisim.arrivals import read_arrivals
    from scenarios.library import scenario_named

    given = {key: value for key, value in options.items() if value is not None}
    clash = [f"--{key}" for key in ("density", "split", "turns") if key in given]
    if arrivals is not None and clash:
        raise InputError(f"--arrivals replaces {', '.join(clash)}; give one or the other")
    made = scenario_named(name, None if bearings is None else _bearings(bearings), **given)
    if arrivals is None:
        return made
    recorded = read_arrivals(arrivals, made.intersection.n)
    _check_arms(arrivals, recorded, made.intersection.n)
    return replace(made, recorded=recorded)


#: Arrivals that use neither the last lane nor the last manoeuvre by chance: with equal shares on 4
#: arms (1/2)^30, one in 10^9.
ENOUGH = 30


def _check_arms(path: Path, recorded: ArrivalTable, n: int) -> None:
    """Refuse a table that was recorded on a junction with fewer arms: it would be read wrongly."""
    if len(recorded) < ENOUGH:
        return
    arms = max(int(recorded.lane.max()) + 1, int(recorded.manoeuvre.max()) + 1)
    if arms < n:
        raise InputError(
            f"{path} looks like arrivals of a junction with {arms} arms: none comes from lane "
            f"{ARM_NAMES[n - 1]} or takes manoeuvre {n - 1}; the scenario has {n} arms"
        )


def _bearings(text: str) -> tuple[float, ...]:
    values = []
    for part in text.split(","):
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(
                f"--bearings is written like 0,80,190,260, got {text!r}: {part!r} is no finite "
                "number"
            )
        values.append(value)
    return tuple(values)
