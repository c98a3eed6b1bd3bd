"""From which demand on one controller does worse than another."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from minisim.errors import InputError, items, numbers
from scenarios.statistics import Interval, mean_interval
from scenarios.sweep.cells import pairs

if TYPE_CHECKING:
    import pandas as pd


class Crossing(NamedTuple):
    """The demand from which on one does worse.

    Attributes:
        density: the lowest at which the mean difference turns positive [veh/h/lane]; −inf where
            it is positive at the lowest demand tried, +inf where it never is.
        low, high: interval of it, open (±inf) where the demands tried do not bound it.
        until: where the mean difference falls back to 0 or less, +inf where it does not: beyond
            the capacity of both, neither wins.
        tried: lowest and highest demand of both; nothing is known beyond.
    """

    density: float
    low: float
    high: float
    until: float
    tried: tuple[float, float]

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
        end = "" if self.until == math.inf else f" to {self.until:.0f}"
        return f"{self.density:.0f}{end}"

    @property
    def interval(self) -> str:
        """The interval in words; where it is open, at which demand it begins or ends."""
        low, high = (
            f"{value:.0f}" if math.isfinite(value) else "" for value in (self.low, self.high)
        )
        if low and high:
            return f"{low} to {high}"
        return f"{low} at the earliest" if low else f"{high} at the latest" if high else "–"


def crossing(differences: Mapping[float, Sequence[float]], confidence: float = 0.95) -> Crossing:
    """Where paired differences, ours minus theirs, turn positive.

    The mean difference is taken as linear between the demands tried. The interval holds the
    demands at which the pointwise Student-t interval of the difference, linear in between too,
    holds 0: it runs from the crossing of its upper to that of its lower bound (a confidence set
    by inversion of the test, Fieller 1954).

    Args:
        differences: demand [veh/h/lane] -> one difference a seed, at least two.
        confidence: of the interval.

    Raises:
        InputError: fewer than two demands, or a demand with fewer than two differences.
    """
    densities = sorted(numbers("demands", list(differences)))
    if len(densities) < 2:
        raise InputError("a crossing needs differences at two demands or more")
    bands: list[Interval] = []
    for density in densities:
        values = items(f"differences at {density:g}", differences[density], "numbers")
        if len(values) < 2:
            raise InputError(f"a crossing needs two differences or more at {density:g} veh/h/lane")
        bands.append(mean_interval(values, confidence))
    mean = [band.mean for band in bands]
    start, until = _first_rise(densities, mean)
    return Crossing(
        start,
        _first_rise(densities, [band.mean + band.half_width for band in bands])[0],
        _first_rise(densities, [band.mean - band.half_width for band in bands])[0],
        until,
        (densities[0], densities[-1]),
    )


def tried(crossings: Iterable[Crossing]) -> tuple[float, float]:
    """Lowest and highest demand of any; raises `InputError` where there is none."""
    ends = [crossing.tried for crossing in crossings]
    if not ends:
        raise InputError("no crossing is known")
    return min(low for low, _ in ends), max(high for _, high in ends)


def paired_differences(
    rows: pd.DataFrame, ours: str, theirs: str, metric: str
) -> dict[float, list[float]]:
    """Differences of `metric`, ours minus theirs, at each density, one a common seed.

    Args:
        rows: of a study, with the metric.
        ours, theirs: series.
        metric: a column.

    Raises:
        InputError: two runs of one seed with other arrivals.
    """
    by_density = pairs(rows, metric, "series", (ours, theirs), ["density"])
    return {float(density): values for (density,), values in by_density.items() if len(values) > 1}


def _first_rise(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Where the polygon (x, y) first leaves y ≤ 0, and where it then comes back."""
    above = [value > 0.0 for value in y]
    if True not in above:
        return math.inf, math.inf
    rise = above.index(True)
    fall = above.index(False, rise) if False in above[rise:] else None
    return (
        -math.inf if rise == 0 else _zero(x, y, rise),
        math.inf if fall is None else _zero(x, y, fall),
    )


def _zero(x: Sequence[float], y: Sequence[float], k: int) -> float:
    """Where the line from point k − 1 to point k is 0."""
    share = y[k - 1] / (y[k - 1] - y[k])
    return x[k - 1] + share * (x[k] - x[k - 1])
