"""The paper's grid of experiments, its reference numbers, and replays of its runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING, NamedTuple

from minisim.errors import InputError, choice, integer
from scenarios.controllers import controller_named
from scenarios.experiment import Experiment
from scenarios.library import five_way, four_way, three_way
from scenarios.published import PUBLISHED_ARMS, published_arrivals
from scenarios.scenario import AS_RUN, FAIR, Profile, Scenario, parse_split, profile_named

if TYPE_CHECKING:
    import pandas as pd

#: Mean inflows a lane of every published series [veh/h].
DENSITIES = (150, 200, 250, 300, 350)

#: Splits of the inflow over the lanes, as in `reference.csv`.
SPLITS = ("balanced", "4:3:2:1", "4:1:4:1")

#: Controllers that the paper compares on 4 arms, by their names here; DIM alone on 3 and 5.
COMPARED = ("dim", "fixed-time", "adaptive", "v2ic")

MAKERS = {3: three_way, 4: four_way, 5: five_way}


class Cell(NamedTuple):
    """One published run of DIM.

    Attributes:
        split: one of `SPLITS`.
        density: mean inflow a lane [veh/h].
        arms: of the junction.
    """

    split: str
    density: int
    arms: int

    def __str__(self) -> str:
        return f"{self.split} {self.density} veh/h, {self.arms} arms"


#: Every published run of DIM: 3 and 5 arms with equal inflow only.
GRID: tuple[Cell, ...] = (
    *(Cell("balanced", density, arms) for arms in PUBLISHED_ARMS for density in DENSITIES),
    *(Cell(split, density, 4) for split in SPLITS[1:] for density in DENSITIES),
)


def experiments(
    profile: str | Profile = "paper",
    seeds: Iterable[int] = range(1, 11),
    horizon: float = 3600.0,
    controllers: Iterable[str] = COMPARED,
) -> list[Experiment]:
    """The paper's whole grid: 70 cells with all controllers, each with every seed.

    Collisions are counted and do not stop a run, for two of the published controllers collide.

    Raises:
        InputError: an unknown profile or controller, or a horizon or seed that is not allowed.
    """
    chosen = profile_named(profile)
    names, runs = list(controllers), list(seeds)
    return [
        Experiment(
            replace(scenario(*cell, profile=chosen), horizon=horizon),
            controller_named(_recipe(name, cell, chosen), chosen),
            seed,
            label=name,
            on_collision="record",
        )
        for cell in GRID
        for name in names
        if cell.arms == 4 or name == "dim"
        for seed in runs
    ]


def _recipe(name: str, cell: Cell, profile: Profile) -> str:
    """The controller that goes under a name in a cell.

    With unequal inflow "the lane priorities are set according to the incoming traffic" (Results
    and Discussion); as run they were not. The paper's greens depend on the mean density alone
    (its table of Webster's times), so the signal's are equal, but where comparison is to be fair.
    """
    if cell.split == "balanced":
        return name
    if name == "dim" and profile.name != AS_RUN.name:
        return "dim-inflow"
    if name == "fixed-time" and profile.name != FAIR.name:
        return "fixed-time-equal"
    return name


def scenario(split: str, density: int, arms: int, profile: str | Profile = AS_RUN) -> Scenario:
    """A cell of the grid with arrivals drawn by seed.

    Raises:
        InputError: no such cell, or an unknown profile.
    """
    cell = _cell(split, density, arms)
    shares = None if cell.split == "balanced" else parse_split(cell.split)
    return MAKERS[cell.arms](cell.density, split=shares, profile=profile)


def replay(
    split: str,
    density: int,
    arms: int,
    profile: str | Profile = AS_RUN,
    *,
    controller: str = "dim",
) -> Scenario:
    """A cell of the grid with the arrivals of its published run under "dim" or "v2ic" (4 arms).

    Under the profile `as_run`, with `dim.AsRunDim` and collisions recorded, the trips are those
    of SUMO on the same arrivals, vehicle by vehicle. Vehicles of one second and lane are inserted
    in the order of their manoeuvres: which of them was first is not on record.

    Raises:
        InputError: no such cell, or an unknown profile.
    """
    cell = _cell(split, density, arms)
    arrivals = published_arrivals(*cell, controller)
    return MAKERS[cell.arms](
        cell.density,
        split=None if cell.split == "balanced" else parse_split(cell.split),
        profile=profile,
        recorded=arrivals,
    )


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


def reference_value(cell: Cell, metric: str, controller: str = "dim", lane: str = "all") -> float:
    """One published mean [s]; raises `InputError` where the paper has none."""
    table = _reference()
    choice("metric", metric, sorted(set(table["metric"])))
    choice("published controller", controller, sorted(set(table["controller"])))
    chosen = table[
        (table["controller"] == controller)
        & (table["arms"] == cell.arms)
        & (table["split"] == cell.split)
        & (table["density"] == cell.density)
        & (table["metric"] == metric)
        & (table["lane"] == lane)
    ]
    if chosen.empty:
        raise InputError(f"the paper has no {metric} of {controller}, lane {lane}, for {cell}")
    return float(chosen["value"].iloc[0])


def _cell(split: str, density: int, arms: int) -> Cell:
    choice("split", split, SPLITS)
    cell = Cell(
        split, integer("density [veh/h]", density, low=0), integer("number of arms", arms, low=0)
    )
    if cell not in GRID:
        raise InputError(f"the paper has no run of {cell}; 3 and 5 arms were balanced only")
    return cell
