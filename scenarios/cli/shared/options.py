"""Options that several commands share, and the scenario that they describe."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError, integer
from minisim.junction.movements import ARM_NAMES

if TYPE_CHECKING:
    from minisim.arrivals import Arrivals as ArrivalTable
    from scenarios.scenario import Scenario

#: A group of options in the help.
FILES = "Files"

ScenarioName = Annotated[
    str,
    typer.Argument(metavar="SCENARIO", help="three-way, four-way, 6-way, … or custom."),
]
ControllerName = Annotated[
    str,
    typer.Option(
        "--controller", "-c", metavar="SPEC", show_default=False,
        help="Who decides: dim, dim:gate=harmonious, …",
    ),
]  # fmt: skip
Humans = Annotated[
    float,
    typer.Option(metavar="SHARE", show_default=False, help="Human drivers among DIM's, 0 … 1."),
]
Density = Annotated[
    float | None,
    typer.Option(
        "--density", "-d", metavar="VEH/H",
        help="Mean inflow a lane; 350 unless told.",
    ),
]  # fmt: skip
Split = Annotated[
    str | None, typer.Option(metavar="4:3:2:1", help="Shares of the lanes a, b, c, …")
]
Turns = Annotated[str | None, typer.Option(metavar="1:2:1", help="Shares of the exits, clockwise.")]
ProfileName = Annotated[
    str,
    typer.Option(
        "--profile", "-p", metavar="NAME", show_default=False,
        help="Vehicle and speeds: paper, fair, as_run.",
    ),
]  # fmt: skip
Side = Annotated[
    str, typer.Option(metavar="SIDE", show_default=False, help="Of the traffic: left or right.")
]
Bearings = Annotated[
    str | None, typer.Option(metavar="0,90,…", help="Of custom's arms, from north.")
]
Seed = Annotated[
    int,
    typer.Option(
        "--seed", "-s", metavar="N", show_default=False,
        help="Of the random arrivals; 0 unless told.",
    ),
]  # fmt: skip
Order = Annotated[
    str,
    typer.Option(
        metavar="size|lanes",
        help="Prefer the largest clique (the paper's words) or the highest-priority lanes "
        "(its published runs).",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]
Folder = Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="Folder to write to.")]
Jobs = Annotated[
    int | None,
    typer.Option(metavar="N", help="Processes to use; one a core by default."),
]
Quick = Annotated[bool, typer.Option("--quick", help="Fewer and shorter runs: a smoke test.")]


def _file_name(text: str) -> Path:
    if not text:
        raise typer.BadParameter("'' is no file name")
    return Path(text)


Arrivals = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", parser=_file_name, rich_help_panel=FILES,
        help="Replay these: demand_time_s, lane, manoeuvre.",
    ),
]  # fmt: skip


def processes(jobs: int | None) -> int:
    """The number of processes that --jobs asks for; one a core where it is not given."""
    return integer("--jobs", (os.cpu_count() or 1) if jobs is None else jobs, low=1, high=1024)


def build_scenario(
    name: str, bearings: str | None, arrivals: Path | None = None, **options: Any
) -> Scenario:
    """The scenario that the options describe; None is an option that was not given."""
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


#: So many arrivals use the last lane or the last manoeuvre. With equal shares on 4 arms, the chance
#: that they use neither is (1/2)^30, one in 10^9.
ENOUGH = 30


def _check_arms(path: Path, recorded: ArrivalTable, n: int) -> None:
    """Refuse a table from a junction with fewer arms: its manoeuvres would mean other exits."""
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
