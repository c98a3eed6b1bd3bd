"""Every controller on equal terms, and the demands at which DIM does worse than a rival."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

from minisim.errors import InputError, numbers
from scenarios.controllers import RIVALS, label_of
from scenarios.statistics import mean_interval
from scenarios.studies.shared.archive import MissingRunsError
from scenarios.studies.shared.points import fair_grid
from scenarios.studies.shared.study import TOTAL_DELAY, Results, Study, with_total_delay
from scenarios.sweep.cells import pairs

if TYPE_CHECKING:
    import pandas as pd

#: DIM with each of its gates, and the other controllers.
GATES = ("dim", "dim:gate=harmonious", "dim:gate=passed")
OTHERS = tuple(name for name in RIVALS if name not in GATES)

#: From nearly free flow to far beyond the capacity of every controller [veh/h/lane].
DENSITIES = (50, 100, 150, 200, 250, 300, 350, 400, 500, 600, 700, 800)

#: What "worse" may mean: measure -> column of `with_total_delay`. These are the complete forms,
#: which include vehicles still on the road; other forms flatter a controller that serves few.
MEASURES = {
    "waiting time": "complete_waiting_time_s",
    "time loss": "complete_time_loss_s",
    "time loss and departure delay": TOTAL_DELAY,
}


class Crossing(NamedTuple):
    """The demand [veh/h/lane] above which one controller does worse than another.

    Above the capacities of both controllers, neither wins.
    """

    density: float  # the lowest with a mean difference > 0: −inf below those tried, +inf if none
    low: float  # low … high: its interval; ±inf if the demands tried do not bound it
    high: float
    until: float  # where the mean difference falls back to 0 or less; +inf if it does not
    tried: tuple[float, float]  # lowest and highest demand tried with both

    def __str__(self) -> str:
        bounded = math.isfinite(self.low) or math.isfinite(self.high)
        return f"{self.point} ({self.interval})" if bounded else self.point

    @property
    def point(self) -> str:
        """The demand in words."""
        if self.density == -math.inf:
            return "all" if self.until == math.inf else f"up to {self.until:.0f}"
        if self.density == math.inf:
            return "never"
        return f"{self.density:.0f}" + ("" if self.until == math.inf else f" to {self.until:.0f}")

    @property
    def interval(self) -> str:
        """The interval in words; if it is open, the demand at which it begins or ends."""
        low, high = (f"{end:.0f}" if math.isfinite(end) else "" for end in (self.low, self.high))
        if low and high:
            return f"{low} to {high}"
        return f"{low} at the earliest" if low else f"{high} at the latest" if high else "–"


def crossing(differences: Mapping[float, Sequence[float]]) -> Crossing:
    """Where paired differences, ours minus theirs, turn positive.

    The mean difference is taken as linear between the demands tried, and so are the bounds of its
    pointwise 95 % Student-t intervals. The interval of the crossing holds the demands at which
    those intervals hold 0 (a confidence set by inversion of the test, Fieller 1954). `differences`
    maps two or more demands [veh/h/lane] to one difference per seed, at least two.
    """
    densities = sorted(numbers("demands", list(differences)))
    bands = [mean_interval(differences[density]) for density in densities]
    few = [density for density, band in zip(densities, bands, strict=True) if band.size < 2]
    if few or len(densities) < 2:
        where = f"{few[0]:g} veh/h/lane" if few else "two demands or more"
        raise InputError(f"a crossing needs two differences or more at {where}")
    start, until = _first_rise(densities, [band.mean for band in bands])
    low, _ = _first_rise(densities, [band.mean + band.half_width for band in bands])
    high, _ = _first_rise(densities, [band.mean - band.half_width for band in bands])
    return Crossing(start, low, high, until, (densities[0], densities[-1]))


def tried(crossings: Iterable[Crossing]) -> tuple[float, float]:
    """The lowest and the highest demand tried for any of the crossings."""
    lows, highs = zip(*(crossing.tried for crossing in crossings), strict=True)
    return min(lows), max(highs)


def paired_differences(
    rows: pd.DataFrame, ours: str, theirs: str, metric: str
) -> dict[float, list[float]]:
    """Ours minus theirs in a column, for two series: density -> one difference per common seed.

    `InputError` if two runs with the same seed had different arrivals.
    """
    by_density = pairs(rows, metric, "series", (ours, theirs), ["density"])
    return {float(density): values for (density,), values in by_density.items() if len(values) > 1}


def losses(rows: pd.DataFrame) -> dict[tuple[str, str, str], Crossing]:
    """The demand above which DIM does worse: (measure, gate, rival) -> crossing.

    Pairs without two demands in common are left out.
    """
    rows = with_total_delay(rows)
    known = {}
    for (measure, column), gate, rival in product(MEASURES.items(), GATES, OTHERS):
        differences = paired_differences(rows, gate, rival, column)
        if len(differences) > 1:
            known[measure, gate, rival] = crossing(differences)
    return known


@lru_cache(maxsize=2)
def needed_losses(results: Results) -> dict[tuple[str, str, str], Crossing]:
    """The `losses`; raises `MissingRunsError` if no pair has two demands in common."""
    known = {} if results.good.empty else losses(results.good)
    if not known:
        raise MissingRunsError(
            "the store has no two demands at which DIM and another controller ran with two common "
            f"seeds; make them with: {results.effort.command('fair')}"
        )
    return known


def verdict(results: Results) -> str:
    """The demands at which DIM does worse, which the paper leaves open."""
    try:
        known = needed_losses(results)
    except MissingRunsError as error:
        return f"The demand from which DIM loses is not known: {error}."
    low, high = tried(known.values())
    lines = []
    for rival in OTHERS:
        losing = []
        for measure in MEASURES:
            found = (str(known.get((measure, gate, rival), "not run")) for gate in GATES)
            losing.append(f"{measure} {' → '.join(found)}")
        lines.append(f"- {label_of(rival)}: {'; '.join(losing)}")
    return "\n".join([
        "Demands at which DIM does worse than each rival on four arms, paper's gate → harmonious "
        "gate → gate passed [veh/h/lane]: where that begins, with its 95 % interval; it lasts to "
        f"the highest tried ({high:g}) unless an end is given. \"all\": from the lowest tried "
        f"({low:g}) on, on average:\n",
        *lines,
    ])  # fmt: skip


def _first_rise(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Where the polygon (x, y) first leaves y ≤ 0, and where it then comes back."""
    above = [value > 0.0 for value in y]
    if True not in above:
        return math.inf, math.inf
    rise = above.index(True)
    start = _zero(x, y, rise) if rise else -math.inf
    end = _zero(x, y, above.index(False, rise)) if False in above[rise:] else math.inf
    return start, end


def _zero(x: Sequence[float], y: Sequence[float], k: int) -> float:
    """Where the side of the polygon that ends at point k crosses 0."""
    share = y[k - 1] / (y[k - 1] - y[k])
    return x[k - 1] + share * (x[k] - x[k - 1])


STUDY = Study(
    "fair",
    "Which controller is best when all have the same vehicles and speed limit?",
    fair_grid(RIVALS, (4,), DENSITIES),
    verdict=verdict,
)
