"""Two hosts on the same arrivals: how closely their trips agree, and where they part ways.

Differences are SUMO's value minus minisim's. A vehicle has one index: both get the same arrivals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from minisim.junction.movements import ARM_NAMES, Bools, Movement
from minisim.junction.paths import Floats
from minisim.results.metrics import MEANS, METRICS
from minisim.results.trajectories import LANE, MANOEUVRE, SPEED, TIME, VEHICLE, S
from minisim.results.trips import Trips
from scenarios.statistics import Interval, ks_distance, mean_interval

if TYPE_CHECKING:
    import pandas as pd

#: Trips whose times differ by at most this count as the same [s]: a step of the profile `fair`.
CLOSE: Final = 0.1

#: Positions farther apart than this count as different [m].
APART: Final = 0.5

#: The metrics by which a trip is judged, and what a report calls them.
JUDGED: Final = {"waiting_time_s": "Waiting time", "travel_time_s": "Travel time"}

#: Decimals of a time [s]: with more, rounding errors would make equal waiting times differ.
DECIMALS: Final = 6


@dataclass(frozen=True)
class Tolerance:
    """How much a mean may differ: a share of the value or an absolute amount, whichever is more."""

    relative: float
    absolute: float = 0.0

    def holds(self, value: float, difference: float) -> bool:
        """Whether a difference from `value` is within the tolerance; false for NaN."""
        return abs(difference) <= max(self.relative * abs(value), self.absolute)

    def __str__(self) -> str:
        parts = {f"{100 * self.relative:g} %": self.relative, f"{self.absolute:g} s": self.absolute}
        return " or ".join(words for words, size in parts.items() if size)


class Pair(NamedTuple):
    """One seed's trips in both hosts."""

    seed: int
    minisim: Trips
    sumo: Trips


class Row(NamedTuple):
    """One metric of one lane, over all seeds; times in seconds."""

    lane: str  # "all" or a letter
    metric: str  # one of `minisim.results.metrics.MEANS`
    trips: tuple[int, int]  # number that ended, in minisim and in SUMO
    minisim: Interval  # the mean over seeds of each run's mean
    sumo: Interval
    difference: Interval  # between the two means of a seed; mean over seeds
    ks: float  # distance between the distributions of all trips; NaN if a host has none
    within: float  # share of the trips that differ by less than `CLOSE`


class Divergence(NamedTuple):
    """The first trip, in order of demand, that is not the same in both hosts; times in seconds."""

    seed: int
    vehicle: int  # index into the trips
    movement: str  # such as "a2"
    depart: float  # in minisim; the time of its demand if it never got on the road
    end: float  # when it had arrived in both; the end of the run if it did not
    waiting: tuple[float, float]  # in minisim and in SUMO, up to the end of the run
    travel: tuple[float, float]


class Parting(NamedTuple):
    """The first moment at which a vehicle is in different places in the two hosts."""

    time: float  # [s]
    vehicle: int  # index into the trips
    movement: str  # such as "a2"
    positions: tuple[float, float]  # on its path, in minisim and in SUMO [m]
    speeds: tuple[float, float]  # in minisim and in SUMO [m/s]
    minisim: pd.DataFrame  # trajectories around it (`Run.trajectories`)
    sumo: pd.DataFrame


def compare(pairs: Sequence[Pair], arms: int) -> tuple[Row, ...]:
    """Every metric, for all lanes together and for each lane; empty if there are no pairs."""
    lanes: list[int | None] = [None, *range(arms)] if pairs else []
    return tuple(_row(pairs, lane, metric) for lane in lanes for metric in MEANS)


def agreement(pairs: Sequence[Pair]) -> float:
    """Share of the trips whose waiting and travel time both differ by less than `CLOSE`."""
    return _share([_close(pair, *JUDGED)[_ended(pair)] for pair in pairs])


def first_divergence(pair: Pair) -> Divergence | None:
    """Where the trips of one seed begin to differ; None if they never do."""
    apart = np.flatnonzero(~_close(pair, *JUDGED) & _ended(pair))
    if not len(apart):
        return None
    k = int(apart[0])
    ours, theirs = pair.minisim, pair.sumo
    return Divergence(
        pair.seed, k, str(Movement(int(ours.lane[k]), int(ours.manoeuvre[k]))),
        depart=float(ours.depart[k] if ours.departed[k] else ours.demand_time[k]),
        end=max(float(t.arrival[k]) if t.arrived[k] else t.end for t in (ours, theirs)),
        waiting=(float(ours.waiting_time[k]), float(theirs.waiting_time[k])),
        travel=(float(ours.travel_time[k]), float(theirs.travel_time[k])),
    )  # fmt: skip


def first_parting(minisim: pd.DataFrame, sumo: pd.DataFrame) -> Parting | None:
    """The first common moment at which a vehicle's two positions are more than `APART` apart.

    If this holds for several vehicles at that moment, the one with the largest gap is taken. Both
    frames are trajectories of the same run (`Run.trajectories`).
    """
    both = minisim.merge(sumo, on=[TIME, VEHICLE], suffixes=("", "_sumo"))
    both["apart"] = (both[S] - both[f"{S}_sumo"]).abs()
    moved = both[both["apart"] > APART]
    if moved.empty:
        return None
    row = moved.sort_values([TIME, "apart"], ascending=[True, False]).iloc[0]
    return Parting(
        float(row[TIME]), int(row[VEHICLE]), f"{row[LANE]}{row[MANOEUVRE]}",
        positions=(float(row[S]), float(row[f"{S}_sumo"])),
        speeds=(float(row[SPEED]), float(row[f"{SPEED}_sumo"])),
        minisim=minisim, sumo=sumo,
    )  # fmt: skip


def times(trips: Trips, metric: str, lane: int | None = None) -> Floats:
    """A metric of the trips that ended [s], on one lane or on all."""
    chosen = trips.arrived if lane is None else trips.arrived & (trips.lane == lane)
    return np.asarray(METRICS[metric].of(trips)[chosen]).round(DECIMALS)


def _row(pairs: Sequence[Pair], lane: int | None, metric: str) -> Row:
    ours = [times(pair.minisim, metric, lane) for pair in pairs]
    theirs = [times(pair.sumo, metric, lane) for pair in pairs]
    means = [(a.mean(), b.mean()) for a, b in zip(ours, theirs, strict=True) if len(a) and len(b)]
    pooled = np.concatenate(ours), np.concatenate(theirs)
    return Row(
        "all" if lane is None else ARM_NAMES[lane], metric, (len(pooled[0]), len(pooled[1])),
        minisim=_interval([a for a, _ in means]), sumo=_interval([b for _, b in means]),
        difference=_interval([b - a for a, b in means]),
        ks=ks_distance(*pooled) if all(map(len, pooled)) else math.nan,
        within=_share([_close(pair, metric)[_ended(pair, lane)] for pair in pairs]),
    )  # fmt: skip


def _interval(values: Sequence[float]) -> Interval:
    return mean_interval(map(float, values)) if values else Interval(math.nan, math.nan, 0)


def _close(pair: Pair, *metrics: str) -> Bools:
    """Whether each trip is the same, shape (k,); an unfinished one counts with its time so far."""
    differences = [np.abs(METRICS[m].of(pair.sumo) - METRICS[m].of(pair.minisim)) for m in metrics]
    return np.asarray(np.max(differences, axis=0) <= CLOSE + 10.0**-DECIMALS)


def _ended(pair: Pair, lane: int | None = None) -> Bools:
    """Whether each trip ended in at least one of the hosts, shape (k,)."""
    ended = pair.minisim.arrived | pair.sumo.arrived
    return np.asarray(ended if lane is None else ended & (pair.minisim.lane == lane))


def _share(parts: Sequence[Bools]) -> float:
    values = np.concatenate(parts) if parts else np.empty(0)
    return float(values.mean()) if len(values) else math.nan
