"""Every controller under the traffic that the paper names: Indian vehicles, counted in PCU."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

from scenarios.controllers import RIVALS, controller_named
from scenarios.library import regular
from scenarios.paper import DENSITIES
from scenarios.recipe import Recipe
from scenarios.studies.shared.study import Study

#: The fleets compared: cars alone, and the vehicles registered in India.
FLEETS = ("car", "india")

#: Width of lanes with which buses fit the paper's junctions: that of IRC:86-1983 for towns [m].
LANE_WIDTH = 3.5


class FleetPoint(NamedTuple):
    """A controller at a demand in passenger car units."""

    series: str  # the controller, as on the command line
    fleet: str  # by name
    arms: int  # of the junction
    density: float  # mean inflow per lane [PCU/h]

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed."""
        scenario = regular(
            self.arms, self.density, unit="pcu", fleet=self.fleet, profile="fair",
            lane_width=LANE_WIDTH, horizon=horizon,
        )  # fmt: skip
        controller = controller_named(self.series, scenario.profile)
        return Recipe(scenario, controller, seed, label=self.series, on_collision="record")

    @property
    def where(self) -> str:
        """What distinguishes it from other points of its series, besides demand."""
        return f"{self.arms} arms, {self.fleet}"


STUDY = Study(
    "mixed",
    "Does the paper's claim hold for the traffic that it names?",
    tuple(
        FleetPoint(name, fleet, arms, float(density))
        for fleet, arms, name, density in product(FLEETS, (3, 4, 5), RIVALS, DENSITIES)
    ),
)
