"""`Accelerate`: a vehicle does what it is told, within what bounds any vehicle."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from minisim.control import Accelerate, Advise, Brake, Command, External, Go, Plan
from minisim.results.run import Run
from minisim.simulation import Simulation, simulate
from minisim.vehicle import MODELS, CruiseVehicle, VehicleType
from scenarios import FAIR, four_way
from tests.builders import Scripted, digest, replayed

LAWS = {model: CruiseVehicle() if model == "cc" else VehicleType(model=model) for model in MODELS}
FOLLOWERS = [model for model in LAWS if model != "cc"]
RELEASE = Accelerate(0, math.inf)


def told(
    vehicle: VehicleType,
    script: dict[float, tuple[Command, ...]],
    *trips: tuple[float, int, int],
    is_open: bool = True,
    horizon: float = 90.0,
) -> Run:
    """Vehicles at 14 m/s, by default one that goes straight on, with commands at set times [s]."""
    profile = dataclasses.replace(FAIR, vehicle=vehicle)
    scenario = replayed(four_way(profile=profile), *(trips or ((0.0, 0, 2),)), horizon=horizon)
    sim = Simulation(scenario, External(Plan(lanes_open=is_open)), record="all")
    for time, commands in script.items():
        sim.advance(time)
        sim.command(*commands)
    return sim.run()


def at(run: Run, time: float, name: str = "v", vehicle: int = 0) -> float:
    row = run.rows["id"].tolist().index(vehicle)
    here = (run.trace["tick"] == round(time / run.site.dt)) & (run.trace["row"] == row)
    return float(run.trace[name][here][0])


@pytest.mark.parametrize("model", LAWS)
def test_it_takes_the_place_of_what_the_law_wishes(model: str) -> None:
    """-1 m/s² for 6 s, nothing for 4 s, +1 m/s² for 3 s, on a free road."""
    run = told(LAWS[model], {
        15.0: (Accelerate(0, -1.0),), 21.0: (Accelerate(0, 0.0),), 25.0: (Accelerate(0, 1.0),),
        28.0: (RELEASE,),
    })  # fmt: skip
    late = LAWS["cc"].lag if isinstance(LAWS[model], CruiseVehicle) else 0.0  # of its engine
    start = at(run, 15.0)
    assert at(run, 21.0 + 4.0 * late) == pytest.approx(start - 6.0, abs=0.1)
    assert at(run, 25.0) == pytest.approx(start - 6.0, abs=0.1)
    assert at(run, 28.0) == pytest.approx(start - 3.0, abs=0.1 + late)
    assert at(run, 40.0) > 13.0, "released, it drives by its law"


@pytest.mark.parametrize("model", FOLLOWERS)
def test_it_acts_in_the_next_step(model: str) -> None:
    run = told(LAWS[model], {20.0: (Accelerate(0, -2.0),)})
    assert at(run, 20.0, "a") == pytest.approx(0.0, abs=0.05)
    assert at(run, 20.0 + run.site.dt, "a") == pytest.approx(-2.0)


@pytest.mark.parametrize("model", LAWS)
@pytest.mark.parametrize("asked", [-1000.0, 1000.0])
def test_engine_and_brakes_bound_it(model: str, asked: float) -> None:
    vehicle = LAWS[model]
    most = (
        vehicle.engine_acceleration if isinstance(vehicle, CruiseVehicle) else vehicle.acceleration
    )
    run = told(vehicle, {15.0: (Accelerate(0, -1.0),), 22.0: (Accelerate(0, asked),)})
    a = run.trace["a"][run.trace["tick"] > round(22.0 / run.site.dt)]
    bound = -vehicle.max_deceleration if asked < 0.0 else most
    assert (a.min() if asked < 0.0 else a.max()) == pytest.approx(bound, rel=0.01)


@pytest.mark.parametrize("model", LAWS)
def test_a_standing_vehicle_stays_put(model: str) -> None:
    run = told(LAWS[model], {20.0: (Accelerate(0, -4.0),)})
    tail = run.trace[run.trace["tick"] > round(40.0 / run.site.dt)]
    assert len(tail) > 100
    assert (tail["v"] == 0.0).all()
    assert (tail["a"] == 0.0).all()
    assert len(np.unique(tail["s"])) == 1


@pytest.mark.parametrize("model", FOLLOWERS)
def test_limits_and_advice_hold(model: str) -> None:
    """Exactly: up to the limit, no further; down to a turn's; no faster than advised."""
    run = told(LAWS[model], {0.0: (Accelerate(0, 9.0),)}, (0.0, 0, 1))
    limits = (
        run.site.limit(0),
        run.site.intersection.turn_speed(run.site.intersection.paths[0].movement, 5.5),
    )
    inside = (run.trace["s"] > run.site.intersection.approach_length) & (
        run.trace["s"] < run.site.intersection.paths[0].exit
    )
    assert run.trace["v"].max() == pytest.approx(limits[0], abs=1e-9)
    assert run.trace["v"][inside].max() <= limits[1] + 0.05
    slow = told(LAWS[model], {10.0: (Accelerate(0, 1.0), Advise(0, 6.0))})
    assert at(slow, 20.0) == pytest.approx(6.0)


@pytest.mark.parametrize("model", LAWS)
def test_the_hold_line_holds_unless_it_may_go(model: str) -> None:
    scripts: tuple[dict[float, tuple[Command, ...]], ...] = (
        {15.0: (Accelerate(0, 2.0),)}, {15.0: (Accelerate(0, 2.0), Go(0))},
    )  # fmt: skip
    held, gone = (told(LAWS[model], script, is_open=False) for script in scripts)
    entry = held.site.intersection.approach_length
    assert entry - 2.0 < held.trace["s"].max() < entry
    assert gone.columns.arrived.all()


@pytest.mark.parametrize("model", LAWS)
def test_the_vehicle_ahead_bounds_it(model: str) -> None:
    """One ahead creeps; one behind is told to accelerate at any rate, and keeps behind it."""
    run = told(
        LAWS[model], {8.0: (Advise(0, 3.0), Accelerate(1, 50.0))}, (0.0, 0, 2), (4.0, 0, 2),
        horizon=60.0,
    )  # fmt: skip
    assert run.collisions == ()
    gap = at(run, 50.0, "s") - run.site.vehicle.length - at(run, 50.0, "s", 1)
    assert 1.0 < gap < 12.0
    assert at(run, 50.0, vehicle=1) == pytest.approx(3.0, abs=0.3)


def test_braking_is_the_lower_bound() -> None:
    run = told(LAWS["idm"], {20.0: (Accelerate(0, 1.0), Brake(0, 2.0))})
    assert at(run, 21.0, "a") == pytest.approx(-2.0)


@pytest.mark.parametrize("model", LAWS)
def test_none_is_as_if_there_were_no_such_command(model: str) -> None:
    assert digest(told(LAWS[model], {15.0: (RELEASE,)})) == digest(told(LAWS[model], {}))


def test_it_ends_when_the_vehicle_leaves_the_view() -> None:
    """No session sees it any more, so none could release it."""
    free = told(LAWS["idm"], {})
    assert digest(told(LAWS["idm"], {50.0: (Accelerate(0, -9.0),)})) == digest(free)
    crossed = told(LAWS["idm"], {34.0: (Accelerate(0, -1.0),)})
    assert crossed.trace["v"].min() < 13.0
    assert crossed.trace["v"][-1] > 13.8


def test_one_that_is_not_yet_on_the_road_keeps_it() -> None:
    run = told(LAWS["idm"], {0.0: (Accelerate(0, -0.5),)}, (5.0, 0, 2))
    first = run.trace[run.trace["row"] == 0]
    assert first["a"][1] == pytest.approx(-0.5)


def test_a_session_commands_it_too() -> None:
    plan = Plan(lanes_open=True, period=5.0)
    inside = Scripted(lambda it: [Accelerate(0, -1.0)] if it.time == 15.0 else [], plan)
    scenario = replayed(four_way(profile=FAIR), (0.0, 0, 2), horizon=90.0)
    outside = told(FAIR.vehicle, {15.0: (Accelerate(0, -1.0),)})
    assert digest(simulate(scenario, inside, record="all")) == digest(outside)
