"""Points at which vehicles misread each other's intent, and the rates of rare events in them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from dim import NoisyPerception
from dim.senses.noise import UNSIGNALLED
from minisim.parameters import spelled
from scenarios.controllers import controller_named
from scenarios.library import MAKERS, regular
from scenarios.recipe import Recipe
from scenarios.statistics import poisson_interval

if TYPE_CHECKING:
    import pandas as pd

#: Rates are given for so many crossings.
CROSSINGS = 10_000
#: The demand of these studies [veh/h/lane]: well below saturation, so that what is lost is lost to
#: perception.
DENSITY = 250.0
#: Whether all err alike, and whether errors last: (shared, persistent) -> words.
MANNERS = {
    (True, True): "all alike, lasting",
    (True, False): "all alike, each frame anew",
    (False, True): "each for itself, lasting",
    (False, False): "each for itself, each frame anew",
}
#: The controllers whose vehicles misread: the rules alone, with a safety monitor, and with the
#: highest-priority lane first.
MISREADERS = ("dim", "dim:monitor=on", "dim:order=lanes")
#: Vehicles that misread each other look around every 0.1 s, which costs 3 s of CPU an hour, and
#: more with a monitor.
FEW = dict.fromkeys(MISREADERS, 5)


class IntentErrorPoint(NamedTuple):
    """DIM with vehicles that misread each other in one way.

    Attributes:
        series: the controller by its command-line name.
        kind, rate, shared, persistent: of the intent errors, see `NoisyPerception`.
        unsignalled: whether turns go without a signal at the published rates.
        confidence: below which an intent is unknown; 0 is never.
        arms: of the junction.
        density: mean inflow a lane [veh/h].
    """

    series: str
    kind: str = "missed"
    rate: float = 0.0
    shared: bool = True
    persistent: bool = True
    unsignalled: bool = False
    confidence: float = 0.0
    arms: int = 4
    density: float = DENSITY

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
        """What tells it from other points of its series, but for the demand."""
        return f"{self.arms} arms, {spelled('noisy', self.perception)}"

    def recipe(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed; collisions and wrong decisions are counted."""
        make = MAKERS.get(self.arms) or partial(regular, self.arms)
        scenario = make(self.density, profile="fair", horizon=horizon)
        controller = controller_named(self.series, "fair")
        if self.perception.period is not None:
            controller = replace(controller, perception=self.perception)  # type: ignore[type-var]
        return Recipe(scenario, controller, seed, on_collision="record")


class Rate(NamedTuple):
    """How often something happened in `CROSSINGS` crossings.

    Attributes:
        rate: events a `CROSSINGS` crossings.
        low, high: its 95 % confidence interval (`scenarios.statistics.poisson_interval`).
        events, crossings: it is made of.
    """

    rate: float
    low: float
    high: float
    events: int
    crossings: int


def rate_of(rows: pd.DataFrame, events: str) -> Rate | None:
    """The rate of a column's events over all runs of a point; None without a crossing.

    Runs with exact perception have no tally: their crossings are the trips that ended, and their
    decisions are right.
    """
    trips = rows["trips"] - rows["unfinished"]
    crossings = (
        int(rows["crossings"].fillna(trips).sum()) if "crossings" in rows else int(trips.sum())
    )
    if not crossings:
        return None
    count = int(rows[events].fillna(0).sum()) if events in rows else 0
    low, high = poisson_interval(count)
    scale = CROSSINGS / crossings
    return Rate(count * scale, low * scale, high * scale, count, crossings)
