"""The arrival table."""

from __future__ import annotations

import numpy as np
import pytest

from minisim.arrivals import Arrivals
from minisim.errors import InputError


def test_inflow_counts_vehicles_before_the_horizon() -> None:
    """Three vehicles in the first minute are 180 an hour, however many come later."""
    time, lane = np.array([0.0, 20.0, 59.9, 60.0, 61.0]), np.array([0, 0, 1, 1, 0])
    arrivals = Arrivals(time, lane, np.ones(5, int))
    assert arrivals.rates(3, 60.0) == pytest.approx((120.0, 60.0, 0.0))
    assert arrivals.rates(3, 3600.0) == pytest.approx((3.0, 2.0, 0.0))


def test_the_table_is_sorted_by_time_then_lane_and_read_only() -> None:
    table = Arrivals(
        time=np.array([2.0, 1.0, 2.0]), lane=np.array([1, 2, 0]), manoeuvre=np.array([1, 2, 3])
    )
    assert table.time.tolist() == [1.0, 2.0, 2.0]
    assert table.lane.tolist() == [2, 0, 1]
    assert table.manoeuvre.tolist() == [2, 3, 1]
    with pytest.raises(ValueError, match="read-only"):
        table.time[0] = 0.0


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (([1.0], [0, 1], [1]), "as many times as lanes"),
        (([-1.0], [0], [1]), "finite and not negative"),
        (([np.nan], [0], [1]), "finite and not negative"),
        (([np.inf], [0], [1]), "finite and not negative"),
        (([1e300], [0], [1]), "demand times must be at most 1e\\+07 s"),
        (([1.0], [0.5], [1]), "lane must be a one-dimensional column of int64"),
        (([1.0], [np.nan], [1]), "lane must be"),
        (([1.0], ["a"], [1]), "lane must be"),
        (([[1.0]], [0], [1]), "demand_time_s must be a one-dimensional"),
        (([1j], [0], [1]), "demand_time_s must be"),
        ((None, [0], [1]), "demand_time_s must be"),
    ],
)
def test_broken_columns_are_refused(columns: tuple[object, ...], message: str) -> None:
    time, lane, manoeuvre = columns
    with pytest.raises(InputError, match=message):
        Arrivals(time=time, lane=lane, manoeuvre=manoeuvre)  # type: ignore[arg-type]  # wrong on purpose


def test_check_names_what_the_geometry_does_not_have() -> None:
    def table(lane: int, manoeuvre: int) -> Arrivals:
        return Arrivals(np.array([0.0]), np.array([lane]), np.array([manoeuvre]))

    table(2, 2).check(3)
    for lane, manoeuvre, message in [
        (3, 1, r"lane d is not in the geometry \(lanes a … c\)"),
        (-1, 1, "lane -1"),
        (99, 1, "lane 99"),
        (0, 3, r"manoeuvre 3 does not exist with 3 arms \(1 … 2\)"),
        (0, 0, "manoeuvre 0"),
    ]:
        with pytest.raises(InputError, match=message):
            table(lane, manoeuvre).check(3)


def test_messages_tell_times_by_the_clock_of_the_whole_table() -> None:
    """Also of a part of a part."""
    table = Arrivals(np.array([25_300.0, 25_400.0]), np.array([0, 1]), np.array([1, 2]))
    part = table.between(25_000.0, np.inf).between(200.0, 500.0)
    assert part.time.tolist() == [100.0, 200.0]
    closed = np.ones((3, 2), bool)
    closed[1, 1] = False
    with pytest.raises(InputError, match=r"vehicle of 25400 s \(07:03:20\) takes b2"):
        part.check(3, closed)
