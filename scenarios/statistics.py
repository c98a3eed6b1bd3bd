"""Means over seeds with their intervals, growing queues, and how far distributions differ."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, integer, numbers

#: The level of all intervals.
CONFIDENCE = 0.95

#: A queue grows if it gains more standard deviations than this; by chance, 1 % of normal ones do.
GROWTH_SCORE = 2.326

#: The shortest horizon that can show growth, in travel times on a free road. In a shorter one, the
#: roads are still filling in the second quarter, so the last one has more vehicles in any case.
FILLING = 4.0


class Interval(NamedTuple):
    """The interval mean ± half_width for `size` values; the half width is NaN for a single one."""

    mean: float
    half_width: float
    size: int

    def __str__(self) -> str:
        half_width = "" if math.isnan(self.half_width) else f" ± {self.half_width:.1f}"
        return f"{self.mean:.1f}{half_width}"


def mean_interval(values: Iterable[float]) -> Interval:
    """Mean and 95 % confidence interval of independent values, t·s/√n (Student 1908).

    `InputError` for no values, or for one that is not finite.
    """
    mean, half_width, count = prediction_interval(values)
    return Interval(mean, half_width / math.sqrt(count + 1.0), count)


def prediction_interval(values: Iterable[float]) -> Interval:
    """Interval for one more independent value, t·s·√(1 + 1/n) about the mean of n values.

    It contains the next normally distributed value with probability 0.95 (Hahn & Meeker 1991,
    Statistical Intervals, §4.7), such as a single published run. Raises as `mean_interval`.
    """
    from scipy.special import stdtrit  # takes a tenth of a second to import

    data = numbers("values", values)
    if not (count := len(data)):
        raise InputError("a mean needs at least one value")
    mean = math.fsum(data) / count
    if count == 1:
        return Interval(mean, math.nan, 1)
    variance = math.fsum((value - mean) ** 2 for value in data) / (count - 1)
    t = float(stdtrit(count - 1, (1.0 + CONFIDENCE) / 2.0))
    return Interval(mean, t * math.sqrt(variance * (1.0 + 1.0 / count)), count)


def poisson_interval(count: int) -> tuple[float, float]:
    """Exact 95 % confidence interval for the mean of a Poisson variable, from a single value.

    At the upper end, `count` or fewer events have probability 2.5 %; at the lower end, `count` or
    more do (Garwood 1936). After 0 events the upper end is 3.7. `InputError` for a negative count.
    """
    from scipy.special import gammainccinv, gammaincinv

    integer("count", count, low=0)
    tail = (1.0 - CONFIDENCE) / 2.0
    low = float(gammaincinv(count, tail)) if count else 0.0
    return low, float(gammainccinv(count + 1, tail))


def growing(growth: float, trips: int) -> bool:
    """Whether queues kept growing; a mean delay then depends on the horizon.

    With Poisson arrivals at rate λ and service that just keeps up, the number of vehicles is a
    random walk of variance λ per second. The means of two windows of length T/4 that begin T/2
    apart differ with variance λ(T/2 − T/12) = 5/12 λT: the integral of the walk's covariance
    min(s, t) over both windows. λT is the expected number of trips. A queue with capacity to spare
    differs less. Of 2000 hours of an M/D/1 queue with 350 arrivals, 0.2 % are classed as growing at
    a load of 0.95, 1 % at 1, 16 % at 1.1 and 88 % at 1.3; of cells of ten such hours, none at 0.95,
    6 % at 1 and 98 % at 1.1. A horizon below `FILLING` shows nothing.
    """
    return growth > GROWTH_SCORE * math.sqrt(5.0 / 12.0 * trips)


def ks_distance(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Largest distance between two empirical distribution functions, sup |F₁(x) − F₂(x)|.

    The statistic of Kolmogorov and Smirnov (Smirnov 1939): 0 for equal samples, 1 for samples that
    do not overlap; scipy's takes a second to import. `InputError` for an empty or infinite sample.
    """
    samples = [np.sort(np.asarray(numbers("sample", s))) for s in (first, second)]
    if not all(map(len, samples)):
        raise InputError("a distance of distributions needs at least one value in each sample")
    steps = np.concatenate(samples)
    one, other = (np.searchsorted(s, steps, side="right") / len(s) for s in samples)
    return float(np.abs(one - other).max())
