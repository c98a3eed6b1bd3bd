import math
from collections.abc import Iterator

import numpy as np
import pytest

from baselines.optimum.sequencing import Queue, scheduled, timed
from baselines.prediction import Floats


def random_case(rng: np.random.Generator) -> tuple[Queue, Floats]:
    """One to eight vehicles of two kinds a lane on two to four lanes, and separations."""
    lanes = int(rng.integers(2, 5))
    lane = np.sort(rng.integers(0, lanes, rng.integers(1, 9)))
    kind = 2 * lane + rng.integers(0, 2, len(lane))
    ready = rng.uniform(0.0, rng.choice([2.0, 10.0]), len(lane))
    ready = ready[np.lexsort((ready, lane))]
    between = rng.uniform(0.1, 3.0, (2 * lanes, 2 * lanes))
    meets = rng.random(between.shape) < rng.uniform(0.2, 1.0)
    own = np.arange(2 * lanes) // 2
    between[~(meets & meets.T | (own[:, None] == own))] = -np.inf
    return Queue(ready, kind, np.searchsorted(lane, np.arange(lanes + 1))), between


def brute_force(queue: Queue, between: Floats) -> float:
    """The least lateness of all orders that keep each lane's, by trying every one."""

    def rest(at: list[int], passed: list[tuple[int, float]]) -> Iterator[float]:
        over = True
        for lane, i in enumerate(at):
            if i < queue.begins[lane + 1]:
                over = False
                kind = queue.kind[i]
                time = max([queue.ready[i], *(t + between[k, kind] for k, t in passed)])
                further = [it + (k == lane) for k, it in enumerate(at)]
                best = min(rest(further, [*passed, (int(kind), time)]))
                yield time - queue.ready[i] + best
        if over:
            yield 0.0

    return min(rest(queue.begins[:-1].tolist(), []))


@pytest.mark.parametrize("seed", range(20))
def test_it_equals_brute_force_over_all_orders(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(12):
        queue, between = random_case(rng)
        made = scheduled(queue, between)
        assert made.late == pytest.approx(brute_force(queue, between), abs=1e-9)
        assert sorted(made.order.tolist()) == list(range(len(queue.kind)))
        assert float((timed(queue, made.order, between) - queue.ready).sum()) == made.late


def test_without_conflicts_none_waits() -> None:
    queue = Queue(np.array([3.0, 5.0, 4.0]), np.array([0, 0, 1]), np.array([0, 2, 3]))
    between = np.full((2, 2), -math.inf)
    made = scheduled(queue, between)
    assert made.time.tolist() == [3.0, 5.0, 4.0]
    assert made.late == 0.0


def test_a_vehicle_may_wait_so_that_two_need_not() -> None:
    """One is ready a little before two of another lane: it is better if both go first."""
    queue = Queue(np.array([0.0, 0.1, 0.2]), np.array([0, 1, 1]), np.array([0, 1, 3]))
    between = np.array([[1.0, 9.0], [1.0, 1.0]])
    made = scheduled(queue, between)
    assert made.order.tolist() == [1, 2, 0]
    assert made.time.tolist() == [2.1, 0.1, 1.1]


def test_without_vehicles_there_is_nothing_to_order() -> None:
    empty = np.empty(0)
    made = scheduled(Queue(empty, empty.astype(int), np.zeros(3, int)), np.zeros((2, 2)))
    assert (made.late, len(made.order)) == (0.0, 0)
