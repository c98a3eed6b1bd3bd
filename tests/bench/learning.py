"""Steps of environments per CPU second, beside those of sumo-rl and highway-env if installed.

A step of a batch decides on the vehicles that ask for the right of way, and sees those that have
it: each is counted as one agent. A step of a signal is 5 s of traffic at one junction, as in
sumo-rl, whose steps of SUMO are 1 s long, and ours 0.1 s. highway-env has one agent, at an
intersection; a step is 1 s.
"""

from __future__ import annotations

import importlib.util
import os
import time
from pathlib import Path
from typing import Any

from scenarios import four_way

SCENARIO = four_way(350, horizon=3600.0, warmup=0.0)


def decisions(seed: int, junctions: int = 64, steps: int = 300) -> float:
    """Of all that may go, on 4 arms with 350 veh/h/lane: vehicles decided on per second."""
    from scenarios.environments import RightOfWayBatch

    batch = RightOfWayBatch(junctions, SCENARIO)
    _, info = batch.reset(seed=seed * junctions)
    for _ in range(100):  # until the roads have filled
        *_, info = batch.step(info["action_mask"])
    count, start = 0, time.process_time()
    for _ in range(steps):
        seen, *_, info = batch.step(info["action_mask"])
        count += int(seen[:, :32:8].sum() + seen[:, 32:].sum())
    return count / (time.process_time() - start)


def signal_steps(seed: int, steps: int = 700) -> float:
    """Random phases."""
    from scenarios.environments import SignalEnv

    return _steps(SignalEnv(SCENARIO), seed, steps)


def highway_steps(seed: int, steps: int = 60) -> float | None:
    """None where highway-env is not installed."""
    if importlib.util.find_spec("highway_env") is None:
        return None
    import gymnasium
    import highway_env  # noqa: F401

    return _steps(gymnasium.make("intersection-v2"), seed, steps)


def sumo_rl_steps(seed: int, steps: int = 700) -> float | None:
    """Its own single intersection, hosted by libsumo; None where sumo-rl is not installed."""
    if None in map(importlib.util.find_spec, ("sumo_rl", "libsumo", "sumo")):
        return None
    import sumo

    os.environ |= {"LIBSUMO_AS_TRACI": "1", "SUMO_HOME": sumo.SUMO_HOME}
    import sumo_rl

    nets = Path(sumo_rl.__file__).parent / "nets" / "single-intersection"
    env = sumo_rl.SumoEnvironment(
        net_file=str(nets / "single-intersection.net.xml"),
        route_file=str(nets / "single-intersection.rou.xml"),
        num_seconds=5 * steps, single_agent=True, sumo_seed=seed,
    )  # fmt: skip
    found = _steps(env, seed, steps)
    env.close()
    return found


def _steps(env: Any, seed: int, steps: int) -> float:
    env.action_space.seed(seed)
    env.reset(seed=seed)
    spent = 0.0
    for _ in range(steps):
        action, start = env.action_space.sample(), time.process_time()
        *_, terminated, truncated, _ = env.step(action)
        spent += time.process_time() - start
        if terminated or truncated:
            env.reset()
    return steps / spent
