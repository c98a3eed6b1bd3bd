"""How far every controller is above the least delay that is possible, whatever decides."""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

from dim import Dim, HarmonyMatrix
from minisim.control import Controller
from minisim.junction.movements import movements_of
from scenarios.controllers import RIVALS, controller_named
from scenarios.library import MAKERS
from scenarios.optimum import ABOVE, DELAY, LEAST, Clairvoyant, drained
from scenarios.recipe import Recipe
from scenarios.scenario import Scenario
from scenarios.studies.shared.study import Study

#: Knows all arrivals beforehand, so it is no rival, and shows how tight the bound is.
SCHEDULE = Clairvoyant.name

#: DIM as if no two movements were in conflict: its vehicles drive through each other.
HARMLESS = "dim without conflicts"

#: From free flow to the highest demand of the paper [veh/h/lane].
DENSITIES = (50.0, 150.0, 250.0, 350.0)


class DrainedPoint(NamedTuple):
    """A controller at a demand, on equal terms; its runs go on until all have arrived."""

    series: str  # the controller, as on the command line
    arms: int  # of the junction
    density: float  # mean inflow per lane [veh/h]

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed; vehicles come for half of the horizon."""
        scenario = drained(MAKERS[self.arms](self.density, profile="fair", horizon=horizon / 2.0))
        return Recipe(
            scenario, self._controller(scenario), seed, label=self.series, on_collision="record",
            metrics=(DELAY, LEAST, ABOVE),
        )  # fmt: skip

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""
        return f"{self.arms} arms"

    def _controller(self, scenario: Scenario) -> Controller:
        if self.series == SCHEDULE:
            return Clairvoyant(scenario)
        if self.series == HARMLESS:
            harmony = HarmonyMatrix(self.arms, movements_of(self.arms).apart)
            return Dim(gate="harmonious", matrix=harmony)
        return controller_named(self.series, scenario.profile)


STUDY = Study(
    "optimum",
    "How far is each controller above the least delay that is possible?",
    tuple(
        DrainedPoint(name, arms, density)
        for arms, name, density in product((3, 4, 5), (SCHEDULE, *RIVALS), DENSITIES)
    ),
)
