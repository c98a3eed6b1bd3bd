"""Signals that detect vehicles: a vehicle that stood in a green leaves in it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from baselines import Actuated, Adaptive
from minisim.vehicle import VehicleType
from scenarios.strategies import floats
from tests.builders import Greens, queues, share

SIGNALS = {"actuated": Actuated, "adaptive": Adaptive}


@st.composite
def queueing_vehicles(draw: st.DrawFn) -> VehicleType:
    """Of any length that fits four arms, with any usual gap."""
    return VehicleType(
        length=draw(floats(0.5, 8.0)),
        min_gap=draw(floats(0.5, 5.0)),
        headway=draw(floats(0.5, 1.5)),
        acceleration=draw(floats(1.0, 4.0)),
        model=draw(st.sampled_from(["idm", "iidm", "krauss"])),
    )


@pytest.mark.parametrize("name", SIGNALS)
@share(0.3)
@given(vehicle=queueing_vehicles(), limit=floats(3.0, 20.0), shortest=floats(0.5, 10.0))
def test_a_standing_queue_is_served_in_one_green(
    name: str, vehicle: VehicleType, limit: float, shortest: float
) -> None:
    watched = Greens(SIGNALS[name](min_green=shortest, max_green=600.0))
    run = minisim.simulate(queues(vehicle, limit), watched)
    assert run.summary()["unfinished"] == 0
    assert watched.left
    assert not any(watched.left)
