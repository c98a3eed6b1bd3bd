"""Means over seeds and how sure they are; distances between distributions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, integer, number, numbers


class Interval(NamedTuple):
    """A mean and the half width of its confidence interval.

    Attributes:
        mean: of the values.
        half_width: the interval is mean ± half_width; NaN for a single value.
        size: number of values.
    """

    mean: float
    half_width: float
    size: int

    def __str__(self) -> str:
        return f"{self.mean:.1f}" if math.isnan(self.half_width) else (
            f"{self.mean:.1f} ± {self.half_width:.1f}"
        )  # fmt: skip


def mean_interval(values: Iterable[float], confidence: float = 0.95) -> Interval:
    """Mean and Student-t confidence interval of independent values, t·s/√n (Student 1908).

    Raises:
        InputError: no value, one that is not finite, or a confidence outside (0, 1).
    """
    data = numbers("values", values)
    number("confidence", confidence, above=0, below=1)
    count = len(data)
    if not count:
        raise InputError("a mean needs at least one value")
    mean = math.fsum(data) / count
    if count == 1:
        return Interval(mean, math.nan, 1)
    variance = math.fsum((value - mean) ** 2 for value in data) / (count - 1)
    t = student_quantile((1.0 + confidence) / 2.0, count - 1)
    return Interval(mean, t * math.sqrt(variance / count), count)


def student_quantile(probability: float, freedom: int) -> float:
    """The `probability` quantile (0.5 … 1) of Student's t with `freedom` degrees of freedom.

    Bisection in the angle θ = arctan(t/√freedom), in which the distribution is a finite sum
    (Abramowitz & Stegun 1964, 26.7.3 and 26.7.4).
    """
    number("probability", probability, low=0.5, below=1)
    integer("degrees of freedom", freedom, low=1)
    low, high = 0.0, math.pi / 2.0
    for _ in range(80):
        middle = (low + high) / 2.0
        if _between(middle, freedom) < 2.0 * probability - 1.0:
            low = middle
        else:
            high = middle
    return math.sqrt(freedom) * math.tan((low + high) / 2.0)


def _between(angle: float, freedom: int) -> float:
    """P(|T| ≤ √freedom · tan angle)."""
    sine, cosine = math.sin(angle), math.cos(angle)
    odd = freedom % 2
    term = total = (cosine if odd else 1.0) if freedom > 1 else 0.0
    for k in range(2 + odd, freedom - 1, 2):
        term *= cosine * cosine * (k - 1) / k
        total += term
    return 2.0 / math.pi * (angle + sine * total) if odd else sine * total


def ks_distance(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Largest distance between two empirical distribution functions, sup |F₁(x) − F₂(x)|.

    The two-sample statistic of Kolmogorov and Smirnov (Smirnov 1939): 0 for equal samples, 1 for
    samples that do not overlap.

    Raises:
        InputError: a sample is empty or holds something that is not finite.
    """
    samples = [np.sort(np.asarray(numbers("sample", s))) for s in (first, second)]
    if not all(map(len, samples)):
        raise InputError("a distance of distributions needs at least one value in each sample")
    steps = np.concatenate(samples)
    one, other = (np.searchsorted(s, steps, side="right") / len(s) for s in samples)
    return float(np.abs(one - other).max())
