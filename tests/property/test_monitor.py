"""With exact perception a monitor changes nothing: not one byte of any run."""

from __future__ import annotations

import dataclasses

from hypothesis import given, settings
from hypothesis import strategies as st

import minisim
from dim import Dim, Monitor
from scenarios import Scenario
from scenarios.strategies import scenarios
from tests.builders import digest

seeds = st.integers(0, 2**32 - 1)

dims = st.builds(
    Dim,
    gate=st.sampled_from(("clear", "harmonious")),
    order=st.sampled_from(("size", "lanes")),
    priorities=st.sampled_from((None, "inflow", "rotating", "waiting")),
)


@given(scenarios(max_arms=5, horizon=60.0), dims, seeds)
@settings(max_examples=25)
def test_a_monitored_run_is_the_unmonitored_one(scenario: Scenario, dim: Dim, seed: int) -> None:
    bare = minisim.simulate(scenario, dim, seed=seed, record="junction")
    monitored = dataclasses.replace(dim, monitor=Monitor())
    run = minisim.simulate(scenario, monitored, seed=seed, record="junction")
    assert digest(run) == digest(bare)
