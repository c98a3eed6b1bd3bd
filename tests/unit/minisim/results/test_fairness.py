"""How evenly waiting is spread over the lanes, and which vehicles go before others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from baselines import FixedTime, Reservation
from dim import Dim
from minisim.errors import InputError
from minisim.results.fairness import gini, lane_gini, order_reversals, worst_lane
from minisim.results.run import Run
from scenarios import four_way
from tests.builders import driven, replayed


def test_gini_closed_forms() -> None:
    assert gini([3.0] * 5) == pytest.approx(0.0)
    assert gini([0.0, 0.0, 0.0, 8.0]) == pytest.approx(1 - 1 / 4)
    # 1 … n: (n + 1)/(3n) − … = (n² − 1)/(3n(n + 1)) = (n − 1)/(3n).
    assert gini(range(1, 11)) == pytest.approx(9 / 30)
    assert gini([0.0, 0.0]) == 0.0


@given(st.lists(st.floats(0.0, 1e4), min_size=1, max_size=8), st.floats(0.1, 100.0))
def test_gini_ignores_scale_order_and_repetition(values: list[float], scale: float) -> None:
    plain = gini(values)
    assert 0.0 <= plain <= 1.0 - 1.0 / len(values) + 1e-9
    assert gini([scale * v for v in reversed(values)]) == pytest.approx(plain, abs=1e-9)
    assert gini(values * 2) == pytest.approx(gini(values, [2.0] * len(values)), abs=1e-9)


@pytest.mark.parametrize("wrong", [([], None), ([-1.0], None), ([1.0], [0.0]), ([1.0], [1.0, 2.0])])
def test_gini_refuses(wrong: Any) -> None:
    with pytest.raises(InputError):
        gini(*wrong)


@pytest.fixture(scope="module")
def run() -> Run:
    """Vehicles 0 of way a2, 1 of b2 and 2 of c2; a2 and c2 do not conflict, b2 crosses both."""
    trips = (0.0, 0, 2), (5.0, 1, 2), (6.0, 2, 2)
    scenario = replayed(four_way(0, profile="fair"), *trips, horizon=60.0)
    return minisim.simulate(scenario, Dim(), record="all")


@pytest.mark.parametrize(
    ("entries", "reversals"),
    [
        ((30.0, 35.0, 36.0), (0, 0, 0)),
        ((40.0, 35.0, 36.0), (1, 0, 0)),  # b2 came later and went first; c2 was in no one's way
        ((40.0, 45.0, 36.0), (0, 1, 0)),
        ((None, 35.0, 34.0), (1, 1, 0)),  # one that has not gone yet has been passed, too
    ],
)
def test_those_that_came_later_and_went_first_are_counted(
    run: Run, entries: tuple[float | None, ...], reversals: tuple[int, ...]
) -> None:
    entry = run.site.intersection.approach_length
    lines = [
        (
            vehicle,
            round((time or 99.0) / run.site.dt) + k,
            entry - 0.5 + k * (time is not None),
            10.0,
            0.0,
        )
        for vehicle, time in enumerate(entries)
        for k in (0, 1)
    ]
    assert order_reversals(driven(run, *lines)).tolist() == list(reversals)


def test_who_comes_first_depends_on_the_limit_of_the_road(run: Run) -> None:
    """With half the limit on its arm, the first to be demanded is the last to be there."""
    entry = run.site.intersection.approach_length
    lines = [(0, 400, entry + 0.1, 10.0, 0.0), (1, 350, entry + 0.1, 10.0, 0.0)]
    slow = replace(run.site, limits=(7.0, 14.0, 14.0, 14.0), speed_limit=14.0)
    assert order_reversals(driven(run, *lines))[0] == 1.0
    assert order_reversals(driven(replace(run, site=slow), *lines))[0] == 0.0


def test_the_fifo_of_a_reservation_reverses_less_than_a_signal() -> None:
    """First come, first served has few reversals; a signal has many."""
    scenario = four_way(250, profile="fair", horizon=120.0)
    few, many = (
        minisim.simulate(scenario, controller, 1, record="junction").summary(["order_reversals"])
        for controller in (Reservation(), FixedTime())
    )
    assert few["order_reversals"] < 0.5 * many["order_reversals"]


def test_all_of_the_time_is_needed() -> None:
    scenario = four_way(200, profile="fair", horizon=40.0)
    with pytest.raises(InputError, match="no trajectories: simulate with record='junction'"):
        order_reversals(minisim.simulate(scenario, Dim()))
    part = minisim.simulate(scenario, Dim(), record="all", record_window=(5.0, 20.0))
    with pytest.raises(InputError, match="not all of the time was recorded"):
        order_reversals(part)


def test_lanes_of_a_run(run: Run) -> None:
    columns = run.columns._replace(waiting_time=np.array([1.0, 2.0, 6.0]))
    assert worst_lane(columns) == 6.0
    assert lane_gini(columns) == pytest.approx(gini([1.0, 2.0, 6.0]))
    nothing = columns.taken(slice(0, 0))
    assert (worst_lane(nothing), lane_gini(nothing)) == (None, None)
    unentered = columns._replace(departed=np.array([True, True, False]))
    assert worst_lane(unentered) == 2.0, "waiting before the road is departure delay"
