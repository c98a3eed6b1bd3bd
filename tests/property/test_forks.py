"""Forks at random moments of random runs go on as the run does, under every controller."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dim import Dim, Mixed, Monitor, NoisyPerception
from minisim.channel import Channel
from minisim.control import Controller
from minisim.link import Linked
from minisim.simulation import Simulation
from scenarios import Scenario, four_way
from scenarios.controllers import CONTROLLERS, controller_named
from scenarios.strategies import controllers, scenarios
from tests.builders import digest

NOISY = NoisyPerception(intent_error=0.15, kind="symmetric")
LOSSY = Channel(latency=0.1, jitter=0.2, loss=0.3)

#: Sessions with random streams or memories of their own, and messages that fail.
RANDOM: tuple[Controller, ...] = (
    Mixed(share=0.4),
    Mixed(Dim(perception=NOISY, priorities="waiting"), 0.4),
    Dim(perception=NOISY, monitor=Monitor()),
    Dim(priorities="waiting"),
    Dim(priorities="rotating"),
    Linked(controller_named("v2ic"), LOSSY),
    Linked(controller_named("reservation"), LOSSY),
    Linked(controller_named("slots"), LOSSY),
)
FORKED = [name for name in CONTROLLERS if not name.endswith("as-run")]


def forks_go_on_alike(scenario: Scenario, controller: Controller, seed: int, time: float) -> None:
    sim = Simulation(scenario, controller, seed=seed, on_collision="record")
    sim.advance(time)
    fork, other = sim.fork(), sim.fork()
    other.run()  # whatever one does is nothing to the others
    fork.advance(time + 7.0)
    kept = digest(fork.fork().run())
    assert digest(sim.run()) == kept == digest(fork.run()) == digest(other.result())
    whole = Simulation(scenario, controller, seed=seed, on_collision="record").run()
    assert digest(whole) == kept


@settings(max_examples=5)
@given(scenarios(), controllers(), st.integers(0, 2**32 - 1), st.floats(0.0, 40.0))
def test_random_runs(scenario: Scenario, controller: Controller, seed: int, time: float) -> None:
    short = dataclasses.replace(scenario, horizon=60.0, warmup=0.0)
    forks_go_on_alike(short, controller, seed, time)


@pytest.mark.parametrize("name", FORKED)
def test_every_controller(name: str) -> None:
    scenario = four_way(density=300, horizon=60.0, warmup=0.0)
    forks_go_on_alike(scenario, controller_named(name), 5, 20.0)


@pytest.mark.parametrize("controller", RANDOM, ids=lambda it: it.name)
def test_streams_memories_and_messages(controller: Controller) -> None:
    forks_go_on_alike(four_way(density=350, horizon=90.0, warmup=0.0), controller, 5, 20.0)
