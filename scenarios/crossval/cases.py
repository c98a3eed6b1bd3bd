"""The cells that are compared: a controller at a junction with a demand and a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from minisim.errors import InputError, choice
from minisim.parameters import declared, part, text
from minisim.shares import BALANCED, read_shares, shares_text
from scenarios import paper
from scenarios.controllers import controller_named
from scenarios.crossval.comparison import Tolerance
from scenarios.library import MAKERS
from scenarios.paper import DENSITIES, SERIES, SPLITS, Cell
from scenarios.profiles import AS_RUN, Profile
from scenarios.recipe import Recipe
from scenarios.scenario import Scenario

#: Controllers of the published runs: command-line name -> name in `reference.csv`.
PUBLISHED: Final = {ours: theirs for theirs, ours in SERIES.items()}

#: Names of the published junctions -> number of arms.
JUNCTIONS: Final = {"three-way": 3, "four-way": 4, "five-way": 5}

#: How far a replay's mean travel time may be from the published one, by the controller's name in
#: `reference.csv` [s]. Parts of the published set-up are not on record; this allows for them.
TRAVEL: Final = {"dim": 0.5, "fts": 2.0, "ats": 2.0, "v2ic": 1.0}

#: The same for DIM at 350 veh/h [s]. There, two vehicles of the published runs were teleported, and
#: the order of vehicles that arrived in the same second matters more.
TRAVEL_350: Final = 3.0

#: The version of SUMO that is the other host; minisim can drive like it.
HOST_VERSION: Final = "1.28"


@declared
class Case:
    """One cell; raises `InputError` if its controller is unknown or cannot be made."""

    scenario: Scenario = part("junction, demand and profile", Scenario)
    controller: str = text("its command-line name")
    published: Cell | None = part(
        "the published run that is replayed; None if arrivals are drawn", Cell,
        optional=True, default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        self.recipe()

    def recipe(self, seed: int = 0) -> Recipe:
        """The run of one seed; a replay with the published vehicle uses the published controller.

        Vehicles do touch in the published runs; in other runs that is an error.
        """
        if self.published is not None and self.same_law:
            controller = paper.controller_of(*self.published)
        else:
            controller = controller_named(self.controller, self.scenario.profile)
        reaction = "record" if self.same_law else "stop"
        return Recipe(self.scenario, controller, seed, label=self.controller, on_collision=reaction)

    @property
    def split(self) -> str:
        """The demand's split, such as "4:3:2:1"; for a published run, the one in its label."""
        if self.published is not None:
            return self.published.split
        return self.scenario.demand.words[0]

    @property
    def density(self) -> float:
        """Mean demanded inflow per lane [veh/h]."""
        return self.scenario.density if self.published is None else self.published.density

    @property
    def fleet(self) -> str:
        """The fleet, such as "car:0.9,bus:0.1"; empty for the profile's vehicle alone."""
        vehicles = self.scenario.vehicles
        return "" if vehicles.types == (self.scenario.profile.vehicle,) else str(vehicles)

    @property
    def name(self) -> str:
        """The cell's name, such as "four-way balanced 350 dim"."""
        words = (self.scenario.name, self.split, f"{self.density:g}", self.fleet, self.controller)
        return " ".join(filter(None, words))

    @property
    def same_law(self) -> bool:
        """Whether SUMO moves the vehicles by the same law as minisim does."""
        return self.scenario.profile.name.startswith(AS_RUN.name)

    def reference(self, metric: str, lane: str) -> float | None:
        """The paper's mean [s]; None if the paper has none that this cell should reproduce."""
        if not self.same_law or self.scenario.horizon != 3600.0:  # the published runs' horizon
            return None
        name = PUBLISHED.get(self.controller)
        if name is None or not float(self.density).is_integer():
            return None
        cell = Cell(self.split, int(self.density), self.scenario.intersection.n, name)
        chosen = paper.reference_rows(cell, metric, lane)
        if self.published is None:
            chosen = chosen[chosen["comparable"] == "yes"]
        return None if chosen.empty else float(chosen["value"].iloc[0])

    def reference_tolerance(self, metric: str) -> Tolerance | None:
        """How far a replay may be from the published mean; None for any other cell.

        Waiting times: 10 %; travel times: as in `TRAVEL` and `TRAVEL_350`.
        """
        if self.published is None:
            return None
        name, busiest = self.published.controller, self.published.density == max(DENSITIES)
        travel = TRAVEL_350 if name == "dim" and busiest else TRAVEL[name]
        known = {"waiting_time_s": Tolerance(0.10), "travel_time_s": Tolerance(0.0, travel)}
        return known.get(metric)


def replayed_cases(
    names: Sequence[str], controllers: Sequence[str], densities: Sequence[float],
    splits: Sequence[str], profile: str | Profile | None, horizon: float,
) -> list[Case]:  # fmt: skip
    """The published runs with these junctions, controllers, densities and splits; empty means all.

    Densities [veh/h] and splits are as in the runs' labels. With profile None, each run keeps its
    own vehicle and controller; otherwise it has the profile's. Raises `InputError` for an unknown
    name, or if no published run matches.
    """
    splits = [shares_text(read_shares("split", split, BALANCED), BALANCED) for split in splits]
    for split in splits:
        choice("split of a published run", split, SPLITS)
    arms = [JUNCTIONS[choice("junction of a published run", name, JUNCTIONS)] for name in names]
    ran = {PUBLISHED[choice("published controller", name, PUBLISHED)]: name for name in controllers}
    cases = [
        Case(replace(scenario, horizon=horizon), ran[cell.controller], cell)
        for cell in (*paper.GRID, *paper.BASELINE_GRID)
        if cell.controller in ran
        and cell.arms in (arms or MAKERS)
        and cell.density in (densities or DENSITIES)
        and cell.split in (splits or SPLITS)
        for scenario in [paper.replay(*cell, profile=profile, sumo=HOST_VERSION)]
    ]
    if not cases:
        wanted = [*names, *splits, *(f"{density:g} veh/h" for density in densities)]
        raise InputError(
            f"the paper has no {' or '.join(controllers)} run of {', '.join(wanted)}; it has "
            f"{', '.join(map(str, DENSITIES))} veh/h; on 3 and 5 arms, only dim and balanced"
        )
    return cases
