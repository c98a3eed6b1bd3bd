"""Digests of many runs, to show that a change of the code changes no run.

    python -m tests.digests > before.json     # in the old checkout
    python -m tests.digests > after.json      # in the new one, on the same machine
    python -m tests.digests before.json after.json

629 runs: every controller under every profile that it serves, on 3 to 6 arms, with both gates,
monitor, noisy perception, human drivers, each car-following law, both sides of the road, skewed
arms and uneven inflow. A digest covers every byte of the trips and of the recorded trajectories.
Other processors may round differently in the last digit, so `tests/contract/test_digests.py`
keeps only trips, which are rounded to microseconds.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from dim import Monitor, NoisyPerception
from minisim.errors import MinisimError
from minisim.results.run import Run
from scenarios.controllers import controller_named
from scenarios.library import MAKERS, from_bearings, regular
from scenarios.recipe import Recipe

if TYPE_CHECKING:
    import pandas as pd

RULES = (
    "dim", "dim:gate=harmonious", "dim:order=lanes", "dim:priorities=inflow",
    "dim:priorities=rotating", "dim:priorities=waiting", "dim:order=lanes,priorities=rotating",
    "dim:order=lanes,priorities=waiting", "dim:commit=paper", "dim:monitor=on",
    "dim:perception=noisy(intent_error=0.15,kind=symmetric)",
    "dim:perception=noisy(unsignalled=(0.29,0.25))", "dim:perception=noisy(occlusion=true)",
    "fixed-time", "fixed-time:equal_greens=true", "fixed-time:facing=true", "adaptive", "actuated",
    "all-way-stop", "max-pressure", "max-pressure:facing=true", "v2ic", "reservation",
    "slots", "platoons", "unregulated",
)  # fmt: skip
AS_RUN = (
    "dim", "dim-as-run", "dim-as-run:order=size", "dim-as-run:exit_speed=14", "v2ic-as-run",
    "v2ic-as-run:approach_speed=14", "v2ic", "fixed-time", "adaptive", "actuated", "max-pressure",
    "all-way-stop",
)  # fmt: skip
SIGNALS = ("fixed-time", "adaptive", "actuated", "max-pressure", "dim", "v2ic")
SOME = (
    "dim", "dim:gate=harmonious", "fixed-time", "adaptive", "all-way-stop", "v2ic", "reservation",
    "dim:monitor=on",
)  # fmt: skip
TRIPS = (
    "demand_time_s", "depart_s", "arrival_s", "lane", "manoeuvre", "exit_lane", "waiting_time_s",
    "travel_time_s", "time_loss_s", "depart_delay_s",
)  # fmt: skip


class Case(NamedTuple):
    """One run; `extra` sets it apart from the plain one."""

    profile: str
    arms: int
    controller: str
    seed: int
    extra: tuple[tuple[str, Any], ...] = ()

    def __str__(self) -> str:
        more = "".join(f" {key}={value}" for key, value in self.extra)
        return f"{self.profile}/{self.arms}/{self.controller}/{self.seed}{more}"


def cases() -> Iterator[Case]:
    """All of them."""
    for arms, seed in itertools.product((3, 4, 5), (1, 2)):
        for profile in ("paper", "fair"):
            yield from (Case(profile, arms, name, seed) for name in RULES)
            for name, share in itertools.product(RULES[:2], (0.3, 1.0)):
                yield Case(profile, arms, name, seed, (("humans", share),))
        yield from (Case("as_run", arms, name, seed) for name in AS_RUN)
        yield from (Case("as_run_signals", arms, name, seed) for name in SIGNALS)
    differences = (
        ("model", "iidm"), ("model", "krauss"), ("side", "right"), ("split", (4.0, 3.0, 2.0, 1.0)),
        ("deviation", 0.1), ("bearings", (0.0, 80.0, 190.0, 260.0)), ("arrival", "shifted"),
    )  # fmt: skip
    for seed in (1, 2):
        for extra, name in itertools.product(differences, SOME):
            yield Case("fair", 4, name, seed, (extra,))
        manners = itertools.product(("missed", "symmetric"), *[(True, False)] * 3, RULES[:2])
        for kind, shared, lasting, monitor, name in manners:
            noise = ("noise", (0.15, kind, shared, lasting))
            yield Case("fair", 4, name, seed, (noise, ("monitor", monitor)))
        yield Case("fair", 4, "dim:order=lanes", seed, (("confidence", 0.9),))
        noise = ("noise", (0.15, "missed", True, True))
        yield Case("fair", 4, "dim", seed, (noise, ("humans", 0.3)))
    for name in ("dim", "fixed-time", "all-way-stop", "reservation", "dim:gate=harmonious"):
        yield Case("fair", 6, name, 1)


def recipe_of(case: Case) -> Recipe:
    """What is run; raises `InputError` if the controller does not serve the profile."""
    extra = dict(case.extra)
    options: dict[str, Any] = {
        "profile": case.profile,
        "horizon": 200.0 if case.profile == "as_run" else 900.0,
        **{key: extra[key] for key in ("side", "split") if key in extra},
    }
    if "arrival" in extra:
        options["model"] = extra["arrival"]
    if "bearings" in extra:
        scenario = from_bearings(extra["bearings"], 300.0, **options)
    else:
        make = MAKERS.get(case.arms) or partial(regular, case.arms)
        scenario = make(300.0, **options)
    fields = {"model": "model", "deviation": "speed_deviation"}
    if change := {field: extra[key] for key, field in fields.items() if key in extra}:
        vehicle = replace(scenario.profile.vehicle, **change)
        scenario = replace(scenario, profile=replace(scenario.profile, vehicle=vehicle))
    controller: Any = controller_named(case.controller, case.profile)
    changes: dict[str, Any] = {"monitor": Monitor()} if extra.get("monitor") else {}
    if "noise" in extra:
        error, kind, shared, lasting = extra["noise"]
        changes["perception"] = NoisyPerception(error, kind, shared=shared, persistent=lasting)
    if "confidence" in extra:
        changes["perception"] = NoisyPerception(0.15, "missed", confidence=extra["confidence"])
    controller = replace(controller, **changes) if changes else controller
    humans = extra.get("humans", 0.0)
    return Recipe(scenario, controller, case.seed, humans=humans, on_collision="record")


def run_of(case: Case) -> Run:
    """The run, with everything recorded, or only the junction if steps are short."""
    record = "junction" if case.profile == "as_run" else "all"
    return recipe_of(case).run(record=record)


def digest(frame: pd.DataFrame, columns: tuple[str, ...]) -> str:
    """Of every byte of some columns."""
    state = hashlib.sha256()
    for name in columns:
        column = frame[name]
        numbers = column.dtype.kind in "fib"
        state.update(
            column.to_numpy().tobytes() if numbers else "\n".join(map(str, column)).encode()
        )
    return state.hexdigest()[:16]


def digests(case: Case) -> tuple[str, str]:
    """The name of a case and what its run gave, or the error that refused it."""
    from minisim.results.trajectories import TRAJECTORY_COLUMNS

    try:
        run = run_of(case)
    except MinisimError as error:
        return str(case), f"error: {type(error).__name__}"
    both = digest(run.trips, TRIPS), digest(run.trajectories, TRAJECTORY_COLUMNS)
    return str(case), "-".join([*both, str(len(run.trips)), str(len(run.collisions))])


def compare(before: Mapping[str, str], after: Mapping[str, str]) -> int:
    """Print what differs, and how much; the number of cases that do."""
    differing = [name for name in before | after if before.get(name) != after.get(name)]
    for name in differing:
        print(f"{name}: {before.get(name)} before, {after.get(name)} after")
    print(f"{len(before | after)} cases, {len(differing)} differ")
    return len(differing)


def main(files: list[str]) -> int:
    """Print all digests, or compare two files of them."""
    if files:
        before, after = (json.loads(Path(file).read_text(encoding="utf-8")) for file in files)
        return min(compare(before, after), 1)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        print(json.dumps(dict(pool.map(digests, cases(), chunksize=4)), indent=0))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
