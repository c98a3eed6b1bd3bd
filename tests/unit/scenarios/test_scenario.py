"""Scenarios and profiles: the paper's numbers, and eager checks."""

from __future__ import annotations

import numpy as np
import pytest

from minisim import simulate
from minisim.arrivals import Arrivals
from minisim.control import Unregulated
from minisim.demand import Demand, DemandProfile, Period
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.vehicle import VehicleType
from scenarios.profiles import FAIR, PAPER, PROFILES, Profile, profile_named
from scenarios.scenario import Scenario

FOUR = Intersection((0.0, 90.0, 180.0, 270.0))
DEMAND = Demand(density=350.0)
BASE: dict[str, object] = {"name": "x", "intersection": FOUR, "demand": DEMAND}


def table(*rows: tuple[float, int, int]) -> Arrivals:
    time, lane, manoeuvre = (np.array(column) for column in zip(*rows, strict=True))
    return Arrivals(time, lane, manoeuvre)


def test_paper_profile_is_what_the_text_prescribes() -> None:
    """§III: 40 km/h, comfortable deceleration 2 m/s², cars of 4 m with 2 m of headway."""
    assert PAPER.speed_limit == pytest.approx(11.111, abs=1e-3)
    assert (PAPER.vehicle.length, PAPER.vehicle.min_gap) == (4.0, 2.0)
    assert PAPER.vehicle.deceleration == 2.0


def test_profiles_are_found_by_name() -> None:
    assert set(PROFILES) >= {"paper", "fair"}
    for name, profile in PROFILES.items():
        assert profile.name == name
        assert profile_named(name) is profile
        assert profile_named(profile) is profile
    with pytest.raises(InputError, match=r"unknown profile 'fare'.*did you mean 'fair'"):
        profile_named("fare")


def test_site_carries_everything_a_controller_may_know() -> None:
    scenario = Scenario(
        name="x", intersection=FOUR, demand=Demand(density=350, split=(4, 3, 2, 1)), profile=FAIR
    )
    site = scenario.site(seed=5)
    assert (site.intersection, site.seed) == (FOUR, 5)
    assert (site.vehicle, site.speed_limit, site.dt) == (VehicleType(), 14.0, 0.1)
    assert site.demand == pytest.approx((560.0, 420.0, 280.0, 140.0))
    assert scenario.density == pytest.approx(350.0)


def test_arrivals_come_from_the_demand_and_the_seed_alone() -> None:
    one = Scenario(name="x", intersection=FOUR, demand=DEMAND, profile=PAPER)
    other = Scenario(name="y", intersection=FOUR, demand=DEMAND, profile=FAIR)
    np.testing.assert_array_equal(one.arrivals(3).time, other.arrivals(3).time)
    assert one.arrivals(3).time.max() < 3600.0


def test_recorded_arrivals_replace_the_demand() -> None:
    recorded = table((0.0, 0, 1), (1.0, 0, 2), (2.0, 3, 3))
    scenario = Scenario(name="x", intersection=FOUR, demand=DEMAND, horizon=1800, recorded=recorded)
    assert scenario.arrivals(1).manoeuvre.tolist() == [1, 2, 3]
    assert scenario.rates == pytest.approx((4.0, 0.0, 0.0, 2.0))
    assert scenario.density == pytest.approx(1.5)


def test_a_table_of_which_nothing_lies_within_the_horizon_is_refused() -> None:
    late = table((25205.0, 0, 1), (28000.0, 1, 2))
    message = r"within the horizon of 3600 s: the first .* is at 25205 s \(07:00:05\); `start`"
    with pytest.raises(InputError, match=message):
        Scenario(name="x", intersection=FOUR, demand=DEMAND, recorded=late)
    assert Scenario(name="x", intersection=FOUR, demand=DEMAND, recorded=late, horizon=25206.0)


def test_the_horizon_is_exclusive() -> None:
    """A vehicle that comes at the horizon has no time to drive: it is no trip."""
    recorded = table((0.0, 0, 2), (600.0, 0, 2), (600.0, 1, 2), (601.0, 0, 2))
    scenario = Scenario(name="x", intersection=FOUR, demand=DEMAND, horizon=600, recorded=recorded)
    assert sum(scenario.rates) == pytest.approx(6.0)
    run = simulate(scenario, Unregulated())
    assert (run.summary()["trips"], run.summary()["unfinished"]) == (1, 0)
    assert run.counted.columns.demand_time.tolist() == [0.0]
    assert len(run.trips) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"warmup": 60, "horizon": 60}, r"warmup \[s\] must be below 60"),
        ({"demand_time": 61, "horizon": 60}, r"demand_time \[s\] must be at most 60, got 61"),
        (
            {"demand_time": 9, "horizon": 60, "recorded": table((10.0, 0, 1))},
            "no vehicle comes within the demand time of 9 s",
        ),
        ({"demand": Demand(density=350, turns=(1, 1))}, "turns has 2 shares for 3 manoeuvres"),
        ({"demand": Demand(density=1000, split=(1, 0, 0, 0))}, "at most 3600"),
        ({"recorded": table((0.0, 4, 1))}, "lane e is not in the geometry"),
        ({"recorded": table((0.0, 0, 4))}, "manoeuvre 4 does not exist with 4 arms"),
    ],
)
def test_parts_of_a_scenario_fit_together(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Scenario(**{**BASE, **change})  # type: ignore[arg-type]


def test_no_vehicle_departs_faster_than_the_limit() -> None:
    with pytest.raises(InputError, match=r"depart_speed .* at most 14"):
        Profile(name="x", vehicle=VehicleType(), speed_limit=14.0, depart_speed=15.0)


def test_vehicles_may_stop_coming_before_the_horizon() -> None:
    """They are those of a shorter run, at the same rates, and have time to arrive."""
    short = Scenario(**{**BASE, "horizon": 60.0})
    drained = Scenario(**{**BASE, "horizon": 400.0, "demand_time": 60.0})
    assert (drained.until, short.until) == (60.0, 60.0)
    assert drained.site(1) == short.site(1)
    ours, theirs = drained.arrivals(1), short.arrivals(1)
    assert (ours.time == theirs.time).all()
    run = simulate(drained, Unregulated(), 1, on_collision="record")
    assert run.columns.arrived.all()
    assert not simulate(short, Unregulated(), 1, on_collision="record").columns.arrived.all()


def test_recorded_arrivals_and_a_day_stop_at_the_demand_time_too() -> None:
    recorded = table((1.0, 0, 1), (50.0, 1, 1))
    made = Scenario(**{**BASE, "horizon": 100.0, "demand_time": 20.0, "recorded": recorded})
    assert len(made.arrivals(0)) == 1
    assert made.rates == (180.0, 0.0, 0.0, 0.0)
    minute = Period(start="07:00", end="07:01", rates=(360.0, 0.0, 0.0, 0.0))
    day = DemandProfile(periods=(minute,))
    made = Scenario(**{**BASE, "horizon": 100.0, "demand_time": 60.0, "demand": day})
    assert made.rates == (360.0, 0.0, 0.0, 0.0)
    with pytest.raises(InputError, match="ends 60 s after its start, before the run of 70 s"):
        Scenario(**{**BASE, "horizon": 100.0, "demand_time": 70.0, "demand": day})
