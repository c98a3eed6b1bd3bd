"""The paper's runs: their set-up, replays of them, and the paper's numbers.

The paper compares DIM with a fixed-time signal (`fts`), an adaptive one (`ats`) and V2I-C
(`v2ic`). Some of its runs were not what their labels say; `RAN` lists them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING, NamedTuple

from baselines import Actuated, Adaptive, FixedTime
from dim import AsRunDim
from minisim.control import Controller
from minisim.errors import InputError, choice, integer
from minisim.vehicle import CruiseVehicle
from scenarios.controllers import controller_named
from scenarios.library import MAKERS
from scenarios.profiles import AS_RUN, AS_RUN_OBEYING, AS_RUN_SIGNALS, Profile
from scenarios.published import (
    PUBLISHED_ARMS,
    RENAMED,
    RENAMED_ARMS,
    TURNAROUNDS,
    published_arrivals,
    published_ways,
)
from scenarios.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

#: Mean inflows per lane in every published series [veh/h].
DENSITIES = (150, 200, 250, 300, 350)

#: Splits of the inflow over the lanes, as in `reference.csv`.
SPLITS = ("balanced", "4:3:2:1", "4:1:4:1")

#: Mean inflow per lane [veh/h] -> green [s] in the published fixed-time runs: Webster's, rounded as
#: in the paper's table. The 5 and 7 s follow from the trips, whose cycles last 28 and 36 s. The
#: 61.75 s is in the network file, the 19.25 s (printed 19.75) in that of the adaptive signal.
GREENS = {150: 5.0, 200: 7.0, 250: 10.75, 300: 19.25, 350: 61.75}

#: The published signals' phases begin with netconvert's first link: south, east, north, west.
PHASES = (2, 1, 0, 3)

#: The paper's names for the controllers, as in `reference.csv` -> ours.
SERIES: Mapping[str, str] = {
    "dim": "dim", "fts": "fixed-time", "ats": "adaptive", "v2ic": "v2ic"
}  # fmt: skip


#: The series of the two signals.
SIGNALS = ("fts", "ats")


class Cell(NamedTuple):
    """A published run: one of `SPLITS`, inflow per lane [veh/h], arms, and a key of `SERIES`."""

    split: str
    density: int
    arms: int
    controller: str = "dim"

    def __str__(self) -> str:
        prefix = "" if self.controller == "dim" else f"{self.controller}, "
        return f"{prefix}{self.split} {self.density} veh/h, {self.arms} arms"


#: Every published run of DIM. On 3 and 5 arms, all lanes have equal inflow.
GRID: tuple[Cell, ...] = (
    *(Cell("balanced", density, arms) for arms in PUBLISHED_ARMS for density in DENSITIES),
    *(Cell(split, density, 4) for split in SPLITS[1:] for density in DENSITIES),
)

#: Every published run of the other controllers, all on 4 arms.
BASELINE_GRID: tuple[Cell, ...] = tuple(
    Cell(split, density, 4, controller)
    for controller in ("fts", "ats", "v2ic")
    for split in SPLITS
    for density in DENSITIES
)


class Ran(NamedTuple):
    """How a published run was set up; None where its label is right.

    Attributes:
        shares: split of the inflow over the arms, clockwise from north.
        controller: its spelling, as in `scenarios.controllers`.
        green: the green time of a fixed-time signal, the same at every density [s].
        profile: the profile that has the vehicle of the run.
    """

    shares: str | None = None
    controller: str | None = None
    green: float | None = None
    profile: Profile | None = None


#: Controller and split -> what ran, where the label is wrong. The unbalanced runs of the fixed-time
#: signal had DIM's vehicle: the program that ran them switches that vehicle's ACC on, and their
#: trips have a speed factor of 1.00 and the 0.16 s of waiting that such a vehicle starts with.
RAN: dict[tuple[str, str], Ran] = {
    ("v2ic", "4:3:2:1"): Ran(shares="balanced", controller="v2ic-as-run:approach_speed=14"),
    ("fts", "4:3:2:1"): Ran(green=5.0, profile=AS_RUN_OBEYING),
    ("ats", "4:3:2:1"): Ran(controller="actuated"),
    ("v2ic", "4:1:4:1"): Ran(shares="4:4:1:1", controller="v2ic-as-run:approach_speed=14"),
    ("fts", "4:1:4:1"): Ran(shares="4:4:1:1", profile=AS_RUN_OBEYING),
    ("ats", "4:1:4:1"): Ran(shares="4:4:1:1"),
}

#: What a label means: a controller and the profile of its balanced runs.
LABELS: dict[str, tuple[str, Profile]] = {
    "dim": ("dim-as-run", AS_RUN),
    "fts": ("fixed-time", AS_RUN_SIGNALS),
    "ats": ("adaptive", AS_RUN_SIGNALS),
    "v2ic": ("v2ic-as-run", AS_RUN),
}


def scenario(
    split: str,
    density: int,
    arms: int,
    controller: str = "dim",
    *,
    profile: str | Profile | None = None,
    as_labelled: bool = False,
) -> Scenario:
    """The scenario of a published run, with arrivals drawn by seed.

    Args:
        split, density, arms, controller: see `Cell`.
        profile: None for that of the published run.
        as_labelled: whether to build what the label says instead of what ran (`RAN`).

    Raises:
        InputError: no such cell, or an unknown profile.
    """
    cell = _cell(split, density, arms, controller)
    ran = _ran(cell, as_labelled)
    return MAKERS[cell.arms](
        cell.density, split=ran.shares or split, profile=profile or _profile(cell, ran)
    )


def replay(
    split: str,
    density: int,
    arms: int,
    controller: str = "dim",
    *,
    profile: str | Profile | None = None,
    sumo: str = "1.18",
) -> Scenario:
    """The scenario of a published run, with its own arrivals.

    With the controller of `controller_of` and `on_collision="teleport"`, the trips of DIM equal
    those of SUMO 1.18 on the same arrivals, vehicle by vehicle. The records lack the vehicles that
    were still on the road at the end of a published run.

    `sumo` is the version of SUMO to compare with. The published runs were made with 1.18. The
    installed host is 1.28; its radar sees less, and it builds no turnarounds.

    Raises:
        InputError: no such cell, or an unknown profile or version.
    """
    made = replace(
        scenario(split, density, arms, controller, profile=profile),
        recorded=published_arrivals(split, density, arms, controller),
    )
    vehicle, road = made.profile.vehicle, made.intersection
    if vehicle.sumo is None or road.ways is None:
        return made
    turnarounds, network = TURNAROUNDS[split] if arms == 4 else "", ""
    if sumo != "1.18":
        turnarounds = ""
        if isinstance(vehicle, CruiseVehicle):
            vehicle = replace(vehicle, sumo=sumo, obeys=False)
        else:
            vehicle = replace(vehicle, sumo=None)
    elif controller in SIGNALS and split == RENAMED:
        turnarounds = ""
    if controller in SIGNALS:
        network = "waiting" if controller == "fts" and split == RENAMED else "signals"
    ways = published_ways(arms, turnarounds, network)
    return replace(
        made, intersection=replace(road, ways=ways), profile=replace(made.profile, vehicle=vehicle)
    )


def controller_of(
    split: str, density: int, arms: int, controller: str = "dim", *, as_labelled: bool = False
) -> Controller:
    """The controller of a published run, or the one that its label names.

    Raises:
        InputError: no such cell.
    """
    cell = _cell(split, density, arms, controller)
    ran = _ran(cell, as_labelled)
    if cell.controller == "fts":
        green = 19.75 if cell.split == RENAMED and cell.density == 300 else GREENS[cell.density]
        return FixedTime(greens=ran.green or green, order=PHASES)
    if cell.controller == "ats":
        actuated = ran.controller == "actuated"
        return Actuated(order=PHASES, presence=False) if actuated else Adaptive(order=PHASES)
    if cell.controller == "dim" and cell.split == RENAMED:
        return AsRunDim(names=RENAMED_ARMS)
    return controller_named(ran.controller or LABELS[cell.controller][0], _profile(cell, ran))


def _ran(cell: Cell, as_labelled: bool) -> Ran:
    return Ran() if as_labelled else RAN.get((cell.controller, cell.split), Ran())


def _profile(cell: Cell, ran: Ran) -> Profile:
    return ran.profile or LABELS[cell.controller][1]


@lru_cache
def _reference() -> pd.DataFrame:
    import pandas as pd

    with (resources.files("scenarios") / "data" / "reference.csv").open(encoding="utf-8") as text:
        return pd.read_csv(text).fillna({"note": ""})


def reference() -> pd.DataFrame:
    """Every number that the paper plots or prints, one per row.

    Columns: figure, controller, arms, split, density [veh/h], metric, lane ("all" or a letter),
    value [s], trips, last_arrival_s, source, note, comparable ("yes", or why not).
    """
    return _reference().copy()


def reference_rows(cell: Cell, metric: str, lane: str = "all") -> pd.DataFrame:
    """The row of `reference` for a metric of a cell, as a table of one row or none."""
    table = _reference()
    asked = {**cell._asdict(), "metric": metric, "lane": lane}
    return table[(table[list(asked)] == list(asked.values())).all(axis="columns")].copy()


def _cell(split: str, density: int, arms: int, controller: str) -> Cell:
    choice("split", split, SPLITS)
    choice("published controller", controller, LABELS)
    cell = Cell(
        split,
        integer("density [veh/h]", density, low=0),
        integer("number of arms", arms, low=0),
        controller,
    )
    if cell not in GRID and cell not in BASELINE_GRID:
        raise InputError(
            f"the paper has no run of {cell}; on 3 and 5 arms it has only balanced runs of DIM"
        )
    return cell
