"""Whole simulations over random junctions, demands and seeds: no collisions, all are served."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import minisim
from baselines import FixedTime
from dim import Dim, Monitor
from dim.agent import GATES
from dim.decision import ORDERS
from minisim.control import Controller, Plan, Unregulated
from minisim.engine.collision import near_bodies, touching
from minisim.errors import InputError
from minisim.results.run import Run
from minisim.simulation import Simulation
from scenarios import Scenario, four_way
from scenarios.controllers import CONTROLLERS, controller_named
from scenarios.profiles import Profile
from scenarios.strategies import controllers as safe_controllers
from scenarios.strategies import scenarios, uneven, vehicles
from tests.builders import Fixed, digest, drained, hardest_braking, replayed, share

#: Time to serve the arrivals of two minutes; far more than any fair share of the junction needs.
PATIENCE = 3000.0

seeds = st.integers(0, 2**32 - 1)


def served_without_collision(scenario: Scenario, controller: Controller, seed: int) -> Run:
    """Run to the last arrival; a collision raises. Checks what must hold of any run."""
    run = minisim.simulate(drained(scenario, seed, PATIENCE), controller, seed=seed, record="all")
    assert run.columns.arrived.all(), "a vehicle was never served"
    trace = run.trace[np.lexsort((run.trace["tick"], run.trace["row"]))]
    same = trace["row"][1:] == trace["row"][:-1]
    assert (trace["v"] >= 0.0).all()
    assert (np.diff(trace["s"])[same] >= 0.0).all(), "a vehicle reversed"
    assert trace["a"].min(initial=0.0) >= -run.site.vehicle.max_deceleration
    assert hardest_braking(run) <= run.site.vehicle.max_deceleration + 1e-6
    limit = run.site.speed_limit + run.site.vehicle.acceleration * run.site.dt
    assert trace["v"].max(initial=0.0) <= limit
    assert_no_overlap_in_lane(run)
    return run


def assert_no_overlap_in_lane(run: Run) -> None:
    """On the approach, every front bumper is behind the rear bumper of the vehicle ahead."""
    trace = run.trace
    manoeuvres = run.site.intersection.n - 1
    approach = trace[trace["s"] < run.site.intersection.approach_length]
    lane = run.rows["path"][approach["row"]] // manoeuvres
    order = np.lexsort((-approach["s"], lane, approach["tick"]))
    approach, lane = approach[order], lane[order]
    together = (np.diff(approach["tick"]) == 0) & (np.diff(lane) == 0)
    gaps = -np.diff(approach["s"]) - run.site.vehicle.length
    assert (gaps[together] > 0.0).all()


@share(0.15)
@given(scenarios(), st.sampled_from([*CONTROLLERS]), seeds)
def test_no_vehicle_brakes_beyond_its_brakes(scenario: Scenario, name: str, seed: int) -> None:
    """Whatever the controller does; where the brakes do not suffice, vehicles collide."""
    try:
        who = controller_named(name)
        run = minisim.simulate(scenario, who, seed, record="all", on_collision="record")
    except InputError:
        assert name.endswith("as-run")
        return
    assert hardest_braking(run) <= run.site.vehicle.max_deceleration + 1e-6


@pytest.mark.parametrize(
    ("densest", "controllers"),
    [
        (350.0, st.just(Dim())),
        (500.0, st.builds(Dim, gate=st.just("harmonious"), order=st.sampled_from(ORDERS))),
        (350.0, st.builds(FixedTime, amber=st.floats(0.0, 4.0))),
    ],
    ids=["clear", "harmonious", "fixed-time"],
)
@given(data=st.data(), seed=seeds)
@settings(max_examples=80)
def test_no_vehicle_collides_and_each_is_served(
    densest: float, controllers: st.SearchStrategy[Controller], data: st.DataObject, seed: int
) -> None:
    scenario = data.draw(scenarios(max_density=densest))
    served_without_collision(scenario, data.draw(controllers), seed)


@given(uneven(), safe_controllers(), seeds)
@settings(max_examples=60)
def test_roads_that_differ_are_as_safe(
    scenario: Scenario, controller: Controller, seed: int
) -> None:
    run = served_without_collision(scenario, controller, seed)
    taken = run.rows["path"]
    assert run.site.intersection.allowed[taken].all()
    limits = np.array([run.site.limit(p.exit_arm) for p in run.site.intersection.paths])
    ends = np.array([path.exit for path in run.site.intersection.paths])
    path = taken[run.trace["row"]]
    past = run.trace["s"] > ends[path]
    assert (run.trace["v"][past] <= limits[path][past] + 1e-6).all()


@given(scenarios(max_density=250.0), vehicles(), seeds, st.sampled_from(GATES))
@settings(max_examples=60)
def test_dim_is_safe_with_any_ordinary_vehicle(scenario, vehicle, seed: int, gate: str) -> None:
    profile = dataclasses.replace(scenario.profile, vehicle=vehicle)
    scenario = dataclasses.replace(scenario, profile=profile)
    served_without_collision(scenario, Dim(gate=gate), seed)


DIMS = st.builds(
    Dim,
    gate=st.sampled_from(GATES),
    order=st.sampled_from(ORDERS),
    priorities=st.sampled_from((None, "inflow", "rotating", "waiting")),
)


@given(scenarios(max_arms=5, horizon=60.0), DIMS, seeds)
@settings(max_examples=30)
def test_more_looks_or_a_monitor_change_no_run(scenario: Scenario, dim: Dim, seed: int) -> None:
    """Not one byte of it, with exact perception: agents decide as those that are woken."""
    bare, always, monitored = (
        digest(minisim.simulate(scenario, controller, seed, record="junction"))
        for controller in (
            dim,
            dataclasses.replace(dim, period=scenario.profile.dt),
            dataclasses.replace(dim, monitor=Monitor()),
        )
    )
    assert bare == always == monitored


@given(scenarios(max_arms=5, max_density=300.0, horizon=40.0), seeds)
@settings(max_examples=25)
def test_broad_phase_never_misses_a_touch(scenario: Scenario, seed: int) -> None:
    """Without any rule vehicles collide; pymunk, asked at every step, finds nothing more."""
    sim = Simulation(scenario, Unregulated(), seed=seed, on_collision="record")
    dt = scenario.profile.dt
    while not sim.finished:
        sim.advance(sim.time + dt)
        rows, bodies = near_bodies(sim._vehicles, sim.site)
        found = {tuple(sorted((_id(sim, rows[i]), _id(sim, rows[j])))) for i, j in touching(bodies)}
        assert found <= {c.vehicles for c in sim.collisions}


def _id(sim: Simulation, row: int) -> int:
    return int(sim._vehicles["id"][row])


@given(vehicles(), st.floats(0.0, 60.0), st.floats(5.0, 25.0), st.sampled_from([0.05, 0.1, 0.2]))
@settings(max_examples=60)
def test_platoons_stop_at_the_line(vehicle, hold_distance: float, speed: float, dt: float) -> None:
    """The front bumper 0 … 0.3 m before the line, never beyond; none touches the one ahead."""
    profile = Profile(name="random", vehicle=vehicle, speed_limit=speed, dt=dt)
    trips = [(1.5 * k, 0, 2) for k in range(6)]
    scenario = replayed(four_way(profile=profile), *trips, horizon=240.0)
    run = minisim.simulate(scenario, Fixed(Plan(hold_distance=hold_distance)), record="all")
    line = run.site.intersection.approach_length - hold_distance
    assert run.trajectories["s_m"].max() <= line
    first = run.trajectories.query("vehicle == 0")
    assert 0.0 <= line - first["s_m"].iloc[-1] <= 0.3
    assert first["speed_mps"].iloc[-1] == 0.0
    assert first["acceleration_mps2"].min() >= -vehicle.deceleration * (1 + 1e-6)
    assert_no_overlap_in_lane(run)


def test_motion_converges_with_the_step() -> None:
    """Halving dt halves the distance to the finest solution: the ballistic scheme is first order
    at the kinks of a queue (Treiber, Kanagaraj 2015)."""
    trips = [(2.0 * k, 0, 2) for k in range(5)]
    waits = {}
    for dt in (0.2, 0.1, 0.05, 0.0125):
        profile = dataclasses.replace(four_way(profile="fair").profile, dt=dt)
        scenario = replayed(four_way(profile=profile), *trips, horizon=60.0)
        run = minisim.simulate(scenario, Fixed(), record="all")
        last = run.trajectories.query("vehicle == 4").set_index("time_s")["s_m"]
        waits[dt] = last[last.index.isin([36.0, 38.0, 40.0, 44.0])].to_numpy()
    errors = [np.abs(waits[dt] - waits[0.0125]).max() for dt in (0.2, 0.1, 0.05)]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.1


# --- commit="paper": the finding -----------------------------------------------------------------

#: Two vehicles on the paper's 4-arm junction, the smallest case: the one of lane d has the right of
#: way and is just short of half the green zone when the one of lane a enters the yellow zone. The
#: decision is made again and takes the right of way from a vehicle that can no longer stop.
COUNTEREXAMPLE = ((0.0, 3, 2), (0.8, 0, 2))


def two_vehicles(commit: str, *trips: tuple[float, int, int]) -> Run:
    scenario = replayed(four_way(), *trips, horizon=120.0)
    return minisim.simulate(scenario, Dim(commit=commit), on_collision="record")


def test_the_papers_commit_rule_lets_two_vehicles_collide() -> None:
    (collision,) = two_vehicles("paper", *COUNTEREXAMPLE).collisions
    assert collision.movements == ("d2", "a2")
    assert min(collision.speeds) > 5.0, "both were going, neither had stopped"


def test_the_stoppable_rule_is_safe_in_the_same_situation() -> None:
    run = two_vehicles("stoppable", *COUNTEREXAMPLE)
    assert run.collisions == ()
    assert run.columns.arrived.all()
