"""One run of a sweep: the columns that identify it, and its row."""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from minisim.errors import MinisimError
from minisim.junction.movements import ARM_NAMES
from minisim.results.run import environment
from minisim.results.trips import Trips
from scenarios.recipe import Recipe
from scenarios.statistics import growing
from scenarios.sweep.keys import RESULTS, results_version

if TYPE_CHECKING:
    import pandas as pd

Row = dict[str, Any]


class Outcome(NamedTuple):
    """The row of a run, and the versions that made it."""

    row: Row
    provenance: dict[str, str]


def identity_of(recipe: Recipe) -> Row:
    """The columns that say what was run."""
    scenario = recipe.scenario
    intersection, recorded = scenario.intersection, scenario.recorded is not None
    split, turns = ("recorded", "recorded") if recorded else scenario.demand.words
    return {
        "controller": recipe.name,
        "scenario": scenario.name,
        "arms": intersection.n,
        "side": intersection.side,
        "profile": scenario.profile.name,
        "fleet": str(scenario.vehicles),
        "density": scenario.density,
        "split": split,
        "turns": turns,
        "seed": recipe.seed,
        "horizon_s": scenario.horizon,
        "warmup_s": scenario.warmup,
    }


def outcome_of(recipe: Recipe) -> Outcome:
    """Run a recipe; a `MinisimError` goes into the row."""
    began = time.thread_time()
    try:
        run = recipe.run()
        cpu = time.thread_time() - began
        summary = dict(_flat(run.summary(("queue_growth", *recipe.metrics))))
    except MinisimError as error:
        return failed(recipe, error)
    identity = identity_of(recipe)
    row = {
        **(identity | summary | identity),  # in this order: the label names the controller
        "growing": grows(summary, run.site.intersection.n),
        "arrivals": _fingerprint(run.columns),
        "cpu_s": cpu,
        "version": results_version(),
        "error": None,
    }
    return Outcome(row, _provenance())


def failed(recipe: Recipe, error: BaseException) -> Outcome:
    """The outcome of a run that raised `error`."""
    kind = "" if isinstance(error, MinisimError) else f"{type(error).__name__}: "
    row = {**identity_of(recipe), "version": results_version(), "error": f"{kind}{error}"}
    return Outcome(row, _provenance())


def grows(row: Mapping[str, Any] | pd.Series[Any], arms: int) -> bool:
    """Whether the queues of the junction or of a lane kept growing, by a row or a sum of rows."""
    return any(
        growing(float(row[f"{of}queue_growth"]), int(row[f"{of}trips"]))
        for of in ("", *(f"lanes_{lane}_" for lane in ARM_NAMES[:arms]))
    )


def _fingerprint(trips: Trips) -> str:
    """A digest of the arrivals, equal for common arrivals."""
    digest = hashlib.sha256()
    types = (trips.type,) if trips.type.any() else ()
    for column in (trips.demand_time, trips.lane, trips.manoeuvre, *types):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()[:16]


def _provenance() -> dict[str, str]:
    return {**environment(), "results": str(RESULTS), "machine": platform.machine()}


def _flat(summary: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in summary.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}_")
        else:
            yield f"{prefix}{key}", value
