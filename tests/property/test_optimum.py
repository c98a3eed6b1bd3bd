"""No controller has less delay than the bound, and the schedule can be driven."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from minisim.arrivals import Arrivals
from minisim.control import NOTHING, Advise, Brake, Command, Controller, Plan, Site, View
from minisim.simulation import simulate
from scenarios.controllers import controller_named, safe
from scenarios.library import five_way, four_way, three_way
from scenarios.optimum import drained, mean_delay, optimum
from scenarios.profiles import FAIR, PAPER
from scenarios.scenario import Scenario
from scenarios.strategies import scenarios
from tests.builders import share

JUNCTIONS = (three_way(profile=PAPER), four_way(profile=FAIR), five_way(profile=FAIR))


class Jerky:
    """Opens all lanes, and advises and brakes vehicles at random: no collision in one lane."""

    name, covers = "jerky", NOTHING
    plan = Plan(lanes_open=True, period=0.5, sight=400.0)

    def __init__(self, seed: int, often: float) -> None:
        self.random, self.often = np.random.default_rng(seed), often

    def start(self, site: Site) -> Jerky:
        return self

    def decide(self, view: View) -> Iterable[Command]:
        for it in view.vehicles:
            if self.random.random() < self.often:
                yield Advise(it.id, float(self.random.choice([np.inf, 3.0, 9.0, 12.0])))
                yield Brake(it.id, float(self.random.choice([0.0, 0.0, 1.0, 9.0])))


@st.composite
def bursts(draw: st.DrawFn, lanes: int | None = None) -> Scenario:
    """Two to nine vehicles within seconds on a junction, perhaps all of one lane."""
    junction = draw(st.sampled_from(JUNCTIONS))
    n, count = junction.intersection.n, draw(st.integers(2, 9))
    span = draw(st.sampled_from([2.0, 8.0, 20.0]))
    columns = zip(
        *draw(
            st.lists(
                st.tuples(
                    st.floats(0.0, 1.0), st.integers(0, (lanes or n) - 1), st.integers(1, n - 1)
                ),
                min_size=count,
                max_size=count,
            )
        ),
        strict=True,
    )
    time, lane, manoeuvre = map(np.array, columns)
    return replace(junction, recorded=Arrivals(span * time, lane, manoeuvre), horizon=120.0)


def check(scenario: Scenario, controller: Controller, seed: int = 0) -> None:
    least = optimum(scenario, seed)
    delay = mean_delay(simulate(drained(scenario), controller, seed))
    assert delay is not None
    assert least.bound <= delay + 1e-9


@given(bursts(), st.sampled_from(safe()))
@share(0.4)
def test_no_controller_has_less_delay_than_the_bound(scenario: Scenario, name: str) -> None:
    check(scenario, controller_named(name))


@given(bursts(lanes=1), st.integers(0, 10**6), st.sampled_from([0.0, 0.02, 0.2]))
@share(0.4)
def test_nor_has_one_lane_whatever_its_vehicles_are_told(
    scenario: Scenario, seed: int, often: float
) -> None:
    check(scenario, Jerky(seed, often))


@given(bursts())
@share(0.1)
def test_the_schedule_can_be_driven(scenario: Scenario) -> None:
    check(scenario, optimum(scenario).schedule)


@pytest.mark.slow
@given(scenarios(max_arms=5), st.sampled_from(safe()), st.integers(0, 9))
@share(0.06)
def test_the_bound_holds_on_any_junction(scenario: Scenario, name: str, seed: int) -> None:
    check(scenario, controller_named(name), seed)
    check(scenario, optimum(scenario, seed).schedule, seed)
