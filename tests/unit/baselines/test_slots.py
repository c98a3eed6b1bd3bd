"""FAIR and BATCH against what Tachet et al. (2016) say of them."""

from __future__ import annotations

import math
from statistics import fmean

import numpy as np
import pytest

import minisim
from baselines import FixedTime, Slots
from baselines.flows import Waiting, plan
from baselines.slots import Batch
from minisim.control import Controller
from scenarios import four_way
from tests.builders import queued

#: Two flows of which vehicles are 1 s apart, and 2 s from one to the other.
BETWEEN = np.array([[1.0, 2.0], [2.0, 1.0]])


def order(size: int, *vehicles: tuple[int, float], free: float = -math.inf) -> list[int]:
    """In which order vehicles (flow, when they come) are served, numbered from 1."""
    waiting = [Waiting(i, k, i, t, t) for i, (k, t) in enumerate(vehicles, 1)]
    lines = [[it for it in waiting if it.kind == flow] for flow in (0, 1)]
    served = plan(lines, Batch(size), BETWEEN, np.full(2, free), -math.inf)
    return [it.vehicle.id for it in served]


#: Their figure 2, with times of our own: the first vehicle waits until 4 s, when the next three
#: have come, and the third is of its flow.
FIGURE_2 = ((0, 1.0), (1, 2.0), (0, 3.0), (1, 3.5), (0, 9.0))


def test_a_batch_is_reshuffled_as_in_their_figure() -> None:
    """'Since Vehicle 1 and Vehicle 3 belong to the same flow, Vehicle 3 is given access (…) before
    Vehicle 2. The process is then repeated using Vehicle 5'."""
    assert order(10, *FIGURE_2, free=4.0) == [1, 3, 2, 4, 5]


def test_a_vehicle_that_comes_after_the_slot_of_the_first_is_not_of_its_batch() -> None:
    assert order(10, *FIGURE_2, free=2.5) == [1, 2, 3, 4, 5]


def test_no_batch_is_larger_than_its_bound() -> None:
    assert order(2, *FIGURE_2, free=4.0) == [1, 2, 3, 4, 5]
    assert order(3, *FIGURE_2, free=4.0) == [1, 3, 2, 4, 5]


def test_a_batch_of_one_is_fair() -> None:
    """'When the number of requests in a batch is 1, BATCH is equivalent to FAIR.'"""
    assert order(1, *FIGURE_2, free=100.0) == [1, 2, 3, 4, 5]


@pytest.mark.parametrize(("lanes", "load"), [(2, 0.3), (2, 0.6), (4, 0.6)])
def test_the_delay_of_fair_is_that_of_pollaczek_and_khinchine(lanes: int, load: float) -> None:
    """A vehicle is of the flow of the one before it by chance, so FAIR is an M/G/1 queue.

    Over four seeds our mean is 3 % off, as its standard deviation.
    """
    services = [1.0] + [2.0] * (lanes - 1)
    rate = load / fmean(services)
    formula = rate * fmean(it * it for it in services) / (2.0 * (1.0 - load))
    assert fmean(queued(Batch(1), lanes, rate, 1.0, range(4))) == pytest.approx(formula, rel=0.1)


@pytest.mark.parametrize("size", [1, 2, 4, 8, 16])
def test_the_capacity_of_batches(size: int) -> None:
    """Two flows that queue: the next batch is of the other flow by half, and most have both."""
    flow = np.random.default_rng(0).integers(2, size=3000).tolist()
    lines = [[Waiting(i, k, i, 0.0, 0.0) for i, k in enumerate(flow) if k == it] for it in (0, 1)]
    served = list(plan(lines, Batch(size), BETWEEN, np.full(2, -math.inf), -math.inf))[:2500]
    headway = (served[-1].time - served[0].time) / (len(served) - 1)
    assert headway == pytest.approx(1.0 + (1.5 - 2.0 ** (1 - size)) / size, rel=0.02)


def test_batches_lose_less_time_than_first_come_first_served_and_both_less_than_a_signal() -> None:
    """At a high demand, as theirs do. On our four arms, 5.4 and 6.9 s."""
    scenario = four_way(350, profile="fair", horizon=500.0)
    rivals: tuple[Controller, ...] = (Slots(), Slots(batch=1), FixedTime())
    batch, fair, signal = (
        minisim.simulate(scenario, it, 1).summary()["time_loss_s"] for it in rivals
    )
    assert batch < fair < signal / 3.0


def test_batches_serve_more_vehicles_than_a_signal() -> None:
    """They say that slots have twice the capacity of signals, for two flows and their distances.

    On our four arms, with the gaps of the IDM, it is 1.4 times as large: 2108 and 1508 veh/h over
    ten minutes, and 2738 with `buffer=0.5`.
    """
    scenario = four_way(900, profile="fair", horizon=240.0)
    rivals: tuple[Controller, ...] = (Slots(), FixedTime())
    slots, signal = (minisim.simulate(scenario, it, 1).columns.arrived.sum() for it in rivals)
    assert slots > 1.3 * signal
