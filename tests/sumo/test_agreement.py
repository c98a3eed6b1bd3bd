"""minisim's IDM against SUMO's: the same arrivals, vehicles and controllers, profile `fair`.

Tolerances: mean travel time within 3 %, mean waiting time within 10 % or 0.3 s.
"""

from __future__ import annotations

import itertools
import statistics

import pytest

import minisim
from minisim.sumo import simulate
from scenarios import four_way
from scenarios.controllers import controller_named

CONTROLLERS = (
    "dim", "dim:gate=harmonious", "fixed-time", "adaptive", "all-way-stop", "max-pressure", "v2ic",
    "reservation", "slots",
)  # fmt: skip
PASSED = "dim:gate=passed"
DENSITIES = (150.0, 200.0, 250.0, 300.0, 350.0)
MEASURES = ("waiting_time_s", "travel_time_s")


def outside(name: str, density: float, seeds: range, horizon: float) -> list[object]:
    """The cell with both hosts' means over the seeds, where they disagree."""
    scenario = four_way(density, profile="fair", horizon=horizon)
    controller = controller_named(name, "fair")
    ours, theirs = (
        {m: statistics.fmean(s[m] for s in summaries) for m in MEASURES}
        for run in (minisim.simulate, simulate)
        for summaries in [[run(scenario, controller, seed).summary() for seed in seeds]]
    )
    cells = "  ".join(f"{ours[m]:8.2f} {theirs[m]:8.2f}" for m in MEASURES)
    print(f"{name:<15} {density:4.0f} {cells}")  # noqa: T201  (for pytest -s)
    waiting, travel = (abs(theirs[m] - ours[m]) for m in MEASURES)
    close = travel <= 0.03 * ours["travel_time_s"]
    if close and waiting <= max(0.3, 0.1 * ours["waiting_time_s"]):
        return []
    return [(name, density, ours, theirs)]


@pytest.mark.parametrize("name", [*CONTROLLERS, pytest.param(PASSED, marks=pytest.mark.slow)])
def test_a_quarter_of_an_hour_agrees(name: str) -> None:
    assert outside(name, 250.0, range(1, 2), 900.0) == []


@pytest.mark.slow
def test_hours_agree_at_every_density() -> None:
    # The host's rules were chosen without these seeds.
    cells = itertools.product(CONTROLLERS, DENSITIES)
    assert [it for cell in cells for it in outside(*cell, range(101, 104), 3600.0)] == []
