"""Spill-back in SUMO: said of the same lanes at the same times as in minisim."""

from __future__ import annotations

from typing import Any

import pytest

from dim import Dim
from minisim.control import Unregulated
from scenarios import four_way
from tests.builders import replayed
from tests.sumo.conftest import both


@pytest.mark.parametrize(
    ("options", "controller"),
    [
        ({"profile": "fair", "density": 700.0, "arm_length": 100.0, "horizon": 300.0}, Dim()),
        (
            {"profile": "as_run", "density": 900.0, "arm_length": 150.0, "horizon": 120.0},
            Dim(),
        ),
    ],
)
def test_both_hosts_say_the_same(options: dict[str, Any], controller: Any) -> None:
    runs = both(four_way(**options), controller, 1, on_collision="record")
    ours, theirs = (
        [lane["spillback_s"] for lane in run.summary()["lanes"].values()] for run in runs
    )
    assert any(ours)
    for one, other in zip(ours, theirs, strict=True):
        assert other == (one if one is None else pytest.approx(one, abs=5.0))


def test_a_burst_of_published_vehicles_is_no_spillback() -> None:
    scenario = replayed(four_way(0, profile="as_run"), *[(0.0, 0, 1)] * 12, horizon=30.0)
    for run in both(scenario, Unregulated(), on_collision="record"):
        assert run.summary()["spillback_s"] is None
