"""The fixed-time signal on any junction, with any timing: nobody collides, everybody is served."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

import minisim
from baselines import FixedTime
from minisim.results.safety import encroachments
from scenarios.scenario import Scenario
from scenarios.strategies import emptying, floats


@st.composite
def signals(draw: st.DrawFn) -> FixedTime:
    """Webster's greens or any from 2 s on, with any amber and all-red, none included."""
    return FixedTime(
        greens=draw(st.none() | floats(2.0, 20.0)),
        amber=draw(st.sampled_from([0.0, 2.0, 3.03])),
        all_red=draw(st.sampled_from([0.0, 1.0])),
    )


@given(emptying(), signals())
def test_nobody_collides_and_everybody_is_served(scenario: Scenario, signal: FixedTime) -> None:
    run = minisim.simulate(scenario, signal, record="junction", on_collision="record")

    assert run.collisions == ()
    assert run.trips["arrival_s"].notna().all()
    # A head waits until its lane's way is clear, so no two bodies are ever in one conflict area.
    pets = encroachments(run.trajectories, run.site)["pet_s"]
    assert (pets > 0.0).all()
