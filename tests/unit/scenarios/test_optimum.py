from dataclasses import replace

import numpy as np
import pytest

from baselines import AllWayStop, Reservation
from minisim.arrivals import Arrivals
from minisim.control import Unregulated
from minisim.errors import InputError
from minisim.simulation import simulate
from minisim.vehicle import VehicleType
from scenarios.library import four_way
from scenarios.optimum import (
    ABOVE,
    LEAST,
    Clairvoyant,
    above,
    compared,
    drained,
    mean_delay,
    optimum,
)
from scenarios.profiles import AS_RUN, FAIR
from scenarios.recipe import Recipe
from tests.builders import replayed

SCENARIO = four_way(profile=FAIR, density=200.0, horizon=120.0)


def test_the_schedule_is_driven_without_collision_a_little_above_the_bound() -> None:
    least = optimum(SCENARIO, 1)
    schedule, reservation = compared(SCENARIO, [Reservation()], 1, least)
    assert 0.0 < least.bound <= least.planned <= schedule["delay_s"]
    assert least.bound <= reservation["delay_s"]
    assert schedule["error"] == ""
    assert schedule["above_percent"] == pytest.approx(
        100.0 * (schedule["delay_s"] / least.bound - 1.0)
    )


def test_one_vehicle_straight_on_loses_no_more_than_it_must() -> None:
    least = optimum(replayed(SCENARIO, (1.02, 0, 2), horizon=100.0))
    assert least.bound == pytest.approx(0.08)  # it enters at the next step


def test_without_vehicles_there_is_no_delay() -> None:
    none = four_way(profile=FAIR, density=0.0, horizon=60.0)
    least = optimum(none)
    assert (least.vehicles, least.bound, least.planned) == (0, 0.0, 0.0)
    assert [row["delay_s"] for row in compared(none, [], 0, least)] == [0.0]


def test_the_delay_is_the_control_delay_up_to_a_step_per_trip() -> None:
    run = simulate(drained(SCENARIO), Reservation(), 1)
    mean = run.summary(["control_delay_s"])["control_delay_s"]
    assert mean_delay(run) == pytest.approx(mean, abs=SCENARIO.profile.dt)


def test_a_clairvoyant_controller_keeps_the_schedule() -> None:
    made = simulate(drained(SCENARIO), Clairvoyant(SCENARIO), 1)
    driven = simulate(drained(SCENARIO), optimum(SCENARIO, 1).schedule, 1)
    assert mean_delay(made) == mean_delay(driven)


def test_the_metrics_are_those_of_the_optimum_wherever_they_are_named() -> None:
    names = [f"scenarios.optimum:{name}" for name in ("DELAY", "LEAST", "ABOVE")]
    recipe = Recipe(drained(SCENARIO), Reservation(), 1, metrics=names)
    run, least = recipe.run(), optimum(SCENARIO, 1)
    told = run.summary(recipe.metrics)
    assert told["delay_s"] == pytest.approx(mean_delay(run))
    assert told["least_delay_s"] == least.bound
    assert told["above_least_percent"] == pytest.approx(above(told["delay_s"], least.bound))
    assert told["delay_s_max"] >= told["delay_s_p50"] > 0.0


def test_runs_that_leave_vehicles_behind_have_no_distance_from_the_least_delay() -> None:
    told = simulate(SCENARIO, Reservation(), 1).summary([ABOVE, LEAST])
    assert told["above_least_percent"] is None
    assert told["least_delay_s"] == optimum(SCENARIO, 1).bound
    warm = replace(drained(SCENARIO), warmup=10.0)
    with pytest.raises(InputError, match="leave out the warm-up"):
        simulate(warm, Reservation(), 1).summary([LEAST])


def test_vehicles_without_a_bound_have_no_least_delay() -> None:
    unlike = replace(FAIR, vehicle=VehicleType(speed_deviation=0.1))
    told = simulate(four_way(50.0, profile=unlike, horizon=20.0), AllWayStop()).summary([LEAST])
    assert told["least_delay_s"] is None


def test_a_collision_is_said_in_the_row() -> None:
    crossing = replayed(SCENARIO, (1.0, 0, 2), (1.0, 1, 2), horizon=100.0)
    _, row = compared(crossing, [Unregulated()], 0, optimum(crossing))
    assert row["delay_s"] is None
    assert "touched" in row["error"]


@pytest.mark.parametrize(
    ("scenario", "why"),
    [
        (four_way(profile=AS_RUN), "model 'cc'"),
        (four_way(profile=replace(FAIR, vehicle=VehicleType(speed_deviation=0.1))), "alike"),
        (
            four_way(profile=replace(FAIR, vehicle=VehicleType(model="krauss", sumo="1.18"))),
            "sumo='1.18'",
        ),
        (
            replace(
                SCENARIO,
                recorded=Arrivals(
                    np.array([1.0]), np.array([0]), np.array([1]), speed_factor=np.array([1.1])
                ),
            ),
            "speed factors",
        ),
    ],
)
def test_vehicles_without_a_bound_are_refused(scenario, why: str) -> None:
    with pytest.raises(InputError, match=why):
        optimum(scenario)
