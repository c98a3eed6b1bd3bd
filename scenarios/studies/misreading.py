"""What is run to see how wrong perception ends, and the rates of rare events in it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from dim import NoisyPerception
from dim.senses.intent import KINDS, RATES
from dim.senses.noise import CLASSIFIER, UNSIGNALLED
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
#: Who errs alike and for how long, and what that is called: (shared, persistent) -> words.
MANNERS = {
    (True, True): "all alike, lasting",
    (True, False): "all alike, each frame anew",
    (False, True): "each for itself, lasting",
    (False, False): "each for itself, each frame anew",
}
#: Whose vehicles misread: the rules alone, with a safety monitor, and with the highest-priority
#: lane first.
MISREADERS = ("dim", "dim:monitor=on", "dim:order=lanes")
#: Thresholds of confidence; 0 takes every reading as it is.
THRESHOLDS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99)


class Misreading(NamedTuple):
    """One point of a figure: everything of a run but its seed and horizon.

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
        """What tells it from other cases of its series, but for the demand."""
        return f"{self.arms} arms, {spelled('noisy', self.perception)}"

    def experiment(self, seed: int, horizon: float = 3600.0) -> Recipe:
        """The run of one seed; collisions and wrong decisions are counted."""
        make = MAKERS.get(self.arms) or partial(regular, self.arms)
        scenario = make(self.density, profile="fair", horizon=horizon)
        controller = controller_named(self.series, "fair")
        if self.perception.period is not None:
            controller = replace(controller, perception=self.perception)  # type: ignore[type-var]
        return Recipe(scenario, controller, seed, on_collision="record")

    def __str__(self) -> str:
        return f"{self.series}, {self.where}, {self.density:g} veh/h/lane"


#: Over the probability of an error, and who errs how; and turns without a signal.
ERRORS = (
    *(Misreading(series) for series in MISREADERS),
    *(
        Misreading(series, kind, rate, shared, persistent)
        for series in MISREADERS[:2]
        for kind, (shared, persistent), rate in product(KINDS, MANNERS, RATES[1:])
    ),
    *(
        Misreading("dim:order=lanes", kind, CLASSIFIER, shared, persistent)
        for kind, (shared, persistent) in product(KINDS, MANNERS)
    ),
    *(Misreading(series, unsignalled=True) for series in MISREADERS),
)

#: Over the threshold of confidence. Lanes first: with the largest clique first, unknown intents
#: block the junction.
THRESHOLD_CASES = tuple(
    Misreading("dim:order=lanes", kind, CLASSIFIER, confidence=threshold)
    for kind, threshold in product(KINDS, THRESHOLDS)
)


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
    """The rate of a column's events over all runs of a case; None without a crossing.

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
