"""The step in C is that of the rules, to the last bit; what it takes is for `make bench`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from dim import Dim
from minisim.engine.state import DRIVING, Records
from minisim.fleet import Fleet
from minisim.simulation import Simulation
from minisim.vehicle import VehicleType
from scenarios import five_way
from tests.bench import scalar
from tests.unit.minisim.engine import oracle

TYPES = (
    VehicleType(name="car"),
    VehicleType(length=10.0, deceleration=2.0, exponent=2.0, max_deceleration=6.0, name="heavy"),
)


def test_the_step_in_c_is_that_of_the_rules() -> None:
    if scalar.library() is None:
        pytest.skip("there is no C compiler")
    scenario = replace(
        five_way(400, arm_length=150.0, lane_width=4.0, horizon=120.0),
        fleet=Fleet(TYPES, ((0.7,), (0.3,))),
    )
    simulation = Simulation(scenario, Dim(), seed=1)
    layout, law = simulation._layout, simulation._law
    draws = np.random.default_rng(1)
    moved = halted = turning = 0
    for second in range(40, 120, 2):
        simulation.advance(second)
        simulation.result()  # brings the rows up to date
        rows, lanes = simulation._vehicles.copy(), simulation._lanes.copy()
        driving = rows["status"] == DRIVING
        disturb(rows, lanes, driving & (draws.random(len(rows)) < 0.2), draws)
        in_c = rows.copy()
        overlap = oracle.accelerate(rows, lanes, layout, law)
        oracle.move(rows, lanes, layout, law)
        assert scalar.call("take", in_c, lanes, layout, law, 1) == overlap
        assert in_c.tobytes() == rows.tobytes()
        moved += int((rows["v"][driving] > 0.0).sum())
        halted += int((rows["v"][driving] == 0.0).sum())
        turning += int((rows["s"][driving] > law.entry).sum())
    assert min(moved, halted, turning) > 50


def disturb(
    rows: Records, lanes: Records, some: npt.NDArray[np.bool_], draws: np.random.Generator
) -> None:
    """Move some vehicles on, faster, and command them, so that every rule applies to some."""
    count = int(some.sum())
    rows["s"][some] += draws.uniform(0.0, 9.0, count)
    rows["v"][some] += draws.uniform(0.0, 9.0, count)
    rows["advice"][some] = draws.uniform(0.0, 14.0, count)
    rows["told"][some] = draws.choice([np.inf, np.inf, -9.0, -1.0, 0.0, 1.0, 9.0], count)
    rows["brake"][some] = draws.choice([-5.0, np.inf], count)
    rows["go"][some] = draws.integers(0, 2, count)
    lanes["open"] = draws.random(len(lanes)) < 0.2
