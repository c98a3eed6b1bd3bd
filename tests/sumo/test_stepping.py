"""A run in SUMO driven from outside: as in minisim (`tests/unit/minisim/test_stepping.py`)."""

from __future__ import annotations

import dataclasses
import os
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from dim import Dim, Mixed, NoisyPerception
from minisim import simulation as ours
from minisim.channel import Channel
from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Command,
    Controller,
    External,
    Go,
    Open,
    Plan,
    Unregulated,
    Wake,
)
from minisim.errors import CollisionError, ControllerError, SumoError
from minisim.link import Linked
from minisim.sumo import Simulation, simulate
from scenarios import FAIR, Scenario, four_way
from scenarios.controllers import CONTROLLERS, controller_named
from tests.builders import Scripted, digest, replayed
from tests.contract.test_docs import blocks
from tests.sumo.test_cc import hosted

LONE = replayed(four_way(profile=FAIR), (0.0, 0, 2), horizon=120.0)
CROSSING = replayed(four_way(profile=FAIR), (0.0, 0, 2), (0.0, 1, 2), horizon=60.0)
CRUISING = hosted(replayed(four_way(profile="as_run"), (0.0, 0, 2), horizon=60.0))
NOISY = NoisyPerception(intent_error=0.15, kind="symmetric")

linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux can fork SUMO")


def busy(seconds: float = 60.0, profile: str = "paper") -> Scenario:
    return dataclasses.replace(four_way(density=500, profile=profile), horizon=seconds, warmup=20.0)


def test_dim_from_outside_gives_the_trips_of_dim() -> None:
    scenario, dim = busy(), Dim()
    session = dim.start(scenario.site(3))
    with Simulation(scenario, External(session.plan), seed=3, record="all") as sim:
        while sim.run_until("wake"):
            sim.command(*session.decide(sim.view()))
        run = sim.result()
    own = simulate(scenario, dim, 3, record="all")
    assert len(run.trips) > 10
    assert digest(run) == digest(own)
    assert run.exchange == own.exchange


@pytest.mark.parametrize("host", [ours.Simulation, Simulation])
@pytest.mark.parametrize(
    ("scenario", "command", "a"),
    [
        (LONE, Brake(0, 3.0), -3.0),
        (LONE, Accelerate(0, -2.0), -2.0),
        (CRUISING, Brake(0, 3.0), -3.0),
        (CRUISING, Accelerate(0, -2.0), -2.0 * 0.01 / (0.5 + 0.01)),  # its engine lags by 0.5 s
    ],
    ids=["law, brake", "law, accelerate", "cruise, brake", "cruise, accelerate"],
)
def test_a_command_acts_from_its_time_on(
    host: type[Simulation], scenario: Scenario, command: Command, a: float
) -> None:
    """What is set at t changes the speed at t + dt: no step is lost, in either host."""
    with host(scenario, Unregulated(), record="all") as sim:
        sim.advance(20.0)
        sim.command(command)
        trace = sim.run().trace
    before, after = (trace["v"][trace["tick"] == round(20.0 / sim.site.dt) + k] for k in (0, 1))
    assert (after - before) / sim.site.dt == pytest.approx(a, abs=1e-4)


@pytest.mark.parametrize("slow", [Advise, Brake])
def test_who_slows_down_by_command_minds_those_that_have_left(slow: Any) -> None:
    """Vehicle 0 crawls behind the junction; 1 is told at each step to slow down by a little."""
    scenario = replayed(four_way(profile=FAIR), (0.0, 0, 2), (3.0, 0, 2), horizon=60.0)
    gaps = []
    for host in (ours.Simulation, Simulation):
        plan = Plan(sight=250.0, lanes_open=True, reach=30.0)
        with host(scenario, External(plan), record="all") as sim:
            while not sim.finished:
                seen = {it.id: it for it in sim.view().vehicles}
                if 0 in seen and seen[0].distance < -10.0:
                    sim.command(Advise(0, 0.5))
                if 1 in seen and seen[1].distance < 5.0:
                    mild = max(seen[1].speed - 0.05, 0.0) if slow is Advise else 0.1
                    sim.command(slow(1, mild))
                sim.advance(sim.time + 0.1)
            way = sim.result().trajectories.pivot(index="time_s", columns="vehicle", values="s_m")
        gaps.append(float((way[0] - way[1]).min()) - scenario.profile.vehicle.length)
    assert min(gaps) > 1.0
    assert gaps[0] == pytest.approx(gaps[1], abs=0.5)


def test_outside_and_inside_are_the_same() -> None:
    plan = Plan(lanes_open=True, period=5.0)
    inside = Scripted(lambda view: [Advise(0, 5.0)] if view.time == 5.0 else [], plan)
    own = simulate(LONE, inside, record="all")
    with Simulation(LONE, External(plan), record="all") as sim:
        sim.advance(5.0)
        sim.command(Advise(0, 5.0))
        assert digest(sim.run()) == digest(own)


def test_commands_before_the_first_step_count() -> None:
    with Simulation(LONE, External()) as sim:
        sim.command(Open(0))
        assert sim.run().columns.arrived.all()


def test_events_stop_it_where_they_stop_minisim() -> None:
    """A time, a wake that was asked for, a mark, a function, and the end."""
    plan = Plan(marks=(40.0,), sight=60.0)
    stops = []
    for host in (ours.Simulation, Simulation):
        times = []
        with host(LONE, External(plan)) as sim:
            for event in (3.0, "wake", lambda it: it.time > 6.0, "wake", 1e6, "wake"):
                times.append((sim.run_until(event), round(sim.time, 1)))
                if sim.time == pytest.approx(3.0):
                    sim.command(Wake(5.0))
            assert [it.id for it in sim.view().vehicles] == [0], "it waits at its line to the end"
            stops.append((times, sim.finished))
    assert stops[0][0][:3] == stops[1][0][:3] == [(True, 3.0), (True, 5.0), (True, 6.1)]
    assert stops[0] == stops[1]


def test_run_until_a_collision_that_is_recorded() -> None:
    with Simulation(CROSSING, Unregulated(), on_collision="record") as sim:
        assert sim.run_until("collision")
        assert sim.collisions[0].time == pytest.approx(sim.time)
        assert not sim.run_until("collision")
        assert sim.finished


def test_a_replay_gives_the_commands_again() -> None:
    """Without them, all would be held and nothing would collide."""
    with Simulation(CROSSING, External()) as sim:
        sim.advance(1.0)
        sim.command(Go(0), Go(1))
        with pytest.raises(CollisionError) as caught:
            sim.run()
    replay = caught.value.replay
    assert replay is not None
    assert replay().collisions == caught.value.collisions


def test_why_makes_the_run_again_in_sumo() -> None:
    """With the commands from outside: vehicle 1 waits for 0 only because of the `Go`."""
    with Simulation(CROSSING, External()) as sim:
        sim.advance(30.0)
        sim.command(Go(0))
        run = sim.run()
    asked = simulate(CROSSING, controller_named("all-way-stop"), record="all", explain=True)
    plain = simulate(CROSSING, controller_named("all-way-stop"))
    assert run.why(1, 55.0).sentence
    for vehicle in (0, 1):
        for at in (5.0, 40.0, 43.7, 50.0, 58.0):
            assert plain.why(vehicle, at) == asked.why(vehicle, at)


@pytest.mark.parametrize("seconds", [0.0, 30.0])
def test_a_result_ends_the_run_there(seconds: float) -> None:
    with Simulation(busy(), Dim(), seed=2) as sim:
        sim.advance(seconds)
        run = sim.result()
        assert sim.finished
        assert sim.result() is run
    whole = simulate(busy(), Dim(), 2)
    assert run.columns.end == seconds
    arrived = whole.columns.arrival < seconds
    assert (run.columns.arrival[arrived] == whole.columns.arrival[arrived]).all()
    assert run.columns.arrived.sum() == arrived.sum()


FORKED: list[Controller] = [
    Dim(), Mixed(Dim(perception=NOISY, priorities="waiting"), 0.4), controller_named("slots"),
    Linked(controller_named("reservation"), Channel(latency=0.1, jitter=0.2, loss=0.3)),
]  # fmt: skip


def forks_go_on_alike(scenario: Scenario, controller: Controller, time: float) -> None:
    with Simulation(scenario, controller, seed=5, record="all") as sim:
        sim.advance(time)
        with sim.fork() as fork, sim.fork() as other:
            other.command(*(Advise(vehicle, 3.0) for vehicle in range(10)))
            changed = digest(other.run())
            fork.advance(time + 7.0)
            with fork.fork() as second:
                kept = digest(second.run())
            assert digest(fork.run()) == kept
        assert digest(sim.run()) == kept
    assert digest(simulate(scenario, controller, 5, record="all")) == kept
    assert changed != kept or time > 60.0


@linux
@pytest.mark.parametrize("controller", FORKED, ids=lambda it: it.name)
def test_forks_go_on_alike(controller: Controller) -> None:
    """Also with random streams, memories, messages under way, and braking under way."""
    forks_go_on_alike(busy(60.0), controller, 20.0)


#: Without the one under which vehicles collide, which ends a run.
FORKABLE = [it for it in CONTROLLERS if not it.endswith("as-run") and it != "unregulated"]


@linux
@pytest.mark.slow
@pytest.mark.parametrize("time", [0.0, 7.3, 61.0, 119.9])
@pytest.mark.parametrize("name", FORKABLE)
def test_every_controller_forks_at_any_moment(name: str, time: float) -> None:
    forks_go_on_alike(busy(120.0), controller_named(name), time)


@linux
def test_the_cruise_control_forks() -> None:
    forks_go_on_alike(hosted(busy(60.0, profile="as_run")), Dim(), 20.0)


@linux
def test_a_fork_outlives_its_origin_and_leaves_nothing(tmp_path: Path) -> None:
    """And it writes none of the files that the origin is to keep."""
    kept = tmp_path / "kept"
    with Simulation(busy(), Dim(), seed=2, keep_files=kept, fcd=tmp_path / "fcd.xml") as sim:
        sim.advance(20.0)
        fork = sim.fork()
        sim.run()
    files = {path.name: path.read_bytes() for path in kept.iterdir()}
    folder, process = fork._folder.path, fork._process
    fork.run()
    fork.close()
    assert not folder.exists()
    assert process is not None
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == files
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fcd.xml", "kept"]


@linux
def test_a_fork_of_a_run_that_is_over() -> None:
    with Simulation(LONE, Unregulated()) as sim:
        run = sim.run()
        with sim.fork() as fork:
            assert fork.finished
            assert digest(fork.result()) == digest(run)
    with Simulation(LONE, Unregulated()) as sim:
        sim.advance(1e6)  # its result has not been asked for
        with sim.fork() as fork:
            assert digest(fork.result()) == digest(run)


def test_elsewhere_than_on_linux_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    with Simulation(LONE, Unregulated()) as sim:
        sim.advance(1.0)
        monkeypatch.setattr(sys, "platform", "win32")
        with pytest.raises(SumoError, match="can be forked on Linux only"):
            sim.fork()


def gone(pid: int) -> bool:
    """Whether a process ends within two seconds."""
    for _ in range(200):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.01)
    return False


@linux
def test_one_that_is_dropped_takes_its_process_with_it(started: None) -> None:
    sim = Simulation(LONE, Unregulated())
    sim.advance(1.0)
    assert sim._process is not None
    assert sim._process._child is not None
    pid, folder = sim._process._child.pid, sim._folder.path
    assert folder.exists()
    with pytest.warns(ResourceWarning):
        del sim
    assert gone(pid)
    assert not folder.exists()


def test_a_session_that_fails_is_told_as_elsewhere() -> None:
    with (
        Simulation(LONE, Scripted(lambda view: [Brake(-1, view.time)], Plan(period=1.0))) as sim,
        pytest.raises(ControllerError, match=r"at 0\.0 s"),
    ):
        sim.run()


@linux
def test_the_example_in_the_docs_runs(capsys: pytest.CaptureFixture[str]) -> None:
    made: dict[str, object] = {}
    for block in blocks("docs/howto/stepping.md", "python")[:2]:
        exec(compile(block, "docs/howto/stepping.md", "exec"), made)
    assert int(capsys.readouterr().out) > 0
