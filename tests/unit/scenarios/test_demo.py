"""The tour of `minisim demo`: averages over seeds, and runs that fail."""

from __future__ import annotations

import pandas as pd
import pytest

from minisim.errors import InputError, MinisimError
from scenarios.demo import METRICS, Tour, average, run_tour


def test_average_is_over_seeds() -> None:
    rows = pd.DataFrame({
        "controller": ["dim", "dim", "x", "x"], "density": [150.0] * 4, "seed": [1, 2, 1, 2],
        "trips": [10, 12, 9, 9], "collisions": [0, 1, 0, 0],
        **{metric: [1.0, 3.0, 5.0, 5.0] for metric in METRICS},
    })  # fmt: skip
    points = average(rows)
    assert list(points["controller"]) == ["dim", "x"]
    assert list(points["trips"]) == [22, 18]
    assert list(points["collisions"]) == [1, 0]
    assert list(points["waiting_time_s"]) == [2.0, 5.0]
    # t(0.975, 1) = 12.706, s = √2, n = 2.
    assert points["waiting_time_s_ci95"][0] == pytest.approx(12.706, abs=1e-3)
    assert points["waiting_time_s_ci95"][1] == 0.0


def test_a_tour_that_fails_says_where() -> None:
    tour = Tour(densities=(300.0,), seeds=2, horizon=300.0, controllers=("unregulated",))
    with pytest.raises(MinisimError, match=r"2 of 2 runs failed.*unregulated, 300 .*seed 1"):
        run_tour(tour, 1, lambda done, total: None)


def test_a_tour_needs_a_density() -> None:
    with pytest.raises(InputError, match="at least one density"):
        Tour(densities=())
