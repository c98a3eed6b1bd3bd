import numpy as np
import pytest

from baselines.optimum.alone import drives
from minisim.control import Unregulated
from minisim.results.trajectories import SPEED, S
from minisim.simulation import simulate
from scenarios.library import four_way
from scenarios.profiles import FAIR
from tests.builders import replayed

SCENARIO = four_way(profile=FAIR, density=100.0)


def test_straight_on_at_the_limit_takes_distance_over_speed() -> None:
    drive = drives(SCENARIO.site())[1]  # a2
    assert drive.before == pytest.approx(-drive.s[0] / 14.0)
    assert drive.loss == pytest.approx(0.0, abs=1e-9)
    assert drive.until(14.0) == pytest.approx(1.0)
    assert drive.place(2.0) == pytest.approx(28.0)


@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
def test_a_vehicle_alone_takes_little_longer(manoeuvre: int) -> None:
    """A step is lost at the beginning and the end, and less than one in a turn."""
    scenario = replayed(SCENARIO, (1.0, 0, manoeuvre), horizon=200.0)
    trip = simulate(scenario, Unregulated()).columns
    drive = drives(scenario.site())[manoeuvre - 1]
    least = drive.at_limit + drive.loss
    assert least <= trip.arrival[0] - 1.0 + 1e-9 < least + 0.25


def test_its_speed_bounds_that_of_every_run() -> None:
    scenario = replayed(SCENARIO, (1.03, 0, 1), horizon=200.0)
    path = simulate(scenario, Unregulated(), record="all").trajectories
    drive = drives(scenario.site())[0]
    past = path[S].to_numpy() - scenario.intersection.approach_length
    assert (path[SPEED].to_numpy() <= drive.speed(past) + 1e-6).all()


def test_inserted_at_rest_it_accelerates_first() -> None:
    slow, fast = (drives(SCENARIO.site(), speed)[1] for speed in (0.0, None))
    assert slow.v[0] < 1.0
    assert np.all(slow.v <= fast.v)
    assert slow.loss > 14.0 / (2.0 * 2.6)  # v/2a, at constant acceleration
