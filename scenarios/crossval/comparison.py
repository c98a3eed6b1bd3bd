"""Two hosts on the same arrivals: how far their trips agree, and where they part.

Differences are SUMO's value minus minisim's. A vehicle has the same index in both, for the arrival
table is the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from minisim.errors import InputError
from minisim.junction.movements import ARM_NAMES, Bools, Movement
from minisim.junction.paths import Floats
from minisim.results.metrics import MEANS, METRICS
from minisim.results.trajectories import TIME, VEHICLE, S
from minisim.results.trips import Trips
from scenarios.statistics import Interval, ks_distance, mean_interval

if TYPE_CHECKING:
    import pandas as pd

#: Two trips closer than this are the same [s]: a step of the profile `fair`.
CLOSE: Final = 0.1

#: Two positions farther apart than this are not the same [m].
APART: Final = 0.5

#: A trip is judged by these two.
JUDGED: Final = ("waiting_time_s", "travel_time_s")

#: Decimals of a time [s]: more are rounding, and would tell equal waiting times apart.
DECIMALS: Final = 6


@dataclass(frozen=True)
class Tolerance:
    """What a mean may differ by: a share of the value or an absolute amount, whichever is more."""

    relative: float
    absolute: float = 0.0

    def holds(self, value: float, difference: float) -> bool:
        """Whether a value that differs so much is within; false for NaN."""
        return abs(difference) <= max(self.relative * abs(value), self.absolute)

    def __str__(self) -> str:
        parts = [f"{100 * self.relative:g} %"] if self.relative else []
        return " or ".join([*parts, *([f"{self.absolute:g} s"] if self.absolute else [])])


class Pair(NamedTuple):
    """One seed's trips in both hosts."""

    seed: int
    minisim: Trips
    sumo: Trips


class Row(NamedTuple):
    """One metric of one lane.

    Attributes:
        lane: "all" or a letter.
        metric: one of `minisim.results.metrics.MEANS`.
        trips: that ended, in minisim and in SUMO, over all seeds.
        minisim, sumo: the mean over seeds of each run's mean [s].
        difference: of the two means of a seed, mean over seeds [s].
        ks: distance of the distributions of all trips; NaN where a host has none.
        within: share of the trips that differ by less than `CLOSE`.
    """

    lane: str
    metric: str
    trips: tuple[int, int]
    minisim: Interval
    sumo: Interval
    difference: Interval
    ks: float
    within: float


class Divergence(NamedTuple):
    """The first trip, in order of demand, that is not the same in both hosts.

    Attributes:
        seed: of the run.
        vehicle: index into the trips.
        movement: such as "a2".
        depart: in minisim [s]; of the demand where it never got on the road.
        end: when it had arrived in both [s]; the end of the run where it did not.
        waiting, travel: in minisim and in SUMO [s], up to the end of the run.
    """

    seed: int
    vehicle: int
    movement: str
    depart: float
    end: float
    waiting: tuple[float, float]
    travel: tuple[float, float]


class Parting(NamedTuple):
    """The first moment at which a vehicle is at two places.

    Attributes:
        time: [s].
        vehicle: index into the trips.
        positions: from the road entry, in minisim and in SUMO [m].
        speeds: in minisim and in SUMO [m/s].
    """

    time: float
    vehicle: int
    positions: tuple[float, float]
    speeds: tuple[float, float]


def compare(pairs: Sequence[Pair], arms: int) -> list[Row]:
    """Every metric of all lanes and of each; raises `InputError` without a pair."""
    if not pairs:
        raise InputError("a comparison needs at least one run that both hosts finished")
    lanes: list[int | None] = [None, *range(arms)]
    return [_row(pairs, lane, metric) for lane in lanes for metric in MEANS]


def agreement(pairs: Sequence[Pair]) -> float:
    """Share of the trips whose waiting and travel time both differ by less than `CLOSE`."""
    return _share(np.concatenate([_close(pair, JUDGED)[_ended(pair)] for pair in pairs]))


def first_divergence(pair: Pair) -> Divergence | None:
    """Where the trips of one seed begin to differ; None where none does."""
    apart = np.flatnonzero(~_close(pair, JUDGED) & _ended(pair))
    if not len(apart):
        return None
    k = int(apart[0])
    ours, theirs = pair.minisim, pair.sumo
    arrivals = [t.arrival[k] if t.arrived[k] else t.end for t in (ours, theirs)]
    return Divergence(
        seed=pair.seed,
        vehicle=k,
        movement=str(Movement(int(ours.lane[k]), int(ours.manoeuvre[k]))),
        depart=float(ours.depart[k] if ours.departed[k] else ours.demand_time[k]),
        end=float(max(arrivals)),
        waiting=(float(ours.waiting_time[k]), float(theirs.waiting_time[k])),
        travel=(float(ours.travel_time[k]), float(theirs.travel_time[k])),
    )


def first_parting(minisim: pd.DataFrame, sumo: pd.DataFrame) -> Parting | None:
    """The first of the common moments at which a vehicle's positions are more than `APART` apart.

    Of several vehicles at that moment, the one that is farthest apart.

    Args:
        minisim, sumo: trajectories of the same run (`Run.trajectories`).
    """
    both = minisim.merge(sumo, on=[TIME, VEHICLE], suffixes=("", "_sumo"))
    both["apart"] = (both[S] - both[f"{S}_sumo"]).abs()
    moved = both[both["apart"] > APART]
    if moved.empty:
        return None
    row = moved.sort_values([TIME, "apart"], ascending=[True, False]).iloc[0]
    return Parting(
        time=float(row[TIME]),
        vehicle=int(row[VEHICLE]),
        positions=(float(row[S]), float(row[f"{S}_sumo"])),
        speeds=(float(row["speed_mps"]), float(row["speed_mps_sumo"])),
    )


def times(trips: Trips, metric: str, lane: int | None = None) -> Floats:
    """A metric of the trips that ended [s], of one lane or of all."""
    chosen = trips.arrived if lane is None else trips.arrived & (trips.lane == lane)
    return np.round(METRICS[metric].values(trips, len(chosen))[chosen], DECIMALS)


def _row(pairs: Sequence[Pair], lane: int | None, metric: str) -> Row:
    ours = [times(pair.minisim, metric, lane) for pair in pairs]
    theirs = [times(pair.sumo, metric, lane) for pair in pairs]
    means = [(a.mean(), b.mean()) for a, b in zip(ours, theirs, strict=True) if len(a) and len(b)]
    pooled = np.concatenate(ours), np.concatenate(theirs)
    return Row(
        lane="all" if lane is None else ARM_NAMES[lane],
        metric=metric,
        trips=(len(pooled[0]), len(pooled[1])),
        minisim=_interval(a for a, _ in means),
        sumo=_interval(b for _, b in means),
        difference=_interval(b - a for a, b in means),
        ks=ks_distance(*pooled) if all(map(len, pooled)) else math.nan,
        within=_share(np.concatenate([_close(p, (metric,))[_ended(p, lane)] for p in pairs])),
    )


def _interval(values: Iterator[float]) -> Interval:
    data = list(values)
    return mean_interval(map(float, data)) if data else Interval(math.nan, math.nan, 0)


def _close(pair: Pair, metrics: Sequence[str]) -> Bools:
    """Whether a trip is the same; what one that has not ended has gathered so far counts."""
    differences = [np.abs(METRICS[m].of(pair.sumo) - METRICS[m].of(pair.minisim)) for m in metrics]
    return np.asarray(np.max(differences, axis=0) <= CLOSE + 10.0**-DECIMALS)


def _ended(pair: Pair, lane: int | None = None) -> Bools:
    """Whether a trip ended in one of the hosts, shape (k,)."""
    ended = pair.minisim.arrived | pair.sumo.arrived
    return np.asarray(ended if lane is None else ended & (pair.minisim.lane == lane))


def _share(values: Bools) -> float:
    return float(values.mean()) if len(values) else math.nan
