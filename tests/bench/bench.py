"""How fast minisim is, and by how much it beats SUMO and C, measured in one run.

    python -m tests.bench.bench [--runs 5] [--append FILE] [--quick]

Medians of several runs, with the fastest and the slowest. CPU seconds, but for two workers and the
first run, which are wall time and mean something only on an otherwise idle machine.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tests import ROOT
from tests.bench import engine, learning, rivals, scalar, starting

#: veh/h/lane, and the nanoseconds wanted for a vehicle-step; there our kernel is compared with C.
DENSITIES = {150: None, 250: None, 350: -16.0, 500: None, 650: None, 800: -10.0}


class Figure(NamedTuple):
    """What was measured, run by run, and what is wanted: at least, or if negative at most."""

    key: str
    label: str
    values: Sequence[float]
    unit: str
    wanted: float | None = None

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    def over(self, other: Figure, key: str, label: str, wanted: float | None = None) -> Figure:
        """This figure in units of another's median."""
        ratios = [value / other.median for value in self.values]
        return Figure(key, label, ratios, "×", wanted)

    def __str__(self) -> str:
        spread = f"{min(self.values):.4g} … {max(self.values):.4g}"
        line = f"{self.label:<44}{self.median:>9.4g} {self.unit:<5}{spread:>20}"
        if self.wanted is None:
            return line
        met = self.median >= self.wanted if self.wanted > 0 else self.median <= -self.wanted
        bound = f"{'≥' if self.wanted > 0 else '≤'} {abs(self.wanted):g}"
        return f"{line}   {bound:>7}: {'yes' if met else 'NO'}"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=5, help="of which each figure is the median")
    parser.add_argument("--append", type=Path, metavar="FILE", help="add a line of JSON to it")
    parser.add_argument("--quick", action="store_true", help="a taste, without what is slow")
    options = parser.parse_args(arguments)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(f"{_processor()}, {os.cpu_count()} cores, load {load:.1f}, commit {_commit()}")
    made = []
    for figure in _taste() if options.quick else _figures(options.runs):
        print(figure, flush=True)
        made.append(figure)
    if options.append is not None:
        line = {
            "date": datetime.now(UTC).isoformat(timespec="seconds"), "commit": _commit(),
            "processor": _processor(), "load": load, **{it.key: it.median for it in made},
        }  # fmt: skip
        with options.append.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


def _figures(runs: int) -> Iterator[Figure]:
    def measured(of: Callable[[int], float]) -> list[float]:
        return [of(seed) for seed in range(runs + 1)][1:]  # the first one warms up

    hour = Figure("dim_hour_s", "DIM, a simulated hour", measured(engine.hour), "s")
    signal = Figure("fixed_time_hour_s", "fixed-time signal, a simulated hour",
                    measured(lambda seed: engine.hour(seed, "fixed-time")), "s")  # fmt: skip
    yield from (hour, signal)
    yield Figure("harmonious_hour_s", "harmonious gate, a simulated hour",
                 measured(lambda seed: engine.hour(seed, "dim:gate=harmonious")), "s")  # fmt: skip
    yield from _rivals(runs, hour, signal)
    yield from _steps(measured)
    yield Figure("minutes_per_s", "one-minute runs", measured(engine.minutes), "/s", 1500.0)
    for arms, most in ((4, 10.0), (8, 45.0), (12, 180.0)):
        times = measured(lambda seed, arms=arms: engine.junction(seed, arms))  # type: ignore[misc]
        yield Figure(f"junction_{arms}_ms", f"new junction of {arms} arms", times, "ms", -most)
    yield from _learning(runs, measured)
    yield from _starts(runs)


def _learning(
    runs: int, measured: Callable[[Callable[[int], float]], list[float]]
) -> Iterator[Figure]:
    label = "vehicles decided on, 64 junctions at once"
    yield Figure("decisions_per_s", label, measured(learning.decisions), "/s", 100_000.0)
    label = "steps of a signal"
    ours = Figure("signal_steps_per_s", label, measured(learning.signal_steps), "/s")
    yield ours
    for key, name, of in (
        ("sumo_rl", "sumo-rl", learning.sumo_rl_steps),
        ("highway", "highway-env", learning.highway_steps),
    ):
        found = [it for seed in range(runs) if (it := of(seed)) is not None]
        if not found:
            print(f"{name} is not installed (pip install {name}): not compared")
            continue
        theirs = Figure(f"{key}_steps_per_s", f"steps of {name}", found, "/s")
        yield theirs
        yield ours.over(theirs, f"{key}_ratio", f"steps of a signal / steps of {name}")


def _taste() -> Iterator[Figure]:
    """Of every kind that needs no SUMO, no compiling and no second process."""
    hours = [engine.hour(seed, horizon=60.0) for seed in (0, 1)][1:]
    yield Figure("dim_hour_s", "DIM, a simulated hour", hours, "s")
    step = Figure("step_350_ns", "vehicle-step", [engine.vehicle_step(1, 350, 60.0)], "ns")
    yield step
    yield from _against_c(step, 350, lambda: [scalar.vehicle_step(1, 350, 60.0)])
    yield Figure("minutes_per_s", "one-minute runs", [engine.minutes(1, 2)], "/s")
    yield Figure("junction_4_ms", "new junction of 4 arms", [engine.junction(1, 4)], "ms")
    yield Figure("decisions_per_s", "vehicles decided on", [learning.decisions(1, 2, 20)], "/s")
    yield Figure("help_s", "minisim --help", [starting.command("--help")], "s")


def _rivals(runs: int, hour: Figure, signal: Figure) -> Iterator[Figure]:
    home = rivals.sumo_home()
    if home is None:
        print("SUMO is not installed (pip install 'minisim-traffic[sumo]'): not compared")
        return
    compared: list[tuple[str, str, Callable[[], float], Figure, float]] = [
        ("hosting", "libsumo hosting the same DIM / DIM", rivals.hosted_hour, hour, 200.0),
        ("all_way_stop", "libsumo, all-way stop, all read / DIM",
         lambda: rivals.stepped_hour(home, "allway_stop"), hour, 50.0),
        ("priority", "libsumo, priority, all read / DIM",
         lambda: rivals.stepped_hour(home, "priority"), hour, 50.0),
        ("bare_sumo", "sumo, fixed-time / ours", lambda: rivals.bare_hour(home), signal, 50.0),
    ]  # fmt: skip
    for key, label, of, ours, wanted in compared:
        theirs = Figure(
            f"{key}_hour_s", label.partition(" / ")[0], [of() for _ in range(runs)], "s"
        )
        yield theirs
        yield theirs.over(ours, f"{key}_ratio", label, wanted)


def _steps(measured: Callable[[Callable[[int], float]], list[float]]) -> Iterator[Figure]:
    for density, wanted in DENSITIES.items():
        times = measured(partial(engine.vehicle_step, density=density))
        label = f"vehicle-step of the kernel, {density} veh/h/lane"
        step = Figure(f"step_{density}_ns", label, times, "ns", wanted)
        yield step
        if wanted is not None:
            in_c = partial(measured, partial(scalar.vehicle_step, density=density))
            yield from _against_c(step, density, in_c)


def _against_c(step: Figure, density: int, in_c: Callable[[], list[float]]) -> Iterator[Figure]:
    if scalar.library() is None:
        print("there is no C compiler: not compared with C")
        return
    theirs = Figure(f"c_{density}_ns", f"vehicle-step in scalar C, {density}", in_c(), "ns")
    yield theirs
    yield step.over(theirs, f"c_{density}_ratio", f"ours / scalar C, {density}", -0.6)


def _starts(runs: int) -> Iterator[Figure]:
    starting.command(*starting.RUN)
    for key, label, arguments, most in (
        ("run_s", "minisim run, warm", starting.RUN, 1.0),
        ("help_s", "minisim --help", ("--help",), 0.3),
    ):
        times = [starting.command(*arguments) for _ in range(runs)]
        yield Figure(key, label, times, "s", -most)
    first, told = zip(*(starting.first_run() for _ in range(runs)), strict=True)
    yield Figure("first_run_s", "first run after installation", first, "s", -7.0)
    yield Figure("told_s", "until it says that it compiles", told, "s", -0.5)
    for count, hours, least in ((40, 4.0, 1.85), (400, 1.0, 1.95)):
        ratios = [starting.pair(count, hours) for _ in range(runs)]
        label = f"two workers, {count} runs of {hours:g} h"
        yield Figure(f"workers_{count}", label, ratios, "×", least)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.partition(":")[2].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def _commit() -> str:
    command = ["git", "describe", "--always", "--dirty"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


if __name__ == "__main__":
    main()
