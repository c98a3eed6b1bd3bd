"""Whether a vehicle can stop."""

from __future__ import annotations

import pytest

from minisim.control import (
    COMMIT_MARGIN,
    can_stop,
    stopping_distance,
)
from tests.builders import seen


def test_stopping_distance_is_v_squared_over_2b() -> None:
    """The paper's 23.14 m for 40 to 20 km/h at 2 m/s² are the difference of two of these."""
    v, w = 40 / 3.6, 20 / 3.6
    assert stopping_distance(v, 2.0) == pytest.approx(30.86, abs=0.005)
    assert stopping_distance(v, 2.0) - stopping_distance(w, 2.0) == pytest.approx(23.15, abs=0.01)


def test_a_vehicle_can_stop_while_the_stopping_distance_fits_before_the_junction() -> None:
    needed = stopping_distance(10.0, 2.0) + COMMIT_MARGIN
    assert can_stop(seen(1, 2, 3, needed + 1e-9, 10.0), 2.0)
    assert not can_stop(seen(1, 2, 3, needed - 1e-6, 10.0), 2.0)
    assert can_stop(seen(1, 2, 3, 0.0), 2.0), "it stands"
    assert not can_stop(seen(1, 2, 3, -0.01), 2.0), "it stands inside"
