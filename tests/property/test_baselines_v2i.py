"""V2I-C and reservation on any junction, with any cars: nobody collides, everybody is served."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from hypothesis import given
from hypothesis import strategies as st

import minisim
from baselines import V2IC, Reservation
from minisim.control import Controller, Site
from minisim.junction.conflicts import CLEARANCE, conflict_zones, entry_room
from minisim.junction.geometry import Intersection
from minisim.vehicle import VehicleType
from scenarios.scenario import FAIR, Profile, Scenario
from scenarios.strategies import demands, floats, intersections, vehicles
from tests.builders import share

#: Demand for a minute, then time for any rule to serve it [s].
DEMAND_TIME, HORIZON = 60.0, 3600.0


@st.composite
def emptying(draw: st.DrawFn, max_density: float = 700.0) -> Scenario:
    """A random junction with random cars, whose demand ends long before the run does."""
    intersection = replace(draw(intersections()), arm_length=draw(st.sampled_from([80.0, 200.0])))
    vehicle = draw(vehicles())
    if entry_room(intersection, vehicle) <= 0.0:
        vehicle = FAIR.vehicle
    demand = draw(demands(intersection.n, max_density))
    return Scenario(
        name="random",
        intersection=intersection,
        demand=demand,
        profile=Profile(name="random", vehicle=vehicle, speed_limit=draw(floats(6.0, 20.0))),
        horizon=HORIZON,
        recorded=demand.draw(intersection.n, DEMAND_TIME, seed=draw(st.integers(0, 1000))),
    )


def serves_all(scenario: Scenario, controller: Controller) -> None:
    run = minisim.simulate(scenario, controller, on_collision="record")
    assert run.collisions == ()
    assert run.trips["arrival_s"].notna().all()


@share(0.5)
@given(emptying(), st.sampled_from([V2IC(), V2IC(reach=60.0, period=0.2)]))
def test_under_v2ic_nobody_collides_and_everybody_is_served(
    scenario: Scenario, controller: Controller
) -> None:
    serves_all(scenario, controller)


@share(0.5)
@given(emptying(), st.sampled_from([Reservation(), Reservation(reach=100.0, period=0.2)]))
def test_under_reservation_nobody_collides_and_everybody_is_served(
    scenario: Scenario, controller: Controller
) -> None:
    serves_all(scenario, controller)


@share(0.2)
@given(intersections(max_arms=5), vehicles(), st.data())
def test_out_of_their_zones_no_two_bodies_touch(
    intersection: Intersection, vehicle: VehicleType, data: st.DataObject
) -> None:
    """Brute force: bodies of two movements in conflict, anywhere while not both are in zones."""
    if entry_room(intersection, vehicle) <= 0.0:
        vehicle = FAIR.vehicle
    site = Site(
        intersection=intersection,
        vehicle=vehicle,
        speed_limit=14.0,
        demand=(0.0,) * intersection.n,
    )
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
