"""Messages fail in SUMO as they do in minisim: the link is the controller's, not the host's."""

from __future__ import annotations

import pytest

from baselines import V2IC, Reservation, Slots
from minisim.channel import Channel
from minisim.control import Controller
from minisim.link import Linked
from minisim.testing import small_scenario
from scenarios import four_way
from tests.sumo.conftest import both

CHANNELS = [
    Channel(latency=0.1, jitter=0.4, loss=0.3),
    pytest.param(Channel(latency=0.3), marks=pytest.mark.slow),
    pytest.param(Channel(loss=0.8), marks=pytest.mark.slow),
]


CONTROLLERS = [V2IC(), Reservation(), pytest.param(Slots(), marks=pytest.mark.slow)]


@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda it: it.name)
@pytest.mark.parametrize("channel", CHANNELS, ids=str)
def test_none_collides_and_all_are_served(controller: Controller, channel: Channel) -> None:
    scenario = small_scenario(4, density=350.0, demand_time=60.0, drain=400.0)
    for run in both(scenario, Linked(controller, channel), 1):  # a collision raises
        assert run.columns.arrived.all()
        assert run.counts["states_sent"] > 100


def test_no_vehicle_goes_without_a_message() -> None:
    scenario = four_way(250, profile="fair", horizon=90.0)
    for run in both(scenario, Linked(Reservation(), Channel(loss=1.0)), 1):
        assert not run.columns.arrived.any()
