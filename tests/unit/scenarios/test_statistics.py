"""Intervals against tables, and growing queues against queues whose growth is known."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from minisim.errors import InputError
from minisim.results.trips import queue_growth
from scenarios.statistics import (
    Interval,
    growing,
    mean_interval,
    poisson_interval,
    prediction_interval,
)

Floats = npt.NDArray[np.float64]


def test_half_widths_of_student_s_table() -> None:
    # Two-sided 95 %, e.g. Abramowitz & Stegun, table 26.10.
    for freedom, quantile in {1: 12.706, 2: 4.303, 4: 2.776, 9: 2.262, 30: 2.042}.items():
        _, half_width, size = mean_interval([*[0.0] * freedom, math.sqrt(freedom + 1.0)])
        # n values, all 0 but one √n, have variance 1.
        assert half_width * math.sqrt(size) == pytest.approx(quantile, abs=5e-4)


def test_intervals_by_hand() -> None:
    # Mean 3, s² = 10/4, t(0.975, 4) = 2.7764; the half widths are t·√(2.5/5) and t·√(2.5·1.2).
    interval = mean_interval([1, 2, 3, 4, 5])
    assert interval == (3.0, pytest.approx(2.7764 * math.sqrt(0.5), abs=1e-4), 5)
    assert str(interval) == "3.0 ± 2.0"
    wider = prediction_interval([1, 2, 3, 4, 5])
    assert wider == (3.0, pytest.approx(2.7764 * math.sqrt(2.5 * 1.2), abs=1e-4), 5)


@pytest.mark.parametrize("interval_of", [mean_interval, prediction_interval])
def test_intervals_need_values(interval_of: Callable[[Any], Interval]) -> None:
    single = interval_of([2.0])
    assert (single.mean, single.size, str(single)) == (2.0, 1, "2.0")
    assert math.isnan(single.half_width)
    for values in ([], [1.0, math.nan]):
        with pytest.raises(InputError):
            interval_of(values)


def test_prediction_interval_holds_the_next_value_as_often_as_it_says() -> None:
    inside = 0
    for *known, new in np.random.default_rng(7).normal(10, 3, size=(2000, 6)).tolist():
        mean, half_width, _ = prediction_interval(known)
        inside += abs(new - mean) <= half_width
    # Binomial(2000, 0.95): sd 9.7; four of them are a false alarm of 6e-5.
    assert inside == pytest.approx(1900, abs=39)


@pytest.mark.parametrize("count", [0, 1, 7, 100])
def test_poisson_interval_by_its_definition(count: int) -> None:
    """At the upper limit so few events have probability 2.5 %, at the lower so many."""
    low, high = poisson_interval(count)
    assert stats.poisson.cdf(count, high) == pytest.approx(0.025)
    assert stats.poisson.sf(count - 1, low) == pytest.approx(0.025 if count else 1.0)
    with pytest.raises(InputError, match="count must be an integer of at least 0"):
        poisson_interval(-1)


def test_queue_growth_by_hand() -> None:
    # Quarters of 10 s. Second, [10, 20): the first trip is there for 5 s. Last, [30, 40): the
    # second for 10 s, the third for 4 s, the fourth not yet.
    demand = np.array([0.0, 25.0, 36.0, 40.0])
    leave = np.array([15.0, math.inf, math.inf, math.inf])
    assert queue_growth(demand, leave, 40.0) == pytest.approx(1.4 - 0.5)


def md1(rng: np.random.Generator, load: float, horizon: float = 3600.0) -> tuple[Floats, Floats]:
    """An hour of an M/D/1 queue with 350 arrivals on average: demand and leaving times."""
    demand = np.sort(rng.uniform(0.0, horizon, rng.poisson(350)))
    service = load * horizon / 350
    leave = np.empty_like(demand)
    last = 0.0
    for k, time in enumerate(demand.tolist()):
        last = max(time, last) + service
        leave[k] = last
    return demand, np.where(leave <= horizon, leave, math.inf)


def flagged(load: float, runs: int = 200) -> int:
    rng = np.random.default_rng(11)
    hours = [md1(rng, load) for _ in range(runs)]
    return sum(growing(queue_growth(*hour, 3600.0), len(hour[0])) for hour in hours)


def test_an_md1_queue_grows_above_its_capacity_only() -> None:
    assert flagged(0.9) == 0
    assert flagged(0.95) <= 2, "0.2 % each: 3 of 200 have a chance of 1 %"
    assert flagged(1.3) > 150, "88 % each"


def test_a_free_walk_varies_as_stated() -> None:
    # Arrivals and independent departures of a rate λ each: a walk of variance 2λ a second.
    rng = np.random.default_rng(3)
    rate, end = 0.2, 3600.0

    def counted() -> float:
        """Growth of the number of events so far: vehicles that never leave."""
        times = np.sort(rng.uniform(0, end, rng.poisson(rate * end)))
        return queue_growth(times, np.full(len(times), math.inf), end)

    grown = [counted() - counted() for _ in range(400)]
    # The variance of a variance of 400 normal values: sd √(2/399) = 7 %.
    assert np.var(grown, ddof=1) == pytest.approx(2 * 5 / 12 * rate * end, rel=4 * 0.071)
