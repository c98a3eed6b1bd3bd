"""Options that several commands share, and the scenario that they describe."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from minisim.errors import InputError
from minisim.junction.geometry import ARM_NAMES

if TYPE_CHECKING:
    from minisim.arrivals import Arrivals as ArrivalTable
    from minisim.results.metrics import Metric
    from scenarios.scenario import Scenario

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
        help="Who decides: dim (the paper's rules; the authors' under the profile as_run), "
        "dim-harmonious (enter beside crossing vehicles in harmony), dim-lanes, dim-inflow, "
        "dim-rotating, dim-waiting, dim-lanes-rotating, dim-lanes-waiting, "
        "dim-paper-commit, dim-monitored (a safety monitor in every vehicle), "
        "dim-symmetric-0.15 (15 % of intents misread), dim-unsignalled "
        "(turns without signal at published rates), dim-occlusion (bodies block the view), "
        "dim-as-run, "
        "dim-as-run-size, dim-as-run-exit-14, fixed-time, "
        "fixed-time-equal, adaptive, actuated, all-way-stop, longest-queue, "
        "v2ic (serving list and speed advice; the published run's under the profile as_run), "
        "v2ic-as-run, v2ic-as-run-14, reservation (space-time, first come first served), "
        "unregulated.",
    ),
]  # fmt: skip
Humans = Annotated[
    float,
    typer.Option(
        metavar="SHARE",
        help="Share of human drivers among the vehicles, 0 … 1: they stop, look, and accept gaps. "
        "With the controllers of DIM.",
    ),
]
IntentError = Annotated[
    float,
    typer.Option(
        metavar="P",
        help="Probability that vehicles of DIM misread another's intent, 0 … 1. Collisions are "
        "then likely: see --on-collision.",
    ),
]
ErrorKind = Annotated[
    str | None,
    typer.Option(
        metavar="missed|symmetric",
        help="What --intent-error does: miss the signal of a turn (default), or take any manoeuvre "
        "for each other one alike. Everybody errs alike, for as long as they meet.",
    ),
]
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
        help="Vehicle and speeds: paper (what its text prescribes), fair (one vehicle and "
        "speed limit for every controller), as_run (what produced the published numbers) or "
        "as_run_signals (the vehicle of its signals).",
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
Seed = Annotated[int, typer.Option("--seed", "-s", help="Of the random arrivals.")]


def _file_name(text: str) -> Path:
    if not text:
        raise typer.BadParameter("'' is no file name")
    return Path(text)


Arrivals = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", parser=_file_name,
        help="CSV of recorded arrivals (demand_time_s, lane, manoeuvre) to replay instead of "
        "drawing them.",
    ),
]  # fmt: skip
Host = Annotated[
    str,
    typer.Option(
        metavar="minisim|sumo",
        help="Who moves the vehicles: minisim, or SUMO under the same controller "
        "(pip install 'minisim\\[sumo]').",
    ),
]
SumoModel = Annotated[
    str | None,
    typer.Option(
        metavar="IDM|Krauss|CC",
        help="SUMO's car-following model; by default the vehicle's own.",
        show_default=False,
    ),
]  # fmt: skip
Gui = Annotated[bool, typer.Option("--gui", help="Show the run in sumo-gui.")]
KeepFiles = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Keep SUMO's network, routes, log and trips there, in a new or empty folder.",
    ),
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
    typer.Option(metavar="FILE", help="Write SUMO's own floating-car data (XML) of every step."),
]
Metrics = Annotated[
    str | None,
    typer.Option(
        metavar="NAME,NAME",
        help="Measure these, means with median, 95th percentile and maximum; minisim metrics "
        "lists them.",
    ),
]
By = Annotated[str, typer.Option(metavar="lane|movement|kind", help="What the table is by.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.")]


def chosen_metrics(text: str | None) -> tuple[Metric, ...]:
    """The metrics that an option names; raises `InputError` for an unknown one."""
    from minisim.results.metrics import asked_metrics

    return asked_metrics([] if text is None else [name.strip() for name in text.split(",")])


def build_scenario(
    name: str,
    bearings: str | None,
    arrivals: Path | None = None,
    density: float | None = None,
    split: str | None = None,
    turns: str | None = None,
    **options: Any,
) -> Scenario:
    """The scenario that the options describe; raises `MinisimError` for what they may not be."""
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


def _numbers(option: str, text: str, separator: str, example: str) -> tuple[float, ...]:
    values = []
    for part in text.split(separator):
        try:
            value = float(part)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(
                f"{option} is written like {example}, got {text!r}: {part!r} is no finite number"
            )
        values.append(value)
    return tuple(values)
