"""Two worker processes against one, over a sweep: `make bench`.

Meaningful only on an otherwise idle machine with two cores or more.
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from scenarios import four_way
from scenarios.controllers import controller_named
from scenarios.recipe import Recipe
from scenarios.sweep import sweep
from scenarios.sweep.pool import workers
from scenarios.sweep.store import Store

#: Enough work that the start of the processes (a second or two) does not decide.
RUNS, HOURS = 40, 4


def main() -> None:
    """Print both wall times and their ratio."""
    todo = [
        Recipe(four_way(350, profile="fair", horizon=HOURS * 3600.0), controller_named(name), seed)
        for name in ("dim:gate=harmonious", "fixed-time")
        for seed in range(RUNS // 2)
    ]
    print(f"{RUNS} runs of {HOURS} simulated hours; load before: {os.getloadavg()[0]:.1f}")
    one, two = (_seconds(todo, count) for count in (1, 2))
    print(f"one worker {one:.1f} s, two workers {two:.1f} s: {one / two:.2f} times")


def _seconds(todo: list[Recipe], count: int) -> float:
    with tempfile.TemporaryDirectory() as folder, Store(Path(folder) / "s.db") as store:
        began = time.perf_counter()
        if count == 1:
            with workers(1) as executor:
                sweep(todo, executor, store=store)
        else:
            sweep(todo, jobs=count, store=store)
        return time.perf_counter() - began


if __name__ == "__main__":
    main()
