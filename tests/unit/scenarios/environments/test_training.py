"""Linear policies: what they wish, the controller that they make, and their training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minisim import simulate
from minisim.errors import InputError
from scenarios import four_way, three_way
from scenarios.scenario import Scenario
from tests.builders import digest

pytest.importorskip("gymnasium", reason="needs the extra gym")
pytest.importorskip("cma", reason="needs the extra gym")

from scenarios.environments import RightOfWayBatch, RightOfWayEnv
from scenarios.environments.linear import Learnt, size, wishes
from scenarios.environments.training import (
    FILE,
    Training,
    begin,
    costs,
    read_weights,
    train,
)


def busy(seconds: float = 120.0, make: Any = four_way) -> Scenario:
    scenario: Scenario = make(density=450.0, horizon=seconds, warmup=0.0)
    return scenario


def one_by_one(weights: Any, seen: Any, conflicts: Any, arms: int) -> list[int]:
    """`wishes`, the slow way, for one observation."""
    width, turns = arms + 4, arms - 1
    own = [seen[lane * width :][:width].tolist() for lane in range(arms)]
    settled = [seen[arms * width + lane * turns :][:turns].tolist() for lane in range(arms)]
    scores = {}
    for lane in range(arms):
        if own[lane][0]:
            order = [(lane + k) % arms for k in range(arms)]
            x = [it for k in order for it in own[k]] + [it for k in order for it in settled[k]]
            scores[lane] = sum(a * b for a, b in zip(weights, [*x, 1.0], strict=True))
    taken = {p for p in range(arms * turns) if settled[p // turns][p % turns]}
    chosen = []
    for lane in sorted(scores, key=lambda k: (-scores[k], k)):
        p = lane * turns + own[lane][4:-1].index(1.0)
        if scores[lane] > 0.0 and not any(conflicts[p, q] for q in taken):
            chosen.append(p)
            taken.add(p)
    return sorted(chosen)


@pytest.mark.parametrize("make", [three_way, four_way])
def test_wishes_are_as_defined(make: Any) -> None:
    scenario = busy(150.0, make)
    env, random = RightOfWayEnv(scenario), np.random.default_rng(0)
    site = env.world.site
    n = site.intersection.n
    seen, _ = env.reset(seed=1)
    found = 0
    for _ in range(149):
        weights = random.normal(size=size(n))
        action = wishes([weights], [seen], site.conflicts)[0]
        wanted = one_by_one(weights, seen, site.conflicts, n)
        assert np.flatnonzero(action).tolist() == wanted
        found += len(wanted)
        seen, *_ = env.step(action if random.random() < 0.3 else env.action_space.sample())
    assert found > 30


def test_the_controller_does_what_the_policy_does_in_the_environment() -> None:
    weights = begin(4) + np.random.default_rng(3).normal(scale=0.5, size=size(4))
    env = RightOfWayEnv(busy())
    seen, _ = env.reset(seed=8)
    over = False
    while not over:
        action = wishes([weights], [seen], env.world.site.conflicts)[0]
        seen, _, _, over, _ = env.step(action)
    run = env.world.sim.result()
    own = simulate(busy(), Learnt(tuple(weights.tolist())), run.seed)
    assert run.columns.arrived.sum() > 8
    assert digest(run) == digest(own)


def test_costs_are_the_time_per_vehicle_of_single_environments() -> None:
    scenario, seeds = busy(90.0), np.array([3, 4])
    policies = np.array([begin(4), -begin(4)])
    found = costs(RightOfWayBatch(4, scenario), policies, seeds)
    wanted = []
    for weights in policies:
        each = []
        for seed in seeds.tolist():
            env = RightOfWayEnv(scenario)
            seen, _ = env.reset(seed=seed)
            total, over = 0.0, False
            while not over:
                action = wishes([weights], [seen], env.world.site.conflicts)[0]
                seen, reward, terminated, truncated, _ = env.step(action)
                total, over = total - reward, terminated or truncated
            each.append(total / len(env.world.sim.arrivals))
        wanted.append(np.mean(each))
    assert found == pytest.approx(wanted)
    assert found[0] < found[1], "to wish for nothing is worse"


def test_training_is_repeatable_and_kept(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    small = {"generations": 3, "population": 4, "runs": 2}
    made = train(busy(60.0), **small, told=lambda *it: told.append(it))
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert made == train(busy(60.0), **small) != train(busy(60.0), **small, seed=1)
    assert all(it.best <= it.middle for it in made.generations)
    made.save(tmp_path / "w.json")
    assert read_weights(tmp_path / "w.json") == made.weights


def test_what_holds_no_weights_is_told(tmp_path: Path) -> None:
    (tmp_path / "w.json").write_text("{}")
    with pytest.raises(InputError, match="holds no weights"):
        read_weights(tmp_path / "w.json")
    with pytest.raises(InputError, match="learnt needs 45 weights for 4 arms, got 3"):
        simulate(busy(), Learnt((1.0, 2.0, 3.0)))
    with pytest.raises(InputError, match="generations must be an integer of at least 1"):
        train(busy(), generations=0)


def test_the_weights_that_come_along_are_of_a_training() -> None:
    weights = read_weights(FILE)
    assert len(weights) == size(4)
    assert isinstance(Training(weights, ()), tuple)
