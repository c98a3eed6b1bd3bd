"""How evenly waiting is spread over the lanes."""

from __future__ import annotations

from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from minisim.errors import InputError
from scenarios.studies.fairness import gini, lane_waits
from scenarios.studies.shared.points import fair
from tests.builders import synthetic_row


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


def test_worst_lane_of_rows() -> None:
    row = lane_waits(pd.DataFrame([synthetic_row(fair("dim", 4, 200.0).recipe(1))]), 4).iloc[0]
    assert row["worst_lane_s"] == row["lanes_d_complete_waiting_time_s"]
    assert row["gini"] == pytest.approx(0.25), "lanes 1 : 2 : 3 : 4"
