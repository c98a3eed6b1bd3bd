"""Every measure under every controller: each can be taken, and they agree with each other."""

from __future__ import annotations

import numpy as np
import pytest

import minisim
from minisim.control import HALTING
from minisim.results.driving import co2, fuel, stops
from minisim.results.fairness import order_reversals
from minisim.results.metrics import METRICS
from minisim.results.queues import queue_table
from minisim.results.run import Run
from scenarios import four_way
from scenarios.controllers import controller_named, safe

#: Vehicles that send each other nothing, or whose controllers only show lights.
SILENT = ("dim", "fixed-time", "adaptive", "actuated", "max-pressure", "all-way-stop")


@pytest.fixture(scope="module", params=safe())
def run(request: pytest.FixtureRequest) -> Run:
    scenario = four_way(400, profile="fair", arm_length=150.0, horizon=100.0)
    return minisim.simulate(scenario, controller_named(request.param), 1, record="all", timed=True)


def test_all_metrics_can_be_taken(run: Run) -> None:
    summary = run.summary(list(METRICS), by=["movement"])
    numbers = {name: summary[name] for name in METRICS}
    assert {name for name, value in numbers.items() if value is None} <= {
        "saturation_headway_s", "crossings", "false_grants", "disagreement_s", "deadlock_s",
        "min_ttc_s", "min_pet_s", "max_drac_mps2",
    }  # fmt: skip
    assert all(value is None or np.isfinite(value) for value in numbers.values())
    talks = not summary["controller"].startswith(SILENT)
    assert (numbers["messages"] > 0) is (numbers["message_bytes"] > 0) is talks


def test_they_agree_with_each_other(run: Run) -> None:
    trips, tracks = run.columns, run.tracks
    waited = np.bincount(tracks.trip, tracks.v <= HALTING, len(trips.lane)) * run.site.dt
    np.testing.assert_allclose(waited, trips.waiting_time, atol=1e-9)
    np.testing.assert_array_equal(stops(run) > 0, trips.waiting_time > 0.0)
    assert (fuel(run)[trips.arrived] > 0.0).all()
    ratio = co2(run)[trips.arrived] / fuel(run)[trips.arrived]
    assert ((ratio > 3.0) & (ratio < 3.3)).all(), "3.1 kg of CO₂ per kg of petrol"
    table = queue_table(run)
    outside = table["before_road"].sum() * run.site.dt
    assert outside == pytest.approx(trips.depart_delay.sum(), abs=len(trips.lane) * run.site.dt)
    assert (table["on_road"].sum() > 0) or trips.waiting_time.max() < 1.0
    assert order_reversals(run).sum() <= len(trips.lane) ** 2 / 2
