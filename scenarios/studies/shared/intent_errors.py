"""Points at which vehicles misread each other's intent, and the rates of rare events there."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from dim import NoisyPerception
from dim.senses.noise import UNSIGNALLED
from minisim.names import spelled
from scenarios.controllers import controller_named
from scenarios.library import MAKERS
from scenarios.recipe import Recipe
from scenarios.statistics import poisson_interval

if TYPE_CHECKING:
    import pandas as pd

#: Rates count events per this many crossings.
CROSSINGS = 10_000
#: Demand of these studies [veh/h/lane]: so low that any loss is due to perception.
DENSITY = 250.0
#: (whether all vehicles err alike, whether errors last) -> words.
MANNERS = {
    (True, True): "all alike, lasting",
    (True, False): "all alike, new each frame",
    (False, True): "each its own, lasting",
    (False, False): "each its own, new each frame",
}
#: The rules alone, with a safety monitor, and with the highest-priority lane first.
MISREADERS = ("dim", "dim:monitor=on", "dim:order=lanes")
#: The most seeds: vehicles that misread look around every 0.1 s, which costs 3 s of CPU per hour.
FEW = dict.fromkeys(MISREADERS, 5)


class IntentErrorPoint(NamedTuple):
    """DIM with vehicles that misread each other in one way."""

    series: str  # the controller by its command-line name
    kind: str = "missed"  # this and the next three: see `NoisyPerception`
    rate: float = 0.0
    shared: bool = True
    persistent: bool = True
    unsignalled: bool = False  # whether vehicles turn without a signal, at the published rates
    confidence: float = 0.0  # lowest that is believed; 0 believes every reading
    arms: int = 4  # of the junction
    density: float = DENSITY  # mean inflow per lane [veh/h]

    @property
    def perception(self) -> NoisyPerception:
        """How vehicles see."""
        return NoisyPerception(
            self.rate, self.kind, shared=self.shared, persistent=self.persistent,
            unsignalled=UNSIGNALLED if self.unsignalled else (0.0, 0.0),
            confidence=self.confidence or None,
        )  # fmt: skip

    @property
    def where(self) -> str:
        """What sets it apart from other points of its series, besides demand."""
        return f"{self.arms} arms, {spelled('noisy', self.perception)}"

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed; collisions and wrong decisions are counted."""
        scenario = MAKERS[self.arms](self.density, profile="fair", horizon=horizon)
        controller = controller_named(self.series, "fair")
        if self.perception.period is not None:
            controller = replace(controller, perception=self.perception)  # type: ignore[type-var]
        return Recipe(scenario, controller, seed, on_collision="record")


class Rate(NamedTuple):
    """Events in `CROSSINGS` crossings, with the 95 % confidence interval (`poisson_interval`)."""

    value: float
    low: float
    high: float
    crossings: int


def rate_of(rows: pd.DataFrame, events: str) -> Rate | None:
    """The rate of a column's events over all runs of a point; None without a crossing.

    Runs with exact perception have no tally: their crossings are the trips that ended.
    """
    ended = rows["trips"] - rows["unfinished"]
    crossings = int(rows.get("crossings", ended).fillna(ended).sum())
    if not crossings:
        return None
    count = int(rows[events].fillna(0).sum()) if events in rows else 0
    low, high = poisson_interval(count)
    scale = CROSSINGS / crossings
    return Rate(count * scale, low * scale, high * scale, crossings)
