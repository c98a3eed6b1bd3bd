"""What the engine takes: hours, vehicle-steps, minutes and junctions, and an IDM in C."""

from __future__ import annotations

import atexit
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import minisim.simulation
from minisim.junction.geometry import MIN_ANGLE
from scenarios import four_way
from scenarios.controllers import controller_named
from scenarios.library import from_bearings

#: Vehicles on a ring road in plain C: IDM, ballistic steps, waiting and lost time. No junction,
#: arrivals, marks, limits or fleets, so it does less than the kernel. Prints ns per vehicle-step.
RING = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define N 200
typedef struct { double s, v, v0, a, b, T, s0, length, acc, waited, lost; } Vehicle;
static Vehicle cars[N];

int main(int argc, char **argv) {
    const long steps = atol(argv[1]);
    const double dt = 0.1, ring = 20.0 * N;
    for (int i = 0; i < N; i++)
        cars[i] = (Vehicle){ring - 20.0 * i, 5.0 + i % 7, 14.0, 1.0, 1.5, 1.0, 2.0, 5.0};
    const clock_t start = clock();
    for (long step = 0; step < steps; step++) {
        for (int i = 0; i < N; i++) {
            Vehicle *me = &cars[i], *lead = &cars[i ? i - 1 : N - 1];
            const double gap = lead->s + (i ? 0.0 : ring) - lead->length - me->s;
            const double closing = me->v * (me->v - lead->v) / (2.0 * sqrt(me->a * me->b));
            const double z = (me->s0 + fmax(0.0, me->v * me->T + closing)) / gap;
            const double r = me->v / me->v0;
            me->acc = fmax(me->a * (1.0 - r * r * r * r), -me->b) - me->a * z * z;
        }
        for (int i = 0; i < N; i++) {
            Vehicle *me = &cars[i];
            const double v = me->v + me->acc * dt;
            me->s += v < 0.0 ? -0.5 * me->v * me->v / me->acc : 0.5 * (me->v + v) * dt;
            me->v = v < 0.0 ? 0.0 : v;
            me->waited += me->v <= 0.1;
            me->lost += me->v < me->v0 ? 1.0 - me->v / me->v0 : 0.0;
        }
    }
    const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    double sum = 0.0;  /* so that no loop is left out */
    for (int i = 0; i < N; i++) sum += cars[i].s + cars[i].waited + cars[i].lost;
    printf("%.6f %g\\n", seconds / (double)(steps * N) * 1e9, sum);
}
"""


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


def ring_step(steps: int = 100_000) -> float | None:
    """CPU nanoseconds of a vehicle-step in C; None without a compiler."""
    program = _ring()
    if program is None:
        return None
    done = subprocess.run([program, str(steps)], capture_output=True, text=True, check=True)
    return float(done.stdout.split()[0])


@cache
def _ring() -> Path | None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder)
    (folder / "ring.c").write_text(RING)
    command = [compiler, "-O2", "-o", "ring", "ring.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return folder / "ring"


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
