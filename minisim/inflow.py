"""Inflow of the lanes, constant within each period, and arrival times drawn from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, items, number, numbers
from minisim.parameters import Reals, Takes, checked, declared, reals

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

#: More than any lane can carry: a higher density is a mistake.
MAX_DENSITY = 3600.0
#: The longest duration and the latest demand time [s].
MAX_TIME = 1e7
#: The chance of more in one second is below 10⁻¹⁶ at any density.
MOST_IN_A_SECOND = 20
#: Seconds, or headways of each lane, drawn at once.
BLOCK, HEADWAYS = 3600, 64


def _rows(title: str, value: Any) -> tuple[tuple[float, ...], ...]:
    rows = tuple(numbers(title, row) for row in items(title, value, "rows of numbers"))
    for rate in (rate for row in rows for rate in row):
        number(title, rate, low=0, high=MAX_DENSITY)
    return rows


@declared
class Inflow:
    """Mean inflow of each lane in each period of a run; the last period has no end."""

    starts: Reals[tuple[float, ...]] = reals("of the periods: 0, then later ones", "s", low=0)
    rates: Takes[tuple[tuple[float, ...], ...], Iterable[Iterable[float]]] = checked(
        "of each lane, a row per period", _rows, f"rows of numbers 0 … {MAX_DENSITY:g}", "veh/h"
    )

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in pairwise(self.starts))
        if self.starts[:1] != (0.0,) or not rising:
            raise InputError(f"starts [s] must rise from 0, got {self.starts}")
        if len(self.rates) != len(self.starts) or len({len(row) for row in self.rates}) > 1:
            raise InputError("an inflow needs a row of rates per start, and as many rates in each")

    def mean(self, start: float, end: float) -> tuple[float, ...]:
        """Mean inflow of each lane from `start` to `end` [s], in veh/h."""
        edges = np.clip([*self.starts, math.inf], start, end)
        lengths = np.diff(edges)
        if np.count_nonzero(lengths) < 2:  # exactly as given
            return self.rates[self.period(start)]
        return tuple((lengths @ np.array(self.rates) / lengths.sum()).tolist())

    def period(self, time: npt.ArrayLike) -> Any:
        """The index of the period at each `time` [s]."""
        return np.searchsorted(self.starts, time, side="right") - 1

    def spans(self, end: float) -> Iterator[tuple[float, float, Floats]]:
        """Start, end [s] and rates [veh/s], (n,), of each period before `end`."""
        for edges, rates in zip(pairwise((*self.starts, math.inf)), self.rates, strict=True):
            if edges[0] < end:
                yield edges[0], min(edges[1], end), np.array(rates) / 3600.0


def counted(inflow: Inflow, duration: float, rng: np.random.Generator) -> tuple[Floats, Ints]:
    """Times [s] and lanes, shape (k,) each, of Poisson counts for every second, by inversion.

    Periods must start at whole seconds. Each number drawn belongs to a lane and a second.
    """
    times: list[Floats] = []
    lanes: list[Ints] = []
    for begin, end, at_most in _chances(inflow, math.ceil(duration)):
        for start in range(begin, end, BLOCK):
            draws = rng.random((min(BLOCK, end - start), len(at_most)))
            second, lane = np.nonzero(draws >= at_most[:, 0])
            counts = (draws[second, lane, None] >= at_most[lane]).sum(axis=1)
            times.append(np.repeat(start + second, counts).astype(float))
            lanes.append(np.repeat(lane, counts))
    return np.concatenate(times), np.concatenate(lanes)


@lru_cache(maxsize=64)
def _chances(inflow: Inflow, end: int) -> tuple[tuple[int, int, Floats], ...]:
    """Start and end [s] of each period before `end`, and the chances there, see `_at_most`."""
    spans = inflow.spans(end)
    return tuple((int(begin), int(end), _at_most(rates)) for begin, end, rates in spans)


def _at_most(rates: Floats) -> Floats:
    """The chance of at most k vehicles in a second at rates [veh/s], (n, k)."""
    k, mean = np.arange(MOST_IN_A_SECOND), rates[:, None]
    chances = np.exp(-mean) * mean**k / np.cumprod(np.maximum(k, 1))
    at_most: Floats = chances.cumsum(axis=1)
    at_most.setflags(write=False)
    return at_most


def spaced(
    inflow: Inflow, shift: float, duration: float, rng: np.random.Generator
) -> tuple[Floats, Ints]:
    """Times [s] and lanes, shape (k,) each, with exponential headways beyond `shift` [s].

    For `shift` after a vehicle none comes; then the next is equally likely at any moment, at the
    rate that gives the period its mean headway. Each number drawn belongs to a lane and a vehicle.
    """
    spans = list(inflow.spans(duration))
    with np.errstate(divide="ignore", over="ignore"):  # infinite on a lane without arrivals
        means = np.array([1.0 / rates - shift for _, _, rates in spans])
    ends = [*(end for _, end, _ in spans[:-1]), math.inf]
    draws: list[list[float]] = []  # a row for the first vehicle of each lane, then the second, …

    def drawn(lane: int, rank: int) -> float:
        if rank == len(draws):
            draws.extend(rng.standard_exponential((HEADWAYS, means.shape[1])).tolist())
        return draws[rank][lane]

    times = [
        _lane_times(column, ends, shift, duration, partial(drawn, lane))
        for lane, column in enumerate(means.T.tolist())
    ]
    lanes = np.repeat(np.arange(len(times)), list(map(len, times)))
    return np.array([time for lane in times for time in lane], float), lanes


def _lane_times(
    means: list[float], ends: list[float], shift: float, duration: float,
    drawn: Callable[[int], float],
) -> list[float]:  # fmt: skip
    """Times of one lane [s]; `drawn` gives a unit exponential for the vehicle of each rank.

    What is left of a vehicle's number at the end of a period carries over to the next one, with
    the mean wait beyond `shift` there (`means` [s]). Times are summed in blocks, as numpy does.
    """
    times: list[float] = []
    period, origin, elapsed = 0, 0.0, 0.0
    while True:
        closed, left = shift, drawn(len(times))
        while origin + elapsed + (wait := closed + means[period] * left) > ends[period]:
            spent = ends[period] - (origin + elapsed)
            left = max(left - max(spent - closed, 0.0) / means[period], 1e-300)  # no 0 · ∞
            closed = max(closed - spent, 0.0)
            period, origin, elapsed = period + 1, ends[period], 0.0
        elapsed += wait
        if origin + elapsed >= duration:
            return times
        times.append(origin + elapsed)
        if len(times) % HEADWAYS == 0:
            origin, elapsed = times[-1], 0.0
