"""Messages that come late or never: no vehicles collide, whatever fails, and all are served."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

import minisim
from minisim.channel import Channel
from minisim.control import cover_of
from minisim.errors import InputError
from minisim.link import Linked, radio_of
from scenarios.controllers import CONTROLLERS, controller_named
from scenarios.profiles import FAIR
from scenarios.scenario import Scenario
from scenarios.strategies import floats, scenarios, uneven, vehicles
from tests.builders import drained, share

#: The controllers that promise that no vehicles collide, and whose messages can fail.
TALKING = [name for name, it in CONTROLLERS.items() if radio_of(it.make) and cover_of(it.make).laws]
#: Time to serve the arrivals of two minutes with half of the messages lost [s].
PATIENCE = 6000.0


def channels(worst: float) -> st.SearchStrategy[Channel]:
    """Channels that lose up to this share of the messages."""
    some = {"latency": floats(0.0, 2.0), "jitter": floats(0.0, 1.0), "loss": floats(0.0, worst)}
    return st.builds(Channel, **{name: st.just(0.0) | it for name, it in some.items()})


@st.composite
def anywhere(draw: st.DrawFn) -> Scenario:
    """Junctions of any shape, perhaps with roads that differ, or odd vehicles at other steps."""
    made = draw(scenarios() | uneven())
    if draw(st.booleans()):
        vehicle = replace(draw(vehicles()), model=draw(st.sampled_from(["idm", "iidm", "krauss"])))
        step = draw(st.sampled_from([0.1, 0.25, 0.5]))
        made = replace(made, profile=replace(FAIR, name="odd", vehicle=vehicle, dt=step))
        try:
            made.site()
        except InputError:  # such vehicles do not fit
            reject()
    return made


def linked(name: str, channel: Channel, scenario: Scenario) -> Linked:
    try:
        made = Linked(controller_named(name), channel)
        made.start(scenario.site())
    except InputError:  # it cannot serve these vehicles
        made = Linked(controller_named("v2ic"), channel)
    return made


@pytest.mark.parametrize("name", TALKING)
@share(0.3)
@given(scenario=anywhere(), channel=channels(1.0), seed=st.integers(0, 99))
def test_whatever_fails_none_collides(
    name: str, scenario: Scenario, channel: Channel, seed: int
) -> None:
    minisim.simulate(scenario, linked(name, channel, scenario), seed)  # a collision raises


@pytest.mark.parametrize("name", TALKING)
@share(0.06)
@given(scenario=scenarios(), channel=channels(0.5), seed=st.integers(0, 99))
def test_all_are_served_as_long_as_half_of_the_messages_arrive(
    name: str, scenario: Scenario, channel: Channel, seed: int
) -> None:
    waiting = drained(scenario, seed, PATIENCE)
    run = minisim.simulate(waiting, linked(name, channel, waiting), seed)
    assert run.columns.arrived.all()
