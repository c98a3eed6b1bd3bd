"""From which demand on one controller does worse than another."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from minisim.errors import InputError
from scenarios.studies.fair import MEASURES, crossing, paired_differences, tried
from scenarios.studies.shared.study import TOTAL_DELAY, with_total_delay


def test_crossing_of_straight_lines() -> None:
    """The mean goes from −10 to 10, and crosses 0 at 150; the intervals are by hand."""
    wide = crossing({100.0: (-12.0, -8.0), 200.0: (8.0, 12.0)})
    # Half width 12.706·s/√2 with s = √8: 25.41 at both ends.
    assert wide.density == pytest.approx(150.0)
    assert (wide.low, wide.high) == (-math.inf, math.inf)
    narrow = crossing({100.0: (-10.1, -9.9), 200.0: (9.9, 10.1)})
    assert narrow.density == pytest.approx(150.0)
    half = 12.7062 * 0.1  # t(0.975, 1)·s/√2, s = 0.1·√2
    assert narrow.low == pytest.approx(100.0 + 100.0 * (10.0 - half) / 20.0, abs=1e-3)
    assert narrow.high == pytest.approx(100.0 + 100.0 * (10.0 + half) / 20.0, abs=1e-3)
    assert narrow.until == math.inf


@given(st.floats(101.0, 799.0), st.floats(0.01, 5.0), st.integers(2, 8))
def test_crossing_finds_the_root_of_a_line(root: float, slope: float, points: int) -> None:
    densities = np.linspace(100.0, 800.0, points)
    differences = {float(d): [slope * (d - root)] * 3 for d in densities}
    assert crossing(differences)[:3] == pytest.approx((root,) * 3, abs=1e-6)


def test_crossing_at_the_ends() -> None:
    always = crossing({100.0: (1.0, 1.1), 200.0: (2.0, 2.1)})
    assert (always.density, always.point) == (-math.inf, "all")
    assert crossing({100.0: (1.0, 1.0), 200.0: (-1.0, -1.0)}).point == "up to 150"
    never = crossing({100.0: (-1.0, -1.1), 200.0: (0.0, 0.0)})
    assert (never.density, str(never)) == (math.inf, "never")
    again = crossing({0.0: (-1.0, -1.0), 100.0: (1.0, 1.0), 200.0: (1.0, 1.0), 400.0: (-1.0, -1.0)})
    assert (again.density, again.until) == (50.0, 300.0)
    assert str(again) == "50 to 300 (50 to 50)"
    assert tried([again, always]) == (0.0, 400.0)


def test_an_open_interval_says_which_end_it_has() -> None:
    """Both means are positive, 1 ± 12.7 and 20 ± 12.7: sure from 100 + 100·11.7/19 on."""
    assert str(crossing({100.0: (0.0, 2.0), 200.0: (19.0, 21.0)})) == "all (162 at the latest)"
    never = crossing({100.0: (-21.0, -19.0), 200.0: (-2.0, 0.0)})
    assert str(never) == "never (138 at the earliest)"


def test_crossing_interval_covers_the_root() -> None:
    """95 % of intervals hold the true crossing: of 400, a share of 0.91 … 0.985 (odds 1 in 10⁴)."""
    rng = np.random.default_rng(5)
    densities = np.arange(100.0, 500.0, 50.0)
    hits = 0
    for _ in range(400):
        draws = {float(d): (d - 260.0) / 50.0 + rng.normal(0.0, 2.0, 10) for d in densities}
        found = crossing({d: values.tolist() for d, values in draws.items()})
        hits += found.low <= 260.0 <= found.high
    assert 0.91 <= hits / 400 <= 0.985


@pytest.mark.parametrize("wrong", [{100.0: (1.0, 2.0)}, {100.0: (1.0,), 200.0: (1.0, 2.0)}])
def test_crossing_refuses(wrong: dict[float, tuple[float, ...]]) -> None:
    with pytest.raises(InputError, match="two d"):
        crossing(wrong)


def test_differences_are_paired_by_seed() -> None:
    rows = pd.DataFrame({
        "series": ["dim"] * 3 + ["x"] * 3, "density": [150.0] * 6, "seed": [1, 2, 3, 3, 2, 4],
        "m": [1.0, 2.0, 3.0, 30.0, 20.0, 40.0], "arrivals": "same", "error": None,
    })  # fmt: skip
    assert paired_differences(rows, "dim", "x", "m") == {150.0: [-18.0, -27.0]}
    assert paired_differences(rows, "dim", "y", "m") == {}


def test_total_delay_is_loss_and_departure_delay() -> None:
    rows = pd.DataFrame({"complete_time_loss_s": [3.0], "complete_depart_delay_s": [4.0]})
    assert list(with_total_delay(rows)["total_delay_s"]) == [7.0]
    assert TOTAL_DELAY in MEASURES.values()
