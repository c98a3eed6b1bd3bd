"""Baselines on any junction, with any parameters: no collision, and every vehicle is served."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st

import minisim
from baselines import (
    V2IC,
    Actuated,
    Adaptive,
    AllWayStop,
    FixedTime,
    MaxPressure,
    Platoons,
    Reservation,
    Slots,
)
from minisim.control import ORDINARY, Controller, Site, cover_of
from minisim.errors import InputError
from minisim.junction.conflicts import CLEARANCE, conflict_zones, entry_room
from minisim.junction.geometry import Intersection
from minisim.results.encounters import encroachments
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.controllers import controller_named, safe
from scenarios.profiles import FAIR, PROFILES, Profile
from scenarios.scenario import Scenario
from scenarios.strategies import demands, floats, intersections, vehicles
from tests.builders import Greens, drained, queues, replayed, share

#: None at all, less than a step, and no whole number of steps among them [s].
AMBERS = st.sampled_from([0.0, 0.04, 2.0, 3.03])
GREENS = {"min_green": floats(0.5, 10.0), "max_green": floats(10.0, 50.0), "amber": AMBERS}

BUFFERS = st.none() | floats(0.0, 2.0)

#: From detectors just before the line to ones beyond short roads, from short to long greens.
RIVALS: dict[str, st.SearchStrategy[Controller]] = {
    "fixed-time": st.builds(
        FixedTime, greens=st.none() | floats(2.0, 20.0), amber=AMBERS,
        all_red=st.sampled_from([0.0, 1.0]), facing=st.booleans(),
    ),
    "adaptive": st.builds(
        Adaptive, detector_range=floats(15.0, 200.0), min_time_loss=floats(0.0, 5.0),
        extend_max_green=st.booleans(), **GREENS,
    ),
    "actuated": st.builds(
        Actuated, max_gap=floats(0.0, 10.0), detector_gap=floats(0.1, 20.0),
        passing_time=floats(0.1, 5.0), presence=st.booleans(), **GREENS,
    ),
    "max-pressure": st.builds(
        MaxPressure, interval=floats(0.5, 15.0), detector_range=floats(2.0, 200.0), amber=AMBERS,
        facing=st.booleans(),
    ),
    "all-way-stop": st.builds(AllWayStop, reaction=st.just(0.0) | floats(0.0, 3.0)),
    "v2ic": st.sampled_from([V2IC(), V2IC(reach=60.0, period=0.2)]),
    "reservation": st.sampled_from([Reservation(), Reservation(reach=100.0, period=0.2)]),
    "flows": st.builds(Slots, batch=st.integers(1, 12), buffer=BUFFERS, reach=floats(40.0, 300.0))
    | st.builds(Platoons, service=st.sampled_from(["exhaustive", "gated"]), buffer=BUFFERS),
}  # fmt: skip

#: These keep bodies apart in time, by their predictions; the others never share a conflict area.
PREDICTING = ("v2ic", "reservation", "flows")


@st.composite
def emptying(draw: st.DrawFn) -> Scenario:
    """A random junction with demand for a minute, and an hour in which to serve it."""
    road = replace(draw(intersections()), arm_length=draw(st.sampled_from([80.0, 150.0])))
    demand, seed = draw(demands(road.n)), draw(st.integers(0, 1000))
    # Under the profile as_run, signals are dead.
    profile = PROFILES[draw(st.sampled_from(sorted(set(PROFILES) - {"as_run"})))]
    scenario = Scenario(name="random", intersection=road, demand=demand, profile=profile)
    return drained(replace(scenario, horizon=60.0), seed, 3600.0)


@pytest.mark.parametrize("name", RIVALS)
@share(0.3)
@given(data=st.data())
def test_no_vehicle_collides_and_each_is_served(name: str, data: st.DataObject) -> None:
    scenario, controller = data.draw(emptying()), data.draw(RIVALS[name])
    if name in PREDICTING:  # with any cars, at any limit, also where they queue
        vehicle = data.draw(vehicles())
        if entry_room(scenario.intersection, vehicle) <= 0.0:
            vehicle = FAIR.vehicle
        limit, n = data.draw(floats(6.0, 20.0)), scenario.intersection.n
        scenario = replace(
            scenario,
            profile=Profile(name="random", vehicle=vehicle, speed_limit=limit),
            recorded=data.draw(demands(n, 700.0)).draw(n, 60.0, data.draw(st.integers(0, 1000))),
        )
    if getattr(controller, "facing", False) and scenario.profile.vehicle not in ORDINARY:
        controller = replace(controller, facing=False)  # as it is refused
    run = minisim.simulate(scenario, controller, record="junction", on_collision="record")
    assert run.collisions == ()
    assert run.trips["arrival_s"].notna().all()
    if name not in PREDICTING:
        assert (encroachments(run.trajectories, run.site)["pet_s"] > 0.0).all()


#: One body each, since the geometry of conflicts is what takes long.
BODIES = [{}, {"length": 3.0, "min_gap": 1.0}, {"length": 6.0}]
EDGE_CASE = {
    "vehicle": VehicleType(deceleration=4.5, headway=1.0), "trips": [(0.0, 0, 2)],
    "name": "reservation", "dt": 0.1,
}  # fmt: skip


@st.composite
def any_law(draw: st.DrawFn) -> VehicleType:
    return VehicleType(
        **draw(st.sampled_from(BODIES)),
        model=draw(st.sampled_from(["idm", "iidm", "krauss"])),
        deceleration=draw(floats(1.5, 5.0)),
        headway=draw(floats(0.8, 3.0)),
        speed_deviation=draw(st.sampled_from([0.0, 0.1, 0.5])),
    )


@share(0.2)
@given(
    name=st.sampled_from(safe()),
    vehicle=any_law(),
    limit=st.sampled_from([0.5, 1.0, 100.0]) | floats(0.5, 100.0),
    dt=st.sampled_from([0.05, 0.1, 0.25, 0.5]),
    trips=st.lists(
        st.tuples(floats(0.0, 20.0), st.integers(0, 3), st.integers(1, 3)), min_size=1, max_size=9
    ),
)
@example(**EDGE_CASE, limit=0.5)
@example(**EDGE_CASE | {"dt": 0.5}, limit=0.5)
def test_at_any_limit_step_and_law_each_is_served_or_all_are_refused(
    name: str, vehicle: VehicleType, limit: float, dt: float, trips: list[tuple[float, int, int]]
) -> None:
    profile = Profile(name="random", vehicle=vehicle, speed_limit=limit, dt=dt)
    road = four_way(100, profile=profile, arm_length=80.0)
    scenario = replayed(road, *sorted(trips), horizon=50_000.0)
    controller = controller_named(name)
    if vehicle not in cover_of(controller):
        with pytest.raises(InputError, match="speed_deviation"):
            minisim.simulate(scenario, controller)
        return
    run = minisim.simulate(scenario, controller, on_collision="record")
    assert run.collisions == ()
    assert run.columns.arrived.all()


@share(0.2)
@given(intersections(max_arms=5), vehicles(), st.data())
def test_out_of_their_zones_no_two_bodies_touch(
    intersection: Intersection, vehicle: VehicleType, data: st.DataObject
) -> None:
    """Brute force: bodies of two movements in conflict, anywhere while not both are in zones."""
    if entry_room(intersection, vehicle) <= 0.0:
        vehicle = FAIR.vehicle
    site = Site(intersection, vehicle, speed_limit=14.0, demand=(0.0,) * intersection.n)
    zones = conflict_zones(intersection, vehicle)
    conflicts = np.argwhere(site.conflicts)
    assert np.array_equal(np.isfinite(zones[..., 0]), site.conflicts)
    for p, q in data.draw(st.permutations(conflicts.tolist()))[:8]:
        one, other = intersection.paths[p], intersection.paths[q]
        s = [np.arange(0.0, path.exit - path.entry + vehicle.length, 0.37) for path in (one, other)]
        outside = ~((s[0] > zones[p, q, 0]) & (s[0] < zones[p, q, 1]))
        bodies = [
            shapely.polygons(path.bodies(path.entry + at, vehicle))
            for path, at in zip((one, other), s, strict=True)
        ]
        near = shapely.dwithin(bodies[0][outside][:, None], bodies[1][None, :], CLEARANCE * 0.9)
        assert not near.any()


# Signals that detect vehicles: a vehicle that stood in a green leaves in it.

SIGNALS = {"actuated": Actuated, "adaptive": Adaptive}


@st.composite
def queueing_vehicles(draw: st.DrawFn) -> VehicleType:
    """Of any length that fits four arms, with any usual gap."""
    return VehicleType(
        length=draw(floats(0.5, 8.0)),
        min_gap=draw(floats(0.5, 5.0)),
        headway=draw(floats(0.5, 1.5)),
        acceleration=draw(floats(1.0, 4.0)),
        model=draw(st.sampled_from(["idm", "iidm", "krauss"])),
    )


@pytest.mark.parametrize("name", SIGNALS)
@share(0.2)
@given(vehicle=queueing_vehicles(), limit=floats(3.0, 20.0), shortest=floats(0.5, 10.0))
@example(  # one stands where it enters, not in the queue
    vehicle=VehicleType(length=0.84375, headway=0.5, min_gap=0.5, model="iidm"),
    limit=3.625, shortest=3.0,
)  # fmt: skip
def test_a_standing_queue_is_served_in_one_green(
    name: str, vehicle: VehicleType, limit: float, shortest: float
) -> None:
    watched = Greens(SIGNALS[name](min_green=shortest, max_green=600.0))
    run = minisim.simulate(queues(vehicle, limit), watched)
    assert run.summary()["unfinished"] == 0
    assert watched.left
    assert not any(watched.left)
