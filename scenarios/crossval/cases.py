"""The cells that are compared: a controller at a junction with a demand and a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from minisim.errors import InputError, choice, instance
from scenarios.controllers import controller_named
from scenarios.crossval.comparison import Tolerance
from scenarios.library import scenario_named
from scenarios.paper import DENSITIES, GRID, SPLITS, Cell, reference, replay
from scenarios.scenario import AS_RUN, Profile, Scenario, parse_split

#: Controllers of the published runs: command-line name -> name in `reference.csv`.
PUBLISHED: Final = {
    "dim": "dim",
    "dim-as-run": "dim",
    "fixed-time": "fts",
    "adaptive": "ats",
    "v2ic": "v2ic",
}

#: Horizon of the published runs [s].
HOUR: Final = 3600.0


@dataclass(frozen=True)
class Case:
    """One cell.

    Attributes:
        scenario: junction, demand and profile.
        controller: its command-line name.
        published: the published run whose arrivals are replayed; None where they are drawn.
    """

    scenario: Scenario
    controller: str
    published: Cell | None = None

    def __post_init__(self) -> None:
        instance("scenario", self.scenario, Scenario)
        controller_named(self.controller, self.scenario.profile)

    @property
    def split(self) -> str:
        """Of the demand, such as "4:3:2:1"."""
        shares = self.scenario.demand.split
        return "balanced" if shares is None else ":".join(f"{share:g}" for share in shares)

    @property
    def density(self) -> float:
        """Mean inflow a lane that was demanded [veh/h]."""
        return self.scenario.demand.density

    @property
    def name(self) -> str:
        """Such as "four-way balanced 350 dim"."""
        return f"{self.scenario.name} {self.split} {self.density:g} {self.controller}"

    @property
    def same_law(self) -> bool:
        """Whether SUMO moves the vehicles by the very law of minisim."""
        return self.scenario.profile.name.startswith(AS_RUN.name)

    def reference(self, metric: str, lane: str) -> float | None:
        """The paper's mean [s]; None where it has none that the cell could be expected to give."""
        if not self.same_law or self.scenario.horizon != HOUR:
            return None
        table = reference()
        chosen = table[
            (table["controller"] == PUBLISHED.get(self.controller))
            & (table["arms"] == self.scenario.intersection.n)
            & (table["split"] == self.split)
            & (table["density"] == self.density)
            & (table["metric"] == metric)
            & (table["lane"] == lane)
        ]
        if self.published is None:
            chosen = chosen[chosen["comparable"] == "yes"]
        return None if chosen.empty else float(chosen["value"].iloc[0])

    def reference_tolerance(self, metric: str) -> Tolerance | None:
        """What a replay may differ from the published mean by; None for any other cell.

        Waiting 10 %, travel 0.5 s, and 3 s at 350 veh/h, where two vehicles of the published runs
        were teleported and the order of vehicles that came in the same second is not on record.
        """
        if self.published is None:
            return None
        travel = 3.0 if self.published.density == max(DENSITIES) else 0.5
        return {
            "waiting_time_s": Tolerance(0.10),
            "travel_time_s": Tolerance(0.0, travel),
        }.get(metric)


def drawn_cases(
    names: Sequence[str],
    controllers: Sequence[str],
    densities: Sequence[float],
    splits: Sequence[str],
    profile: str | Profile,
    horizon: float,
) -> list[Case]:
    """Every junction × split × controller × density, arrivals drawn by seed.

    Raises:
        InputError: an unknown name, or an impossible demand.
    """
    return [
        Case(
            scenario_named(
                name, density=density, split=_shares(split), profile=profile, horizon=horizon
            ),
            controller,
        )
        for name in names
        for split in splits
        for controller in controllers
        for density in densities
    ]


def replayed_cases(
    names: Sequence[str],
    controllers: Sequence[str],
    densities: Sequence[float],
    splits: Sequence[str],
    profile: str | Profile,
    horizon: float,
) -> list[Case]:
    """The published runs of DIM, of these junctions, densities and splits; all where empty.

    Raises:
        InputError: an unknown name, or no published run is left.
    """
    cases = []
    for split in splits:
        choice("split of a published run", split, SPLITS)
    for name in names:
        choice("junction of a published run", name, ("three-way", "four-way", "five-way"))
    for cell in GRID:
        scenario = replace(replay(*cell, profile=profile), horizon=horizon)
        chosen = (
            (not names or scenario.name in names)
            and (not densities or cell.density in densities)
            and (not splits or cell.split in splits)
        )
        cases += [Case(scenario, controller, cell) for controller in controllers if chosen]
    if not cases:
        wanted = [*names, *splits, *(f"{density:g} veh/h" for density in densities)]
        raise InputError(
            f"the paper has no DIM run of {', '.join(wanted)}; it has "
            f"{', '.join(map(str, DENSITIES))} veh/h, and 3 and 5 arms balanced only"
        )
    return cases


def _shares(split: str) -> Sequence[float] | None:
    return None if split == "balanced" else parse_split(split)
