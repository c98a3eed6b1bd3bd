"""What the engine takes: hours, vehicle-steps, minutes and junctions."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import minisim.simulation
from minisim.junction.geometry import MIN_ANGLE
from scenarios import four_way
from scenarios.controllers import controller_named
from scenarios.library import from_bearings


def hour(seed: int, controller: str = "dim", horizon: float = 3600.0) -> float:
    """CPU seconds of a simulated hour of 350 veh/h/lane on 4 arms, with its summary."""
    scenario = four_way(350, profile="fair", horizon=horizon)
    start = time.process_time()
    minisim.simulate(scenario, controller_named(controller, "fair"), seed=seed).summary()
    return (time.process_time() - start) * 3600.0 / horizon


def vehicle_step(seed: int, density: float, horizon: float = 3600.0) -> float:
    """CPU nanoseconds of a vehicle-step in the kernel alone."""
    scenario = four_way(density, profile="fair", horizon=horizon)
    with _kernel_timed() as calls:
        run = minisim.simulate(scenario, controller_named("dim", "fair"), seed=seed)
    return sum(calls) / (run.columns.travel_time.sum() / run.site.dt) * 1e9


@contextmanager
def _kernel_timed() -> Iterator[list[float]]:
    calls: list[float] = []
    direct = minisim.simulation.direct

    def timed(*arguments: Any) -> Callable[..., Any]:
        step = direct(*arguments)

        def stepping(*world: Any) -> Any:
            start = time.process_time()
            reached = step(*world)
            calls.append(time.process_time() - start)
            return reached

        return stepping

    minisim.simulation.direct = timed
    try:
        yield calls
    finally:
        minisim.simulation.direct = direct


def minutes(seed: int, count: int = 200) -> float:
    """One-minute runs per CPU second, of 350 veh/h/lane on 4 arms."""
    scenario, controller = four_way(350, profile="fair", horizon=60.0), controller_named("dim")
    start = time.process_time()
    for k in range(count):
        minisim.simulate(scenario, controller, seed=1000 * seed + k)
    return count / (time.process_time() - start)


def junction(seed: int, arms: int) -> float:
    """CPU milliseconds until a junction that was never seen has made its first step."""
    draws = np.random.default_rng(seed).uniform(size=1 + arms)
    turned, *spare = np.floor(64.0 * draws * [MIN_ANGLE, *[360.0 - MIN_ANGLE * arms] * arms]) / 64.0
    bearings = (turned + np.sort(spare) + MIN_ANGLE * np.arange(arms)).tolist()
    start = time.process_time()
    scenario = from_bearings(bearings, 350, profile="fair", horizon=0.1)
    minisim.simulate(scenario, controller_named("dim", "fair"), seed=seed)
    return (time.process_time() - start) * 1e3
