"""No law and no step that a constructor allows makes a vehicle run into the one ahead."""

from __future__ import annotations

from functools import partial

from hypothesis import example, given, settings
from hypothesis import strategies as st

from minisim.carfollowing import ballistic, stop_within
from minisim.results.run import Run
from minisim.simulation import simulate
from minisim.testing import small_scenario
from minisim.vehicle import VehicleType
from scenarios.controllers import controller_named
from scenarios.strategies import floats
from tests.builders import Pedals, as_run

STEPS = st.sampled_from([0.5, 0.3, 0.2, 0.1])


@st.composite
def any_vehicle(draw: st.DrawFn) -> VehicleType:
    """Any driver that a constructor accepts, with brakes that are just enough or far more."""
    parts = {
        "model": draw(st.sampled_from(["idm", "iidm", "krauss"])),
        "acceleration": draw(floats(0.05, 100.0)),
        "deceleration": draw(floats(0.5, 100.0)),
        "headway": draw(floats(0.5, 10.0)),
        "min_gap": draw(floats(0.5, 20.0)),
        "exponent": draw(floats(1.0, 50.0)),
        "speed_deviation": draw(st.sampled_from([0.0, 0.1, 0.5])),
    }
    needed = VehicleType(max_deceleration=1000.0, **parts).needed_braking
    most = draw(st.sampled_from([1.0, 1.3, 10.0])) * needed + 1e-9
    return VehicleType(max_deceleration=min(most, 1000.0), **parts)


def within_lanes(run: Run) -> str:
    """The collisions of vehicles from one lane, in words."""
    lane = run.columns.lane
    return "; ".join(
        str(it) for it in run.collisions if lane[it.vehicles[0]] == lane[it.vehicles[1]]
    )


car = partial(VehicleType, max_deceleration=1000.0)


@given(
    any_vehicle(), STEPS, floats(0.5, 100.0), st.sampled_from(["fixed-time", "dim"]),
    st.sampled_from([350.0, 1500.0]), st.just(3),
)  # fmt: skip
@example(
    car(acceleration=50.0, deceleration=20.0, min_gap=0.5, max_deceleration=54.0),
    0.2, 5.0, "fixed-time", 3000.0, 3,
)  # fmt: skip
@example(
    car(acceleration=10.0, deceleration=20.0, exponent=50.0, headway=0.8, min_gap=0.5),
    0.5, 0.5, "fixed-time", 1500.0, 3,
)  # fmt: skip
@example(
    car(acceleration=50.0, deceleration=1.0, headway=0.5, speed_deviation=0.5),
    0.5, 1.0, "fixed-time", 1500.0, 3,
)  # fmt: skip
@example(
    car(acceleration=0.1, headway=0.5, max_deceleration=6.0), 0.3, 100.0, "dim", 3000.0, 3
)  # fmt: skip
# In a turn the corners of bodies touch that have half a metre between the middles of the bumpers.
@example(
    car(acceleration=100.0, min_gap=0.5, headway=8.28, speed_deviation=0.5, max_deceleration=30.0),
    0.25, 0.5, "fixed-time", 3000.0, 5,
)  # fmt: skip
@settings(max_examples=12)
def test_no_vehicle_runs_into_the_one_ahead(
    vehicle: VehicleType, dt: float, limit: float, controller: str, density: float, arms: int
) -> None:
    scenario = small_scenario(
        arms, vehicle=vehicle, dt=dt, speed_limit=limit, density=density, demand_time=40.0,
        drain=40.0 + 120.0 / limit, arm_length=80.0 if arms > 3 else 60.0,
    )  # fmt: skip
    run = simulate(scenario, controller_named(controller), seed=2, on_collision="record")
    assert not within_lanes(run)


@given(any_vehicle(), STEPS, floats(0.5, 100.0), st.integers(0, 2**32))
@example(car(acceleration=50.0, deceleration=1.0, headway=0.5), 0.5, 30.0, 1)
@example(car(model="krauss", acceleration=50.0, headway=0.5, min_gap=0.5), 0.5, 30.0, 1)
@settings(max_examples=8)
def test_no_sequence_of_accelerations_makes_one_either(
    vehicle: VehicleType, dt: float, limit: float, seed: int
) -> None:
    """Nor does it take a vehicle beyond its engine or its brakes."""
    scenario = small_scenario(
        3, vehicle=vehicle, dt=dt, speed_limit=limit, density=1500.0, demand_time=40.0, drain=60.0,
        arm_length=60.0,
    )  # fmt: skip
    controller = Pedals(controller_named("dim"), seed)
    run = simulate(scenario, controller, seed=2, on_collision="record", record="all")
    assert not within_lanes(run)
    most = vehicle.acceleration * (1.0 + 1e-6)
    assert -vehicle.max_deceleration <= run.trace["a"].min(initial=0.0)
    assert run.trace["a"].max(initial=0.0) <= most


def test_the_cruise_control_of_the_published_runs_does_not_either() -> None:
    """Others may: it keeps no distance to stop in."""
    scenario = as_run(small_scenario(3, density=350.0, demand_time=60.0, drain=180.0))
    run = simulate(scenario, controller_named("fixed-time"), seed=1, on_collision="record")
    assert run.columns.arrived.all()
    assert run.collisions == ()


@given(floats(0.0, 100.0), floats(0.0, 200.0), floats(0.5, 1000.0), STEPS)
def test_what_can_stop_still_can_after_the_step(v: float, more: float, b: float, dt: float) -> None:
    """And never has to brake harder than the brakes can."""
    distance = v * v / (2.0 * b) + more
    a = stop_within(v, distance, b, dt)
    assert a >= -b * (1.0 + 1e-6)
    driven, v_new = ballistic(0.0, v, a, dt)
    left = distance - driven
    assert v_new * v_new / (2.0 * b) <= left + 1e-6 * (1.0 + distance)
