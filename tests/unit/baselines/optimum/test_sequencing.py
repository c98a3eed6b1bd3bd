import math
from collections.abc import Iterator

import numpy as np
import pytest

from baselines.optimum import sequencing
from baselines.optimum.sequencing import WAKE_STEP, Queue, Rules, scheduled, timed
from baselines.prediction import Floats
from minisim.errors import InputError

#: No exit lane costs anything.
NO_WAKE = np.zeros((2, 2))


def random_case(rng: np.random.Generator) -> tuple[Queue, Rules]:
    """One to eight vehicles of two kinds a lane on two to four lanes, and rules."""
    lanes = int(rng.integers(2, 5))
    lane = np.sort(rng.integers(0, lanes, rng.integers(1, 9)))
    kind = 2 * lane + rng.integers(0, 2, len(lane))
    ready = rng.uniform(0.0, rng.choice([2.0, 10.0]), len(lane))
    ready = ready[np.lexsort((ready, lane))]
    between = rng.uniform(0.1, 3.0, (2 * lanes, 2 * lanes))
    meets = rng.random(between.shape) < rng.uniform(0.2, 1.0)
    own = np.arange(2 * lanes) // 2
    between[~(meets & meets.T | (own[:, None] == own))] = -np.inf
    exits = rng.integers(0, 3, 2 * lanes)
    joins = (between > -np.inf) & (exits[:, None] == exits)
    past, rest = rng.uniform(0.0, 2.0, 2 * lanes), rng.uniform(5.0, 9.0, 2 * lanes)
    behind = WAKE_STEP * np.arange(60)
    wake = rng.uniform(0.0, 1.0, (2 * lanes, 1)) * np.exp(-behind) * (behind < 2.9)
    return Queue(ready, kind, np.searchsorted(lane, np.arange(lanes + 1))), Rules(
        between, joins, past, rest, wake - wake[:, -1:]
    )


def lost(rules: Rules, kind: int, behind: float) -> float:
    return float(np.interp(behind, WAKE_STEP * np.arange(60), rules.wake[kind]) - min(behind, 0.0))


def brute_force(queue: Queue, rules: Rules) -> float:
    """The least sum of arrivals of all orders that keep each lane's, by trying every one."""

    def sums(at: list[int], passed: list[tuple[int, float]]) -> Iterator[float]:
        over = True
        for lane, i in enumerate(at):
            if i < queue.begins[lane + 1]:
                over = False
                kind = int(queue.kind[i])
                time = max([queue.ready[i], *(t + rules.between[k, kind] for k, t in passed)])
                ahead = [t + rules.past[k] for k, t in passed if rules.joins[k, kind]]
                loss = lost(rules, kind, time + rules.past[kind] - max(ahead)) if ahead else 0.0
                further = [it + (k == lane) for k, it in enumerate(at)]
                rest = min(sums(further, [*passed, (kind, time)]))
                yield time + rules.rest[kind] + loss + rest
        if over:
            yield 0.0

    return min(sums(queue.begins[:-1].tolist(), []))


@pytest.mark.parametrize("seed", range(20))
def test_it_equals_brute_force_over_all_orders(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(12):
        queue, rules = random_case(rng)
        made = scheduled(queue, rules)
        least = brute_force(queue, rules)
        assert made.arrival.sum() == pytest.approx(least, abs=1e-4)  # but for ties
        assert least - 1e-3 < made.bound <= least + 1e-9
        assert sorted(made.order.tolist()) == list(range(len(queue.kind)))
        time, arrival = timed(queue, rules, made.order)
        assert (time == made.time).all()
        assert (arrival == made.arrival).all()


def plain(between: Floats) -> Rules:
    """Rules without exit lanes, where vehicles arrive at their marks."""
    return Rules(between, between < -1.0, np.zeros(2), np.zeros(2), NO_WAKE)


def test_without_conflicts_none_waits() -> None:
    queue = Queue(np.array([3.0, 5.0, 4.0]), np.array([0, 0, 1]), np.array([0, 2, 3]))
    made = scheduled(queue, plain(np.full((2, 2), -math.inf)))
    assert made.time.tolist() == [3.0, 5.0, 4.0]


def test_a_vehicle_may_wait_so_that_two_need_not() -> None:
    """One is ready a little before two of another lane: it is better if both go first."""
    queue = Queue(np.array([0.0, 0.1, 0.2]), np.array([0, 1, 1]), np.array([0, 1, 3]))
    made = scheduled(queue, plain(np.array([[1.0, 9.0], [1.0, 1.0]])))
    assert made.order.tolist() == [1, 2, 0]
    assert made.time.tolist() == [2.1, 0.1, 1.1]


@pytest.mark.parametrize("most", [1, 3])
def test_the_bound_holds_with_few_states_too(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """Merged states come as early as each of them: looser, but for every order."""
    cases = [random_case(np.random.default_rng(seed)) for seed in range(200)]
    best = [scheduled(*case) for case in cases]
    monkeypatch.setattr(sequencing, "MOST", most)
    merged = [scheduled(*case).bound for case in cases]
    cut = [scheduled(*case, bounded=False) for case in cases]
    looser = 0
    for exact, bound, rough in zip(best, merged, cut, strict=True):
        assert bound <= exact.bound + 1e-9
        assert rough.widest <= most
        assert rough.arrival.sum() >= exact.arrival.sum() - 1e-4  # but for ties
        looser += bound < exact.bound - 1e-3
    assert 0 < looser < 100
    monkeypatch.setattr(sequencing, "LARGEST", 2)
    with pytest.raises(InputError, match="would take too long: more than 2 states at once"):
        list(map(scheduled, *zip(*cases, strict=True)))


def test_without_vehicles_there_is_nothing_to_order() -> None:
    empty = np.empty(0)
    made = scheduled(Queue(empty, empty.astype(int), np.zeros(3, int)), plain(np.zeros((2, 2))))
    assert (made.bound, len(made.order)) == (0.0, 0)
