"""The packed loops give the rows of the readable rules, to the last bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from baselines import V2IC, FixedTime
from dim import Dim, Monitor
from minisim.control import Controller
from minisim.engine.state import DRIVING
from minisim.fleet import Fleet
from minisim.simulation import Simulation
from minisim.vehicle import VehicleType
from scenarios import Scenario, five_way, four_way, three_way
from scenarios.profiles import FAIR
from tests.builders import Pedals
from tests.unit.minisim.engine import oracle

QUICK = VehicleType(acceleration=2.0, length=2.0, width=0.8, max_deceleration=8.0, name="quick")
HEAVY = VehicleType(length=10.0, deceleration=2.0, exponent=2.0, max_deceleration=6.0, name="heavy")


def driven_by(**changes: object) -> Scenario:
    profile = replace(FAIR, name="changed", vehicle=replace(FAIR.vehicle, **changes))  # type: ignore[arg-type]
    return four_way(400, profile=profile, arm_length=150.0, lane_width=4.0)


CASES = {
    "dim": (five_way(300, arm_length=200.0), Dim(gate="harmonious")),
    "fleet": (
        replace(
            three_way(350, arm_length=200.0, lane_width=4.0),
            fleet=Fleet((QUICK, HEAVY), ((0.6,), (0.4,))),
        ),
        Pedals(Dim(monitor=Monitor())),
    ),
    "drivers": (driven_by(speed_deviation=0.2), FixedTime()),
    "iidm": (driven_by(model="iidm"), V2IC()),
    "krauss": (driven_by(model="krauss"), Pedals(Dim())),
}


@pytest.mark.parametrize(("scenario", "controller"), CASES.values(), ids=CASES)
def test_a_step_is_that_of_the_rules(scenario: Scenario, controller: Controller) -> None:
    simulation = Simulation(replace(scenario, horizon=200.0), controller, seed=1)
    compared = 0
    for second in range(30, 150):
        simulation.advance(second * 1.0)
        simulation.result()  # brings the rows up to date
        layout, law = simulation._layout, simulation._law
        rows, lanes = simulation._vehicles.copy(), simulation._lanes.copy()
        before = rows["status"] == DRIVING
        oracle.accelerate(rows, lanes, layout, law)
        oracle.move(rows, lanes, layout, law)
        simulation.advance(second + simulation.site.dt)
        simulation.result()
        for name in ("s", "v", "a", "section", "waiting_ticks", "lost_ticks"):
            np.testing.assert_array_equal(rows[name][before], simulation._vehicles[name][before])
        compared += int(before.sum())
    assert compared > 500
