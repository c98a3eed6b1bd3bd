"""A run's numbers, put together by the table of metrics, and its trip table."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from minisim.errors import InputError, choice, items
from minisim.junction.movements import ARM_NAMES, Movement
from minisim.results.metrics import MEANS, METRICS, PHASES, SPREAD, USUAL, Metric, asked_metrics
from minisim.results.trips import Floats, Ints, Trips

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

#: Columns of the trip table, the same in CSV. Times in seconds, NaN where not reached. After
#: `vehicle` comes `kind` where vehicles have one.
TRIP_COLUMNS: Final = (
    "vehicle",
    "demand_time_s",
    "depart_s",
    "arrival_s",
    "lane",
    "manoeuvre",
    "exit_lane",
    *MEANS,
)

#: What trips are grouped by -> the key of a summary that holds the groups.
GROUPS: Final = {"lane": "lanes", "movement": "movements", "kind": "kinds"}


def trip_table(trips: Trips, kinds: tuple[str, ...] = ()) -> pd.DataFrame:
    """All trips as a DataFrame with `TRIP_COLUMNS`; what has not ended is NaN."""
    import pandas as pd

    names = np.array(list(ARM_NAMES))
    columns = {
        "vehicle": np.arange(len(trips.demand_time)),
        **({"kind": np.array(kinds)} if kinds else {}),
        "demand_time_s": trips.demand_time,
        "depart_s": trips.depart,
        "arrival_s": trips.arrival,
        "lane": names[trips.lane],
        "manoeuvre": trips.manoeuvre,
        "exit_lane": names[trips.exit_lane],
    }
    for name in MEANS:
        metric = METRICS[name]
        over = trips.arrived if metric.phase == "drive" else trips.departed
        columns[name] = np.where(over, metric.values(trips, len(over)), np.nan)
    return pd.DataFrame({
        name: np.round(column, 6) if column.dtype.kind == "f" else column
        for name, column in columns.items()
    })  # fmt: skip


def summarise(
    run: Run, metrics: Iterable[str | Metric] = (), by: Iterable[str] = ()
) -> dict[str, Any]:
    """The usual numbers of a run, and what is asked for besides.

    SUMO's form of the means is at the top and by group, the complete form under `complete`. There
    are groups by lane (`lanes`) and, where vehicles have one, by kind (`kinds`).

    Args:
        run: what to measure. Trips demanded before its scenario's warm-up do not count.
        metrics: names of `minisim.results.metrics.METRICS`, or `Metric`s. A mean that is asked for
            gets its median, 95th percentile and maximum too (`SPREAD`, numpy's linear method).
        by: more groups, "movement".

    Raises:
        InputError: an unknown metric or group; a metric that needs trajectories where none were
            recorded; a metric whose function gives the wrong thing.
    """
    asked = asked_metrics(metrics)
    keys = [GROUPS[choice("group of trips", one, GROUPS)] for one in items("by", by, "words")]
    table = (*USUAL, *(metric for metric in asked if not metric.usual))
    _check_recorded(run, asked)
    measured = _Measured(run, table, asked)
    top = measured.all()
    complete = top.pop("complete")
    groups = dict.fromkeys(("lanes", *(("kinds",) if run.kinds else ()), *keys))
    return {
        **top,
        **{key: measured.by(*_groups(run, key)) for key in groups},
        "complete": complete,
        **{m.name: m.number(run) for m in table if m.per == "run" and m.needs != "trips"},
        **run.counts,
    }


class _Measured:
    """The metrics of a run, to be had for all trips that count and for groups of them."""

    def __init__(self, run: Run, table: tuple[Metric, ...], asked: tuple[Metric, ...]) -> None:
        self._trips = run.counted
        self._spread = {metric.name for metric in asked}
        self._numbers = [m for m in table if m.per == "run" and m.needs == "trips"]
        self._phases = [
            [m for m in table if m.per == "trip" and m.phase == phase] for phase in PHASES
        ]
        # Shape (metrics, trips), by phase.
        self._values = [
            np.array([_trip_values(run, metric) for metric in metrics]) for metrics in self._phases
        ]

    def all(self) -> dict[str, Any]:
        """Numbers and means of all trips."""
        trips = self._trips
        ended, complete = (
            self._means(trips, self._values, None, 1, form) for form in (False, True)
        )
        return {**self._counted(trips), **ended[0], "complete": complete[0]}

    def by(self, names: list[str], codes: Ints) -> dict[str, Any]:
        """Numbers and means of each group; `codes` are the trips' indices into `names`."""
        order = codes.argsort(kind="stable")
        codes, trips = codes[order], self._trips.taken(order)
        values = [every.take(order, axis=1) for every in self._values]
        ends = _ends(codes, len(names))
        ended = self._means(trips, values, codes, len(names), complete=False)
        complete = self._means(trips, values, codes, len(names), complete=True)
        return {
            name: {
                **self._counted(trips.taken(slice(ends[k], ends[k + 1]))),
                **ended[k],
                "complete": complete[k],
            }
            for k, name in enumerate(names)
        }

    def _counted(self, trips: Trips) -> dict[str, float | int | None]:
        """Numbers that are made of trips only."""
        return {metric.name: metric.number(trips) for metric in self._numbers}

    def _means(
        self, trips: Trips, every: list[Floats], codes: Ints | None, groups: int, complete: bool
    ) -> list[dict[str, float | None]]:
        """Means of each group, of the trips that ended or of all; trips are sorted by group."""
        results: list[dict[str, float | None]] = [{} for _ in range(groups)]
        begun = (trips.departed if complete else trips.arrived).nonzero()[0]
        for metrics, values, phase in zip(self._phases, every, PHASES, strict=True):
            if not complete or phase == "drive":
                values, own = values.take(begun, axis=1), None if codes is None else codes[begun]
            else:
                own = codes
            ends = [0, values.shape[1]] if own is None else _ends(own, groups)
            for metric, data in zip(metrics, values.tolist(), strict=True):
                name = metric.name
                for k, result in enumerate(results):
                    part = data[ends[k] : ends[k + 1]]
                    result[name] = _mean(part)
                    if name in self._spread:
                        result |= _spread(name, part)
        return results


def _ends(codes: Ints, groups: int) -> list[int]:
    """Where each group starts in sorted codes, and the last one ends."""
    ends: list[int] = codes.searchsorted(np.arange(groups + 1)).tolist()
    return ends


def _trip_values(run: Run, metric: Metric) -> Floats:
    """A value for each trip that counts."""
    if metric.needs == "trips":
        return metric.values(run.counted, len(run.counted.demand_time))
    return metric.values(run, len(run.columns.demand_time))[run.counted_rows]


def _mean(values: list[float]) -> float | None:
    """Mean of the values that there are."""
    total = math.fsum(values)
    if total != total:
        return _mean([value for value in values if value == value])
    return total / len(values) if values else None


def _spread(name: str, values: list[float]) -> dict[str, float | None]:
    """Median, 95th percentile and maximum of the values that there are, as columns."""
    there = [value for value in values if value == value]
    spread = (*np.percentile(there, (50.0, 95.0)).tolist(), max(there)) if there else (None,) * 3
    return {f"{name}_{what}": value for what, value in zip(SPREAD, spread, strict=True)}


def _groups(run: Run, key: str) -> tuple[list[str], Ints]:
    """Names of groups, and for each trip that counts the index of its group."""
    trips, intersection = run.counted, run.site.intersection
    if key == "lanes":
        return list(ARM_NAMES[: intersection.n]), trips.lane
    if key == "movements":
        index = {movement: k for k, movement in enumerate(intersection.movements)}
        pairs = zip(trips.lane.tolist(), trips.manoeuvre.tolist(), strict=True)
        return [str(m) for m in index], np.array([index[Movement(*p)] for p in pairs], np.int64)
    names, codes = np.unique(np.array(run.kinds, dtype=str), return_inverse=True)
    return names.tolist(), codes[run.counted_rows]


def _check_recorded(run: Run, asked: Iterable[Metric]) -> None:
    for metric in asked:
        if metric.needs == "trajectories" and run.record is None:
            raise InputError(
                f"metric {metric.name!r} needs trajectories: simulate with record='junction' or "
                "record='all'"
            )
