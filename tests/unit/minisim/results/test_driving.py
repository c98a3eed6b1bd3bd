"""Stops, hard braking, jerk and emissions of vehicles whose way is written down by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import minisim
from dim import Dim
from minisim.control import Unregulated
from minisim.errors import InputError
from minisim.results.driving import co2, fuel, hard_brakings, jerk, stops
from minisim.results.run import Run
from scenarios import four_way
from tests.builders import driven, replayed


@pytest.fixture(scope="module")
def run() -> Run:
    """Two vehicles, of which nothing is known but when they came."""
    scenario = replayed(four_way(0, profile="fair"), (0.0, 0, 2), (0.0, 1, 2), horizon=20.0)
    return minisim.simulate(scenario, Dim(), record="all")


def drives(
    run: Run, speeds: Sequence[float], accelerations: Sequence[float] = (), *, first: int = 1
) -> Run:
    """Vehicle 1 has these speeds and accelerations, from a tick on; vehicle 0 stands still."""
    a = accelerations or [0.0] * len(speeds)
    lines = [(1, first + k, 10.0, v, a[k]) for k, v in enumerate(speeds)]
    return driven(run, *lines, *((0, k, 10.0, 0.0, 0.0) for k in range(1, 5)))


def test_a_stop_begins_at_a_tenth_of_a_metre_per_second(run: Run) -> None:
    assert stops(drives(run, [5, 0.11, 0.1, 0.0, 0.2, 0.05, 3, 0.1])).tolist() == [1, 3]
    assert stops(drives(run, [0.0, 0.0, 5, 6])).tolist() == [1, 1], "one that starts at rest stood"
    assert stops(drives(run, [5, 4, 3])).tolist() == [1, 0]


def test_hard_braking_begins_beyond_what_is_comfortable(run: Run) -> None:
    a = [0.0, -3.4, -3.5, -4, -3, -3.41, 1]
    assert hard_brakings(drives(run, [9.0] * len(a), a)).tolist() == [0, 2]


def test_jerk_is_the_change_of_acceleration_in_a_second(run: Run) -> None:
    ramp = [-0.2 * k for k in range(16)]  # −2 m/s² in every second
    assert jerk(drives(run, [9.0] * 16, ramp))[1] == pytest.approx(2.0)
    step = [0.0] * 12 + [1.5] * 12
    measured = jerk(drives(run, [9.0] * 24, step))
    assert measured[1] == pytest.approx(1.5), "a jump counts by what it changes in a second"
    assert np.isnan(measured[0]), "shorter than a second"


def test_emissions_are_summed_over_the_way(run: Run) -> None:
    idle, cruise = 3014 / 3.6, (3014 - 149 * 10 + 9.014 * 100) / 3.6  # mg/s, see the polynomial
    measured = fuel(drives(run, [0.0] * 10 + [10.0] * 20))
    assert measured[1] == pytest.approx((idle + 2 * cruise) / 1000)
    assert measured[0] == pytest.approx(0.4 * idle / 1000)
    assert co2(drives(run, [0.0] * 10))[1] == pytest.approx(9449 / 3600)


def test_types_without_a_class_have_no_emissions() -> None:
    fleet = {"car": 0.4, "lcv": 0.2, "motorcycle": 0.4}
    scenario = four_way(300, profile="fair", fleet=fleet, horizon=90.0)
    run = minisim.simulate(scenario, Dim(), 1, record="all")
    known = np.isin(np.array(run.site.fleet.names)[run.columns.type], ["car", "lcv"])
    assert 0 < known.sum() < len(known)
    assert (np.isfinite(fuel(run)) == known).all()
    assert (np.isfinite(co2(run)) == known).all()


def test_all_of_the_way_is_needed() -> None:
    scenario = four_way(200, profile="fair", horizon=40.0)
    for options in ({}, {"record": "junction"}, {"record": "all", "record_window": (5.0, 20.0)}):
        part = minisim.simulate(scenario, Unregulated(), on_collision="record", **options)  # type: ignore[arg-type]
        with pytest.raises(InputError, match=r"not all of each trip was recorded: .*record='all'"):
            stops(part)


def test_the_warmup_counts_for_none() -> None:
    scenario = four_way(300, profile="fair", horizon=120.0)
    whole = minisim.simulate(scenario, Dim(), 2, record="all")
    warm = minisim.simulate(replace(scenario, warmup=60.0), Dim(), 2, record="all").counted
    since = whole.columns.demand_time >= 60.0
    for of in (stops, hard_brakings, fuel, co2):
        np.testing.assert_allclose(of(warm), of(whole)[since])
