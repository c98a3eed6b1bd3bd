"""The numbers of a run, from the table of metrics, and its table of trips."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from minisim.errors import InputError, choice, items
from minisim.junction.movements import ARM_NAMES
from minisim.results.asked import Asked, asked_metrics
from minisim.results.metric import GROUPS, SPREAD, Metric
from minisim.results.metrics import MEANS, METRICS, USUAL
from minisim.results.spillback import spillback
from minisim.results.trips import Ints, Trips

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

#: Columns of the trip table, the same in CSV. Times are in seconds, NaN if not reached. If
#: vehicles have kinds, `kind` follows `vehicle`; if they are of several types, `type` does.
TRIP_COLUMNS: Final = (
    "vehicle", "demand_time_s", "depart_s", "arrival_s", "lane", "manoeuvre", "exit_lane", *MEANS,
)  # fmt: skip


def trip_table(
    trips: Trips, kinds: tuple[str, ...] = (), types: tuple[str, ...] = ()
) -> pd.DataFrame:
    """Trips as a DataFrame with `TRIP_COLUMNS`; missing values are NaN."""
    import pandas as pd

    arms = np.array(list(ARM_NAMES))
    columns = {
        "vehicle": trips.vehicle, **({"kind": np.array(kinds)} if kinds else {}),
        **({"type": np.array(types)[trips.type]} if len(types) > 1 else {}),
        "demand_time_s": trips.demand_time, "depart_s": trips.depart, "arrival_s": trips.arrival,
        "lane": arms[trips.lane], "manoeuvre": trips.manoeuvre, "exit_lane": arms[trips.exit_lane],
    }  # fmt: skip
    for name in MEANS:
        metric = METRICS[name]
        over = trips.arrived if metric.phase == "drive" else trips.departed
        columns[name] = np.where(over, metric.values(trips, len(over)), np.nan)
    return pd.DataFrame(columns).round(6)


def summarise(
    run: Run, metrics: str | Iterable[Asked] = (), by: Iterable[str] = ()
) -> dict[str, Any]:
    """The usual numbers of a run, and the metrics asked for.

    The means at the top and in each group are in SUMO's form; those under `complete` are in the
    complete form. Trips are grouped by lane (`lanes`) and, if there are several, by kind (`kinds`)
    and type (`types`). `spillback_s`, of each lane and of all, is when a queue first reached the
    end of its road (`minisim.results.spillback`), None if none did.

    Args:
        run: what to measure, without the warm-up of its scenario (`Run.counted`).
        metrics: names of `minisim.results.metrics.METRICS`, `Metric`s or functions
            (`minisim.results.metrics.metric_of`). Each mean asked for, of trips or over time, also
            gets its median, 95th percentile and maximum (`SPREAD`, numpy's linear method).
        by: further groupings, such as "movement".

    Raises `InputError` for an unknown metric or group, a metric that needs trajectories that were
    not recorded, a metric whose function raises or returns the wrong type or shape, or a
    controller's count that has the name of another number.
    """
    whole, full = run, spillback(run.columns, run.site, float(run.scenario.warmup))
    run = run.counted
    asked = asked_metrics(metrics)
    keys = [GROUPS[choice("group of trips", one, GROUPS)] for one in items("by", by, "words")]
    table = (*USUAL, *(metric for metric in asked if not metric.usual))
    measured = _Measured(run, table, asked)
    summary = measured.of(np.arange(len(run.columns.lane)))
    complete = summary.pop("complete")
    several = ["kinds"] * bool(run.kinds) + ["types"] * (len(run.site.types) > 1)
    for key in dict.fromkeys(("lanes", *several, *keys)):
        summary[key] = {name: measured.of(rows) for name, rows in _groups(run, key).items()}
    for lane, name in enumerate(summary["lanes"]):
        summary["lanes"][name]["spillback_s"] = full.get(lane)
    summary |= {"complete": complete, "spillback_s": min(full.values(), default=None)}
    summary |= {m.name: m.number(run) for m in table if not m.grouped}
    for metric in table:
        if metric.per == "lane":
            series = metric.series(whole)
            for part, values in zip(
                (summary, *summary["lanes"].values()), (series.sum(axis=1), *series.T), strict=True
            ):
                part |= {metric.name: _mean(values.tolist()), **_spread(metric.name, values)}
    for name in summary.keys() & run.counts.keys():
        if name not in METRICS or METRICS[name].needs != "counts":
            raise InputError(f"the controller's count {name!r} has the name of another number")
    return {**summary, **run.counts}


class _Measured:
    """The metrics of a run, measured once and then summarised for any set of its trips."""

    def __init__(self, run: Run, table: tuple[Metric, ...], asked: tuple[Metric, ...]) -> None:
        self._run, self._trips = run, run.columns
        self._spread = {metric.name for metric in asked}
        self._values = [
            (m, m.values(run.columns if m.needs == "trips" else run, len(run.columns.lane)))
            for m in table
            if m.per == "trip"
        ]
        # The two numbers that every group has are computed in `of`.
        self._numbers = [m for m in table if m.per == "run" and m.grouped and not m.usual]

    def of(self, rows: Ints) -> dict[str, Any]:
        """Numbers and means of the trips at these indices."""
        trips = self._trips
        arrived, departed = rows[trips.arrived[rows]], rows[trips.departed[rows]]
        numbers: dict[str, Any] = {"trips": len(rows), "unfinished": len(rows) - len(arrived)}
        if self._numbers:
            part = trips.taken(rows)
            run = replace(self._run, columns=part)
            for metric in self._numbers:
                numbers[metric.name] = metric.number(part if metric.needs == "trips" else run)
        complete: dict[str, float | None] = {}
        for metric, values in self._values:
            begun = departed if metric.phase == "drive" else rows
            for form, chosen in ((numbers, arrived), (complete, begun)):
                there = values[chosen].tolist()
                form[metric.name] = _mean(there)
                if metric.name in self._spread:
                    form |= _spread(metric.name, there)
        return {**numbers, "complete": complete}


def _mean(values: list[float]) -> float | None:
    """Mean, ignoring NaNs."""
    total = math.fsum(values)
    if total != total:
        return _mean([value for value in values if value == value])
    return total / len(values) if values else None


def _spread(name: str, values: Iterable[float]) -> dict[str, float | None]:
    """Median, 95th percentile and maximum, ignoring NaNs, as columns."""
    there = [value for value in values if value == value]
    spread = np.percentile(there, (50, 95, 100)).tolist() if there else [None] * 3
    return {f"{name}_{what}": value for what, value in zip(SPREAD, spread, strict=True)}


def _groups(run: Run, key: str) -> dict[str, Ints]:
    """Name of each group -> indices of its trips."""
    trips, movements = run.columns, run.site.intersection.movements
    names: Iterable[str]
    if key == "lanes":
        names, group = ARM_NAMES[: movements.n], trips.lane
    elif key == "movements":
        names, group = movements.names, movements.index_of[trips.lane, trips.manoeuvre]
    elif key == "types":
        names, group = run.site.fleet.names, trips.type
    else:
        kinds, group = np.unique(np.array(run.kinds, dtype=str), return_inverse=True)
        names = kinds.tolist()
    return {name: (group == k).nonzero()[0] for k, name in enumerate(names)}
