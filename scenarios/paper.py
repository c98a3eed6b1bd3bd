"""The paper's runs: how each was set up, replays of them, and its reference numbers.

The paper compares DIM with a fixed-time signal (`fts`), an adaptive one (`ats`) and V2I-C
(`v2ic`). Some of its runs were not what their label says; `RAN` lists how.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from importlib import resources
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from baselines import Actuated, Adaptive, FixedTime
from dim import AsRunDim
from minisim.control import Controller
from minisim.errors import InputError, choice, integer
from minisim.vehicle import CruiseVehicle
from scenarios.controllers import controller_named
from scenarios.library import MAKERS
from scenarios.published import (
    PUBLISHED_ARMS,
    RENAMED,
    RENAMED_ARMS,
    TURNAROUNDS,
    published_arrivals,
    published_ways,
)
from scenarios.scenario import AS_RUN, AS_RUN_SIGNALS, Profile, Scenario

if TYPE_CHECKING:
    import pandas as pd

#: Mean inflows a lane of every published series [veh/h].
DENSITIES = (150, 200, 250, 300, 350)

#: Splits of the inflow over the lanes, as in `reference.csv`.
SPLITS = ("balanced", "4:3:2:1", "4:1:4:1")

#: What the paper compares DIM with, as in `reference.csv`; on 4 arms only.
BASELINES = ("fts", "ats", "v2ic")

#: Greens of the published fixed-time runs, by mean inflow a lane [s]: Webster's, as the paper's
#: table rounds them. 5 and 7 s follow from the trips, where cycles last 28 and 36 s; 61.75 is in
#: the network file, and 19.25 (the table prints 19.75) in that of the adaptive signal.
GREENS = {150: 5.0, 200: 7.0, 250: 10.75, 300: 19.25, 350: 61.75}

#: The published signals' phases begin with netconvert's first link: south, east, north, west.
PHASES = (2, 1, 0, 3)


#: Their names of all four -> ours.
SERIES: Mapping[str, str] = MappingProxyType(
    {"dim": "dim", "fts": "fixed-time", "ats": "adaptive", "v2ic": "v2ic"}
)


class Cell(NamedTuple):
    """One published run.

    Attributes:
        split: one of `SPLITS`.
        density: mean inflow a lane [veh/h].
        arms: of the junction.
        controller: "dim", or one of `BASELINES`.
    """

    split: str
    density: int
    arms: int
    controller: str = "dim"

    def __str__(self) -> str:
        who = "" if self.controller == "dim" else f"{self.controller}, "
        return f"{who}{self.split} {self.density} veh/h, {self.arms} arms"


#: Every published run of DIM: 3 and 5 arms with equal inflow only.
GRID: tuple[Cell, ...] = (
    *(Cell("balanced", density, arms) for arms in PUBLISHED_ARMS for density in DENSITIES),
    *(Cell(split, density, 4) for split in SPLITS[1:] for density in DENSITIES),
)

#: Every published run of the others.
BASELINE_GRID: tuple[Cell, ...] = tuple(
    Cell(split, density, 4, controller)
    for controller in BASELINES
    for split in SPLITS
    for density in DENSITIES
)


class Ran(NamedTuple):
    """How a published run was set up; a None stands for what the label says.

    Attributes:
        shares: of the inflow, by arm, clockwise from north; equal ones are "balanced".
        controller: name of a controller, see `scenarios.controllers`.
        green: of a fixed-time signal, at every density [s].
        profile: whose vehicle.
    """

    shares: str | None = None
    controller: str | None = None
    green: float | None = None
    profile: Profile | None = None


#: The runs that were not what they are labelled, by controller and split. The vehicle of the
#: fixed-time signal's unbalanced runs was that of DIM: their driver switches its ACC on, the trips
#: have a speed factor of 1.00 and the 0.16 s of waiting with which that vehicle starts.
RAN: dict[tuple[str, str], Ran] = {
    ("v2ic", "4:3:2:1"): Ran(shares="balanced", controller="v2ic-as-run:approach_speed=14"),
    ("fts", "4:3:2:1"): Ran(green=5.0, profile=AS_RUN),
    ("ats", "4:3:2:1"): Ran(controller="actuated"),
    ("v2ic", "4:1:4:1"): Ran(shares="4:4:1:1", controller="v2ic-as-run:approach_speed=14"),
    ("fts", "4:1:4:1"): Ran(shares="4:4:1:1", profile=AS_RUN),
    ("ats", "4:1:4:1"): Ran(shares="4:4:1:1"),
}

#: What the labels mean: each controller's name and the profile of its balanced runs.
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
    """A cell of the grid with arrivals drawn by seed.

    Args:
        split, density, arms, controller: see `Cell`.
        profile: None is that of the published run.
        as_labelled: what the label says, instead of what was run (`RAN`).

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
    """A cell of the grid with the arrivals of its published run.

    With `controller_of` the same cell and collisions answered by "teleport", the trips of DIM are
    those of SUMO 1.18 on the same arrivals, vehicle by vehicle. Vehicles that were still on the
    road at the end of a published run are not on record.

    Args:
        split, density, arms, controller: see `Cell`.
        profile: None is that of the published run.
        sumo: the version of SUMO to be compared with. The published runs were made with 1.18; the
            host of minisim is 1.28, whose radar sees less, and builds no turnarounds.

    Raises:
        InputError: no such cell, or an unknown profile or version.
    """
    cell = _cell(split, density, arms, controller)
    ran = _ran(cell, as_labelled=False)
    made = MAKERS[cell.arms](
        cell.density,
        split=ran.shares or split,
        profile=profile or _profile(cell, ran),
        recorded=published_arrivals(*cell),
    )
    vehicle, junction = made.profile.vehicle, made.intersection
    if not isinstance(vehicle, CruiseVehicle) or junction.ways is None:
        return made
    signals = cell.controller == "fts"  # its network has none
    turnarounds = "" if sumo != "1.18" or signals else TURNAROUNDS[split]
    ways = published_ways(cell.arms, turnarounds if cell.arms == 4 else "")
    return replace(
        made,
        intersection=replace(junction, ways=ways),
        profile=replace(made.profile, vehicle=replace(vehicle, sumo=sumo)),
    )


def controller_of(
    split: str, density: int, arms: int, controller: str = "dim", *, as_labelled: bool = False
) -> Controller:
    """What decided in a published run, or would have by its label.

    Raises:
        InputError: no such cell.
    """
    cell = _cell(split, density, arms, controller)
    ran = _ran(cell, as_labelled)
    if cell.controller == "fts":
        return FixedTime(greens=ran.green or GREENS[cell.density], order=PHASES)
    if cell.controller == "ats":
        signal = Actuated if ran.controller == "actuated" else Adaptive
        return signal(order=PHASES)
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
        table = pd.read_csv(text, keep_default_na=True)
    table["note"] = table["note"].fillna("")
    return table


def reference() -> pd.DataFrame:
    """Every number that the paper plots or prints, one a row.

    Columns: figure, controller, arms, split, density [veh/h], metric, lane ("all" or a letter),
    value [s], trips, last_arrival_s, source, note, comparable ("yes", or why not).
    """
    return _reference().copy()


def reference_rows(cell: Cell, metric: str, lane: str = "all") -> pd.DataFrame:
    """What the paper has of one mean of a cell: the rows of `reference`, none or one."""
    table = _reference()
    return table[
        (table["controller"] == cell.controller)
        & (table["arms"] == cell.arms)
        & (table["split"] == cell.split)
        & (table["density"] == cell.density)
        & (table["metric"] == metric)
        & (table["lane"] == lane)
    ].copy()


def reference_value(
    cell: Cell, metric: str, controller: str | None = None, lane: str = "all"
) -> float:
    """One published mean [s], of the cell's controller or of another; raises `InputError`."""
    table = _reference()
    if controller is not None:
        cell = cell._replace(controller=controller)
    choice("metric", metric, sorted(set(table["metric"])))
    choice("published controller", cell.controller, sorted(set(table["controller"])))
    rows = reference_rows(cell, metric, lane)
    if rows.empty:
        raise InputError(f"the paper has no {metric} of {cell.controller}, lane {lane}, for {cell}")
    return float(rows["value"].iloc[0])


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
            f"the paper has no run of {cell}; 3 and 5 arms were balanced only, and DIM's"
        )
    return cell
