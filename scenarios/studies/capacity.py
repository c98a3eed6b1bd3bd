"""Capacity: the largest demand that is served without a growing queue, by bisection.

A run serves its demand if the number of vehicles on the road or waiting to enter it grows by less
than `TOLERANCE` times the arrivals in that time. Each seed has its own bisection, so capacities
have a mean and an interval. Near capacity, a queue wanders: the capacity of a signal found from
single hours has a standard deviation of 4 %, and the tolerance adds another 2 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

from minisim.errors import InputError
from scenarios.controllers import RIVALS
from scenarios.statistics import Interval, mean_interval
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.points import ControllerPoint, Point, fair_grid
from scenarios.studies.shared.study import Find, Results, Study

if TYPE_CHECKING:
    import pandas as pd

#: Growth of the queue that still counts as served, as a share of the arrivals in that time.
TOLERANCE = 0.02


@dataclass(frozen=True)
class CapacityStudy(Study):
    """Bisects demand at every point, once per seed; the point's own demand is not used."""

    points: tuple[ControllerPoint, ...]

    def collect(self, effort: Effort, find: Find) -> Results:
        """Call `find` once per round. A point with a missing or failed run is given up."""
        search = effort.search
        seeds = range(1, search.seeds + 1)
        brackets = dict.fromkeys(product(self.points, seeds), (0, search.steps))
        asked: list[tuple[Point, Mapping[str, Any] | None]] = []
        for _ in range(search.rounds):
            probes = {
                (point, seed): point._replace(density=sum(bracket) // 2 * search.step)
                for (point, seed), bracket in brackets.items()
            }
            rows = find([probe.recipe(seed, search.horizon) for (_, seed), probe in probes.items()])
            asked += zip(probes.values(), rows, strict=True)
            lost = set()
            for key, row in zip(probes, rows, strict=True):
                low, high = brackets[key]
                middle = (low + high) // 2
                if row is None or row["error"]:
                    lost.add(key[0])
                else:
                    brackets[key] = (low, middle) if grows(row) else (middle, high)
            brackets = {key: each for key, each in brackets.items() if key[0] not in lost}
        return Results.of(self, effort, asked)

    def most_runs(self, effort: Effort) -> int:
        """The most runs that `collect` asks for."""
        return len(self.points) * effort.search.seeds * effort.search.rounds

    def extent(self, effort: Effort) -> str:
        """The seeds and the horizon, in words."""
        return f"the seeds 1 … {effort.search.seeds} over {effort.search.horizon:g} s"


STUDY = CapacityStudy(
    "capacity",
    "Which demand is served without a growing queue?",
    fair_grid(RIVALS, (3, 4, 5, 6), (0.0,)),
)


class Capacity(NamedTuple):
    """The capacity of a point.

    For each seed, its bracket is the highest demand that was served and the lowest that was not
    [veh/h/lane]: 0 if none was served, infinite if all were.
    """

    series: str  # the controller
    arms: int  # of the junction
    brackets: tuple[tuple[float, float], ...]

    @property
    def below(self) -> float | None:
        """The upper bound, if a seed served no demand that was tried; None otherwise."""
        lows, highs = zip(*self.brackets, strict=True)
        return max(highs) if 0.0 in lows else None

    @property
    def above(self) -> float | None:
        """The lower bound, if a seed served every demand that was tried; None otherwise."""
        lows, highs = zip(*self.brackets, strict=True)
        return min(lows) if math.inf in highs else None

    @property
    def interval(self) -> Interval:
        """Mean over seeds of the middles of their brackets, with its 95 % interval.

        A seed's value may be anywhere in its bracket, so half the bracket adds to the half width.
        `InputError` if only `below` or `above` is known.
        """
        if self.below is not None or self.above is not None:
            raise InputError(f"the capacity of {self.series} on {self.arms} arms has no bounds")
        middles = mean_interval(sum(bracket) / 2.0 for bracket in self.brackets)
        rounding = max(high - low for low, high in self.brackets) / 2.0
        return middles._replace(half_width=middles.half_width + rounding)

    def __str__(self) -> str:
        below, above = self.below, self.above
        if below is not None:
            return f"< {below:.0f}" if above is None else "–"
        if above is not None:
            return f"> {above:.0f}"
        mean, half, _ = self.interval
        return f"{mean:.0f}" if math.isnan(half) else f"{mean:.0f} ± {half:.0f}"


def grows(row: Mapping[Any, Any]) -> bool:
    """Whether the queue grew in a run, given its row of a sweep.

    `queue_growth` compares windows half a horizon apart, in which half of the trips arrive.
    """
    return float(row["queue_growth"]) > TOLERANCE * float(row["trips"]) / 2.0


def capacities(results: Results) -> list[Capacity]:
    """The capacity of every point whose search is complete."""
    search = results.effort.search
    rows = results.good
    known = []
    for point in results.study.points:
        probes = rows[(rows["series"] == point.series) & (rows["arms"] == point.arms)]
        if len(probes) == search.seeds * search.rounds:
            brackets = tuple(_bracket(each) for _, each in probes.groupby("seed"))
            known.append(Capacity(point.series, point.arms, brackets))
    return known


def _bracket(rows: pd.DataFrame) -> tuple[float, float]:
    """The bracket of one seed: highest demand served, and lowest at which the queue grew."""
    demands = {True: [math.inf], False: [0.0]}
    for row in rows.to_dict("records"):
        demands[grows(row)].append(float(row["density"]))
    return max(demands[False]), min(demands[True])
