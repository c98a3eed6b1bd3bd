"""The lanes of a study's rows."""

from __future__ import annotations

import pandas as pd
import pytest

from scenarios.studies.fairness import lane_waits
from scenarios.studies.shared.points import fair
from tests.builders import synthetic_row


def test_worst_lane_of_rows() -> None:
    row = lane_waits(pd.DataFrame([synthetic_row(fair("dim", 4, 200.0).recipe(1))]), 4).iloc[0]
    assert row["worst_lane_s"] == row["lanes_d_complete_waiting_time_s"]
    assert row["gini"] == pytest.approx(0.25), "lanes 1 : 2 : 3 : 4"
