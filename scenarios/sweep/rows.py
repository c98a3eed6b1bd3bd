"""One run of a sweep: what identifies it, and the row that it gives."""

from __future__ import annotations

import hashlib
import math
import platform
import time
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from minisim.errors import MinisimError
from minisim.junction.geometry import ARM_NAMES
from minisim.results.trips import Trips
from minisim.version import __version__
from scenarios.mixing import driver_means
from scenarios.recipe import Recipe
from scenarios.statistics import growing, queue_growth
from scenarios.sweep.keys import RESULTS, results_version

#: Columns that a repetition of the same run measures anew.
MEASURED = ("cpu_s",)

Row = dict[str, Any]


class Outcome(NamedTuple):
    """What a run left: its row, and where that came from."""

    row: Row
    provenance: dict[str, str]


def identity_of(recipe: Recipe) -> Row:
    """The columns that tell what was run."""
    scenario = recipe.scenario
    demand, intersection = scenario.demand, scenario.intersection
    recorded = scenario.recorded is not None
    return {
        "controller": recipe.name,
        "scenario": scenario.name,
        "arms": intersection.n,
        "side": intersection.side,
        "profile": scenario.profile.name,
        "density": scenario.density,
        "split": "recorded" if recorded else _shares(demand.split, "balanced"),
        "turns": "recorded" if recorded else _shares(demand.turns, "uniform"),
        "seed": recipe.seed,
        "horizon_s": scenario.horizon,
    }


def outcome_of(recipe: Recipe) -> Outcome:
    """Run it; a `MinisimError` becomes part of the row."""
    began = time.thread_time()
    try:
        run = recipe.run()
    except MinisimError as error:
        return failed(recipe, error)
    cpu = time.thread_time() - began
    identity = identity_of(recipe)
    summary = {key: value for key, value in _flat(run.summary()) if key not in identity}
    row = {
        **identity,
        **summary,
        **dict(_flat(driver_means(run))),
        **_growth(run.columns, run.site.intersection.n),
        "arrivals": _fingerprint(run.columns),
        "cpu_s": cpu,
        "version": results_version(),
        "error": None,
    }
    return Outcome(row, _provenance())


def failed(recipe: Recipe, error: BaseException) -> Outcome:
    """The outcome of a run that gave none."""
    kind = "" if isinstance(error, MinisimError) else f"{type(error).__name__}: "
    row = {**identity_of(recipe), "version": results_version(), "error": f"{kind}{error}"}
    return Outcome(row, _provenance())


def _growth(trips: Trips, n: int) -> Row:
    """Growth of the queues, total and by lane, and whether it is more than chance."""
    demanded = trips.demand_time <= trips.end
    leave = np.where(trips.arrived, trips.arrival, math.inf)

    def of(chosen: Any) -> tuple[float, int]:
        grown = queue_growth(trips.demand_time[chosen], leave[chosen], trips.end)
        return grown, int(chosen.sum())

    lanes = [of(demanded & (trips.lane == lane)) for lane in range(n)]
    total = of(demanded)
    return {
        "queue_growth": total[0],
        **{f"lanes_{ARM_NAMES[i]}_queue_growth": grown for i, (grown, _) in enumerate(lanes)},
        "growing": any(growing(*tested) for tested in (total, *lanes)),
    }


def _fingerprint(trips: Trips) -> str:
    """Names the arrivals: rows of common arrivals have the same."""
    digest = hashlib.sha256()
    for column in (trips.demand_time, trips.lane, trips.manoeuvre):
        digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()[:16]


def _provenance() -> dict[str, str]:
    return {
        "minisim": __version__,
        "results": str(RESULTS),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
    }


def _flat(summary: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in summary.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}_")
        else:
            yield f"{prefix}{key}", value


def _shares(shares: Any, equal: str) -> str:
    return equal if shares is None else ":".join(f"{share:g}" for share in shares)
