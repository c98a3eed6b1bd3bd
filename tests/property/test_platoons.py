"""No vehicle passes a place before its reference, whatever those of its lane are told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from baselines.optimum.alone import drives
from baselines.optimum.platoons import earliest
from baselines.prediction import Floats
from minisim.arrivals import Arrivals
from minisim.control import Unregulated
from minisim.errors import InputError
from minisim.results.run import Run
from minisim.results.trajectories import SPEED, TIME, VEHICLE, S
from minisim.simulation import simulate
from minisim.vehicle import VehicleType
from scenarios.library import four_way
from scenarios.optimum import drained
from scenarios.profiles import FAIR, PAPER, Profile
from scenarios.scenario import Scenario
from tests.builders import share
from tests.property.test_optimum import Jerky

#: Places past the entry at which vehicles are compared [m].
PLACES = (-400.0, -200.0, -50.0, 0.0, 8.0)


@st.composite
def profiles(draw: st.DrawFn) -> Profile:
    """Those of the library, or with any IDM vehicle, step and speed at insertion."""
    profile = draw(st.sampled_from([FAIR, PAPER]))
    if draw(st.booleans()):
        return profile
    try:
        vehicle = VehicleType(
            length=draw(st.floats(3.0, 5.0)),
            min_gap=draw(st.floats(1.0, 4.0)),
            headway=draw(st.floats(0.6, 2.0)),
            acceleration=draw(st.floats(0.8, 4.0)),
            deceleration=draw(st.floats(1.5, 5.0)),
            exponent=draw(st.sampled_from([1.0, 2.0, 4.0, 8.0])),
            max_deceleration=25.0,
        )
    except InputError:
        assume(False)
        raise
    speed = draw(st.none() | st.floats(0.0, 10.0))
    step = draw(st.sampled_from([0.05, 0.1, 0.2, 0.25]))
    return replace(profile, vehicle=vehicle, depart_speed=speed, dt=step)


@st.composite
def lanes(draw: st.DrawFn) -> Scenario:
    """Vehicles of one lane within seconds."""
    rows = draw(
        st.lists(st.tuples(st.floats(0.0, 1.0), st.integers(1, 3)), min_size=2, max_size=12)
    )
    time, manoeuvre = map(np.array, zip(*rows, strict=True))
    span = draw(st.sampled_from([3.0, 15.0, 40.0]))
    recorded = Arrivals(np.sort(span * time), np.zeros(len(rows), int), manoeuvre)
    return replace(four_way(profile=draw(profiles())), recorded=recorded, horizon=200.0)


def bounds(run: Run, place: float) -> Floats:
    """When each vehicle can be at a place at the earliest [s]."""
    trips, site = run.columns, run.site
    kind = site.intersection.movements.index_of[trips.lane, trips.manoeuvre]
    enters = np.ceil(trips.demand_time / site.dt - 1e-6).astype(np.int64)
    marks, speed = np.full(len(drives(site)), place), run.scenario.depart_speed
    return earliest(site, enters, np.asarray(trips.lane, np.int64), kind, marks, speed)


def passages(run: Run, place: float) -> Iterator[tuple[int, float]]:
    """Vehicles that pass a place, and when [s]: acceleration is constant within a step."""
    entry = run.site.intersection.approach_length
    for vehicle, path in run.trajectories.groupby(VEHICLE):
        past, v = path[S].to_numpy() - entry, path[SPEED].to_numpy()
        n = int(past.searchsorted(place))
        if 0 < n < len(past):
            left, a = place - past[n - 1], (v[n] - v[n - 1]) / run.site.dt
            reached = np.sqrt(max(v[n - 1] ** 2 + 2.0 * a * left, 0.0))
            took = 2.0 * left / max(v[n - 1] + reached, 1e-9)
            yield int(vehicle), float(path[TIME].iloc[n - 1] + took)


@given(lanes(), st.integers(0, 10**6), st.sampled_from([0.0, 0.01, 0.05]))
@share(0.5)
def test_no_vehicle_is_ahead_of_its_reference(scenario: Scenario, seed: int, often: float) -> None:
    run = simulate(drained(scenario), Jerky(seed, often), record="all")
    for place in PLACES:
        least = bounds(run, place)
        for vehicle, time in passages(run, place):
            assert least[vehicle] <= time + 1e-9


@pytest.mark.parametrize(("headway", "slack"), [(1.6, 0.3), (2.5, 0.2), (4.0, 0.05)])
def test_a_platoon_straight_on_drives_nearly_like_its_references(
    headway: float, slack: float
) -> None:
    """Most of what ten vehicles lose behind each other is known."""
    time = 1.0 + headway * np.arange(10)
    recorded = Arrivals(time, np.zeros(10, int), np.full(10, 2))
    scenario = replace(four_way(profile=FAIR), recorded=recorded, horizon=200.0)
    run = simulate(drained(scenario), Unregulated(), record="all")
    least = bounds(run, 0.0)
    real = np.array([time for _, time in passages(run, 0.0)])
    lost = least - least[0] - (time - time[0])
    assert (least <= real + 1e-9).all()
    assert (real - least).max() <= slack
    assert (np.diff(lost) > 0.0).all()
