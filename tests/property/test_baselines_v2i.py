"""V2I-C and reservation on any junction, with any cars: nobody collides, everybody is served."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import strategies as st

from scenarios.scenario import FAIR, Profile, Scenario
from tests.strategies import demands, floats, intersections, vehicles

#: Demand for a minute, then time for any rule to serve it [s].
DEMAND_TIME, HORIZON = 60.0, 3600.0


@st.composite
def emptying(draw: st.DrawFn, max_density: float = 700.0) -> Scenario:
    """A random junction with random cars, whose demand ends long before the run does."""
    intersection = replace(draw(intersections()), arm_length=draw(st.sampled_from([80.0, 200.0])))
    vehicle = draw(vehicles())
    if intersection.room(vehicle) <= 0.0:
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
