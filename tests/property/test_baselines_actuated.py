"""Signals with a rule and the all-way stop on any junction, with any parameters."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

import minisim
from baselines import Actuated, Adaptive, AllWayStop, LongestQueue
from minisim.control import Controller
from minisim.results.safety import encroachments
from scenarios.scenario import Scenario
from scenarios.strategies import emptying, floats
from tests.builders import share


@st.composite
def adaptives(draw: st.DrawFn) -> Adaptive:
    """Any detector, short and long greens, any amber, none included."""
    min_green = draw(floats(0.5, 10.0))
    return Adaptive(
        detector_range=draw(floats(5.0, 200.0)),
        min_time_loss=draw(floats(0.0, 5.0)),
        min_green=min_green,
        max_green=min_green + draw(floats(0.0, 40.0)),
        extend_max_green=draw(st.booleans()),
        amber=draw(st.sampled_from([0.0, 0.04, 2.0, 3.03])),
    )


@st.composite
def gap_signals(draw: st.DrawFn) -> Actuated:
    """Loops from just before the line to beyond short roads, any gap, any amber."""
    min_green = draw(floats(0.5, 10.0))
    return Actuated(
        max_gap=draw(floats(0.0, 10.0)),
        detector_gap=draw(floats(0.1, 20.0)),
        passing_time=draw(floats(0.1, 5.0)),
        min_green=min_green,
        max_green=min_green + draw(floats(0.0, 40.0)),
        amber=draw(st.sampled_from([0.0, 0.04, 2.0, 3.03])),
    )


@st.composite
def queue_signals(draw: st.DrawFn) -> LongestQueue:
    """Any interval and detector, any amber."""
    return LongestQueue(
        interval=draw(floats(0.5, 15.0)),
        detector_range=draw(floats(5.0, 200.0)),
        amber=draw(st.sampled_from([0.0, 0.04, 2.0, 3.03])),
    )


def all_way_stops() -> st.SearchStrategy[AllWayStop]:
    """From no reaction time to a slow driver."""
    return st.builds(AllWayStop, reaction=st.just(0.0) | floats(0.0, 3.0))


def check(scenario: Scenario, controller: Controller) -> None:
    """Nobody collides, everybody is served, and no two bodies share a conflict area."""
    run = minisim.simulate(scenario, controller, record="junction", on_collision="record")

    assert run.collisions == ()
    assert run.trips["arrival_s"].notna().all()
    assert (encroachments(run.trajectories, run.site)["pet_s"] > 0.0).all()


@share(0.5)
@given(emptying(), adaptives())
def test_adaptive_signals_collide_nobody_and_serve_everybody(
    scenario: Scenario, signal: Adaptive
) -> None:
    check(scenario, signal)


@share(0.5)
@given(emptying(), gap_signals())
def test_actuated_signals_collide_nobody_and_serve_everybody(
    scenario: Scenario, signal: Actuated
) -> None:
    check(scenario, signal)


@share(0.5)
@given(emptying(), queue_signals())
def test_queue_signals_collide_nobody_and_serve_everybody(
    scenario: Scenario, signal: LongestQueue
) -> None:
    check(scenario, signal)


@share(0.5)
@given(emptying(), all_way_stops())
def test_all_way_stops_collide_nobody_and_serve_everybody(
    scenario: Scenario, junction: AllWayStop
) -> None:
    check(scenario, junction)
