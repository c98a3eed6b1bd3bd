"""Spill-back: which queue reached the end of its road, and since when."""

from __future__ import annotations

from dataclasses import replace

import pytest

from minisim import simulate
from minisim.control import Close, Plan, Unregulated, View, Wake
from minisim.results.spillback import clearing_time
from minisim.vehicle import VehicleType
from scenarios import Scenario, four_way
from scenarios.profiles import PROFILES
from tests.builders import replayed


class ClosedUntil:
    """All lanes are open, but lane a only from a time on."""

    name = "closed-until"

    def __init__(self, time: float) -> None:
        self._time = time
        self.plan = Plan(lanes_open=True)

    def start(self, _: object) -> ClosedUntil:
        return self

    def decide(self, view: View) -> list[object]:
        from minisim.control import Open

        return [Open(0)] if view.time >= self._time else [Close(0), Wake(self._time)]


def road(**options: object) -> Scenario:
    """Roads of 100 m on which vehicles come to lane a every 10 s, and to lane b every 5 s."""
    scenario = four_way(0, profile="fair", arm_length=100.0, **options)  # type: ignore[arg-type]
    trips = [(10.0 * k, 0, 2) for k in range(20)] + [(5.0 * k, 1, 2) for k in range(40)]
    return replayed(scenario, *sorted(trips), horizon=400.0)


def test_the_summary_says_which_lane_and_since_when() -> None:
    """The vehicles that fit the road are on it; the next one came when the queue was too long."""
    run = simulate(road(), ClosedUntil(1e6), on_collision="record")
    a = run.trips[run.trips["lane"] == "a"]
    on_road = a["depart_s"].notna().sum()
    vehicle, room = run.site.vehicle, run.site.intersection.approach_length
    assert on_road == room // (vehicle.length + vehicle.min_gap)
    summary = run.summary()
    assert summary["spillback_s"] == summary["lanes"]["a"]["spillback_s"] == 10.0 * on_road
    assert summary["lanes"]["b"]["spillback_s"] is None
    assert f"the queue reached the end of the road of lane a at {10 * on_road} s" in repr(run)
    assert f"of lane a at {10 * on_road} s" in run._repr_html_()


def test_it_is_said_of_queues_that_dissolve_but_not_of_those_before_the_warmup() -> None:
    held = simulate(road(), ClosedUntil(160.0), on_collision="record")
    assert held.summary()["unfinished"] == 0
    assert held.summary()["spillback_s"] == 120.0
    warm = simulate(replace(road(), warmup=140.0), ClosedUntil(160.0), on_collision="record")
    assert warm.summary()["spillback_s"] == 140.0  # it is still so then
    late = simulate(replace(road(), warmup=300.0), ClosedUntil(160.0), on_collision="record")
    assert late.summary()["spillback_s"] is None
    short = simulate(road(), ClosedUntil(60.0), on_collision="record")
    assert short.summary()["spillback_s"] is None
    assert "the end of the road" not in repr(short)


@pytest.mark.parametrize("profile", ["paper", "fair"])
def test_a_burst_of_arrivals_is_no_spillback(profile: str) -> None:
    """On an open road of 1200 veh/h, vehicles wait for a place one after another."""
    scenario = four_way(1200, profile=profile, turns="1:0:0", horizon=600.0)
    summary = simulate(scenario, Unregulated()).summary(["depart_delay_s"])
    one = PROFILES[profile]
    assert summary["depart_delay_s_max"] > clearing_time(one.vehicle, one.speed_limit)
    assert summary["spillback_s"] is None


@pytest.mark.parametrize("profile", ["as_run", "as_run_signals"])
def test_a_burst_of_the_published_vehicles_is_no_spillback(profile: str) -> None:
    """Twelve at once: each enters when the one before it has driven on."""
    scenario = replayed(four_way(0, profile=profile), *[(0.0, 0, 1)] * 12, horizon=150.0)
    summary = simulate(scenario, Unregulated(), on_collision="record").summary(["depart_delay_s"])
    assert summary["depart_delay_s_max"] > 10.0
    assert summary["spillback_s"] is None


def test_the_time_to_drive_on_is_from_rest() -> None:
    vehicle = VehicleType(length=4.0, min_gap=2.0, acceleration=3.0, headway=1.5)
    assert clearing_time(vehicle, 20.0) == pytest.approx(2.0 + 1.5)
    assert clearing_time(vehicle, 3.0) == pytest.approx(2.0 + 0.5 + 1.5)
    drivers = replace(vehicle, speed_deviation=0.1)
    assert clearing_time(drivers, 3.0 / 0.7) == pytest.approx(2.0 + 0.5 + 1.5)
