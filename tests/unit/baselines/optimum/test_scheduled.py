import numpy as np
import pytest

from baselines.optimum.planning import drivable
from baselines.optimum.scheduled import BUFFER, Scheduled, Turn
from minisim.control import Controller
from minisim.hosting import name_of
from minisim.simulation import simulate
from scenarios.library import four_way
from scenarios.profiles import FAIR
from tests.builders import replayed

SCENARIO = replayed(
    four_way(profile=FAIR, density=100.0), (1.0, 0, 2), (1.2, 1, 2), (1.4, 2, 3), horizon=200.0
)


def kept(order: tuple[int, ...]) -> Controller:
    """The schedule in which the three vehicles pass in this order, each as early as it can."""
    site, arrivals = SCENARIO.site(), SCENARIO.arrivals(0)
    index, plan = site.intersection.movements.index_of, drivable(site, BUFFER)
    turns, free = [], np.zeros(len(plan.until))
    for i in order:
        kind = int(index[arrivals.lane[i], arrivals.manoeuvre[i]])
        time = max(float(arrivals.time[i] + plan.until[kind]), float(free[kind]))
        free = np.maximum(free, time + plan.rules.between[kind])
        turns.append(Turn(int(arrivals.lane[i]), 0, kind, time))
    return Scheduled(tuple(turns))


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_vehicles_pass_in_the_order_of_the_schedule(order: tuple[int, ...]) -> None:
    trips = simulate(SCENARIO, kept(order)).columns  # a collision raises
    assert trips.arrived.all()
    for first, second in ((0, 1), (1, 2)):
        earlier = order.index(first) < order.index(second)
        assert (trips.arrival[first] < trips.arrival[second]) == earlier


def test_a_vehicle_that_has_to_wait_does_not_stop() -> None:
    assert simulate(SCENARIO, kept((1, 0, 2))).columns.waiting_time.max() == 0.0


def test_schedules_have_short_names_of_their_own() -> None:
    one, other = kept((0, 1, 2)), kept((1, 0, 2))
    assert name_of(one) != name_of(other)
    assert len(name_of(one)) == len("scheduled#01234567")


def test_a_vehicle_that_waits_says_when_it_is_to_pass_and_after_which() -> None:
    controller = kept((1, 0, 2))
    plain, run = (simulate(SCENARIO, controller, explain=asked) for asked in (False, True))
    assert (plain.columns.arrival == run.columns.arrival).all()
    waits = [it.reason for it in run.reasons or () if it.reason.kind == "after"]
    assert {(it.vehicle, it.vehicles) for it in waits} == {(0, (1,)), (2, (1, 0))}
    entered = {it.reason.vehicle: it.time for it in run.reasons or () if "cross" in it.reason.kind}
    assert all(abs((it.until or 0.0) - entered[it.vehicle]) < 2.0 for it in waits)
