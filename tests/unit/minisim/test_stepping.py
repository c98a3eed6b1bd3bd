"""A run driven from outside: commands act at once, events stop it, forks go on alike."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from dim import Dim
from dim.agent import GATES
from minisim.control import Brake, External, Go, Hold, Open, Plan, Unregulated, Wake
from minisim.errors import CollisionError, InputError
from minisim.simulation import Simulation, simulate
from scenarios import FAIR, four_way
from scenarios.scenario import Scenario
from tests.builders import Scripted, digest, replayed

LONE = replayed(four_way(profile=FAIR), (0.0, 0, 2), horizon=120.0)
CROSSING = replayed(four_way(profile=FAIR), (0.0, 0, 2), (0.0, 1, 2), horizon=120.0)


def busy(seconds: float = 100.0) -> Scenario:
    return dataclasses.replace(four_way(density=300), horizon=seconds, warmup=20.0)


@pytest.mark.parametrize("warmup", [0.0, 20.0])
@pytest.mark.parametrize("gate", GATES)
def test_dim_from_outside_gives_the_trips_of_dim(gate: str, warmup: float) -> None:
    scenario, dim = dataclasses.replace(busy(), warmup=warmup), Dim(gate=gate)
    session = dim.start(scenario.site(3))
    sim = Simulation(scenario, External(session.plan), seed=3, record="all")
    while sim.run_until("wake"):
        sim.command(*session.decide(sim.view()))
    run, own = sim.result(), simulate(scenario, dim, 3, record="all")
    assert len(run.trips) > 20
    assert digest(run) == digest(own)
    assert run.exchange == own.exchange


def test_a_command_acts_from_its_time_on() -> None:
    """Braking set at t changes the speed at t + dt, as if a session woken at t had set it."""
    sim = Simulation(LONE, Unregulated(), record="all")
    sim.advance(5.0)
    sim.command(Brake(0, 3.0))
    trace = sim.run().trace
    before, after = (trace["v"][trace["tick"] == round(5.0 / sim.site.dt) + k] for k in (0, 1))
    assert (after - before) / sim.site.dt == pytest.approx(-3.0)


def test_outside_and_inside_are_the_same() -> None:
    plan = Plan(lanes_open=True, period=5.0)
    inside = Scripted(lambda view: [Brake(0, 3.0)] if view.time == 5.0 else [], plan)
    own = simulate(LONE, inside, record="all")
    sim = Simulation(LONE, External(plan), record="all")
    sim.advance(5.0)
    sim.command(Brake(0, 3.0))
    assert digest(sim.run()) == digest(own)


def test_commands_before_the_first_step_count() -> None:
    sim = Simulation(LONE, External())
    sim.command(Open(0))
    assert sim.run().columns.arrived.all()
    assert not Simulation(LONE, External()).run().columns.arrived.any()


def test_one_wrong_command_keeps_all_back() -> None:
    sim = Simulation(LONE, External())
    with pytest.raises(InputError, match="vehicle must be"):
        sim.command(Go(0), Go(99))
    assert not sim.run().columns.arrived.any()
    with pytest.raises(InputError, match="is not after"):
        sim.command(Wake(1.0))


def test_run_until_a_time_and_the_end() -> None:
    sim = Simulation(LONE, External())
    assert sim.run_until(10.0)
    assert sim.time == pytest.approx(10.0)
    assert not sim.run_until(1000.0)
    assert sim.finished
    assert not sim.run_until("wake")


def test_run_until_a_wake_that_was_asked_for() -> None:
    sim = Simulation(LONE, External())
    assert sim.run_until("wake")
    assert sim.time == 0.0
    sim.command(Wake(7.0))
    assert sim.run_until("wake")
    assert sim.time == pytest.approx(7.0)
    assert not sim.run_until("wake")


def test_run_until_a_mark_is_passed() -> None:
    sim = Simulation(LONE, External(Plan(marks=(40.0,), sight=60.0)))
    sim.run_until("wake")
    assert sim.run_until("wake")
    (seen,) = sim.view().vehicles
    assert 40.0 - seen.speed * sim.site.dt <= seen.distance <= 40.0


def test_run_until_a_function_says_so() -> None:
    sim = Simulation(LONE, External(Plan(sight=60.0)))
    assert sim.run_until(lambda it: any(v.distance < 30.0 for v in it.view().vehicles))
    (seen,) = sim.view().vehicles
    assert 30.0 - seen.speed * sim.site.dt <= seen.distance < 30.0


def test_run_until_a_collision() -> None:
    sim = Simulation(CROSSING, Unregulated(), on_collision="record")
    assert sim.run_until("collision")
    assert len(sim.collisions) == 1
    assert sim.collisions[0].time == pytest.approx(sim.time)
    assert not sim.run_until("collision")


def test_an_event_that_is_none() -> None:
    with pytest.raises(InputError, match="did you mean 'wake'"):
        Simulation(LONE, External()).run_until("wakes")


def test_a_replay_gives_the_commands_again() -> None:
    """Without them, all would be held and nothing would collide."""
    sim = Simulation(CROSSING, External())
    sim.advance(1.0)
    sim.command(Go(0), Go(1))
    with pytest.raises(CollisionError) as caught:
        sim.run()
    assert caught.value.replay().collisions == caught.value.collisions


def test_a_fork_keeps_its_commands_to_itself() -> None:
    sim = Simulation(LONE, External())
    sim.advance(2.0)
    fork = sim.fork()
    fork.command(Go(0))
    assert fork.run().columns.arrived.all()
    assert not sim.run().columns.arrived.any()
    assert fork.site is sim.site


def test_a_fork_of_a_fork_and_a_hold() -> None:
    sim = Simulation(LONE, Unregulated())
    sim.command(Go(0))
    second = sim.fork().fork()
    second.command(Hold(0))
    assert digest(second.run()) == digest(sim.run())  # the lane is open all the same


def test_a_plan_is_asked_for() -> None:
    with pytest.raises(InputError, match="plan"):
        External(plan=3)  # type: ignore[arg-type]


def test_the_recording_is_shared_by_no_fork() -> None:
    sim = Simulation(busy(), Dim(), seed=2, record="all")
    sim.advance(30.0)
    fork = sim.fork()
    fork.advance(40.0)
    assert np.array_equal(sim.fork().run().trace, fork.run().trace)
