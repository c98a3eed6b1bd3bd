"""Capacity: the largest demand that is served without a growing queue, by bisection.

A run serves its demand when the number of vehicles that are there (on the road or before it)
grows by less than `TOLERANCE` of what arrives meanwhile. That is asked of each seed for itself,
so that the capacities of the seeds have a mean and an interval. Near capacity a queue wanders:
single hours of a signal tell its capacity with a standard deviation of 4 %, and the tolerance adds
its 2 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from minisim.errors import InputError, integer, number
from scenarios.controllers import RIVALS
from scenarios.recipe import Recipe
from scenarios.statistics import Interval, mean_interval
from scenarios.studies.results import Find
from scenarios.studies.study import Case

#: Growth of the queue that still counts as served, as a share of the arrivals meanwhile.
TOLERANCE = 0.02

#: What is asked: every rival on three to six arms under the profile `fair`.
CASES: tuple[Case, ...] = tuple(
    Case("fair", name, name, arms, "balanced", 0.0) for arms in (3, 4, 5, 6) for name in RIVALS
)


@dataclass(frozen=True, kw_only=True)
class Search:
    """How capacity is looked for: `seeds` · log₂(`steps`) runs a case.

    Attributes:
        step: demands are multiples of it [veh/h/lane].
        steps: the highest demand is `steps`·`step`; a power of two.
        seeds: each with a bisection of its own, the seeds 1 … `seeds`.
        horizon: of each run [s].
    """

    step: float = 10.0
    steps: int = 128
    seeds: int = 4
    horizon: float = 3600.0

    def __post_init__(self) -> None:
        number("step [veh/h]", self.step, above=0)
        integer("seeds", self.seeds, low=1)
        number("horizon [s]", self.horizon, above=0)
        if integer("steps", self.steps, low=2).bit_count() != 1:
            raise InputError(f"steps must be a power of two, got {self.steps}")

    @classmethod
    def quick(cls) -> Search:
        """A smoke test: rough, and of runs too short to mean anything."""
        return cls(step=200.0, steps=4, seeds=2, horizon=150.0)


class Capacity(NamedTuple):
    """The capacity of a case.

    Attributes:
        case: whose; its density means nothing.
        brackets: of each seed, the highest demand served and the lowest that was not
            [veh/h/lane]; 0 where none was served, infinite where all were.
    """

    case: Case
    brackets: tuple[tuple[float, float], ...]

    @property
    def below(self) -> float | None:
        """What it is below, where the search found no demand that a seed's run serves."""
        return max(high for _, high in self.brackets) if self._open(0.0) else None

    @property
    def above(self) -> float | None:
        """What it is above, where the search found no demand that a seed's run does not serve."""
        return min(low for low, _ in self.brackets) if self._open(math.inf) else None

    @property
    def interval(self) -> Interval:
        """Mean over seeds, each the middle of its bracket, and 95 % interval.

        Half the bracket, within which a seed's value may be anywhere, is part of the half width.

        Raises:
            InputError: `below` or `above` is all that is known.
        """
        middles = mean_interval(sum(bracket) / 2.0 for bracket in self.brackets)
        rounding = max(high - low for low, high in self.brackets) / 2.0
        return middles._replace(half_width=middles.half_width + rounding)

    def __str__(self) -> str:
        if self.below is not None and self.above is not None:
            return "–"
        if self.below is not None:
            return f"< {self.below:.0f}"
        if self.above is not None:
            return f"> {self.above:.0f}"
        mean, half, _ = self.interval
        return f"{mean:.0f}" if math.isnan(half) else f"{mean:.0f} ± {half:.0f}"

    def _open(self, end: float) -> bool:
        return any(end in bracket for bracket in self.brackets)


def grows(row: Mapping[str, Any], tolerance: float = TOLERANCE) -> bool:
    """Whether a row of a sweep tells of a queue that grows.

    `queue_growth` is between two windows that begin half the horizon apart; half of the demanded
    trips arrive in that time.
    """
    return float(row["queue_growth"]) > tolerance * float(row["trips"]) / 2.0


def capacities(
    cases: Sequence[Case], search: Search, find: Find
) -> tuple[list[Capacity], list[Case]]:
    """Bisect for the capacity of every case, all at once: each round asks `find` one list.

    Args:
        cases: their density is replaced.
        search: how.
        find: gives the row of each experiment, by running it or from a store.

    Returns:
        The capacities, and the cases for which `find` had no row or a failed one.
    """
    seeds = range(1, search.seeds + 1)
    brackets = {(case, seed): (0, search.steps) for case in cases for seed in seeds}
    lost: set[Case] = set()
    for _ in range(search.steps.bit_length() - 1):
        asked = [key for key in brackets if key[0] not in lost]
        rows = find([_probe(case, seed, brackets[case, seed], search) for case, seed in asked])
        for key, row in zip(asked, rows, strict=True):
            if row is None or row.get("error"):
                lost.add(key[0])
                continue
            low, high = brackets[key]
            middle = (low + high) // 2
            brackets[key] = (low, middle) if grows(row) else (middle, high)
    found = [
        Capacity(case, tuple(_ends(brackets[case, seed], search) for seed in seeds))
        for case in cases
        if case not in lost
    ]
    return found, [case for case in cases if case in lost]


def _ends(bracket: tuple[int, int], search: Search) -> tuple[float, float]:
    """A bracket as demands [veh/h/lane]; the highest step is never tried."""
    low, high = bracket
    return low * search.step, math.inf if high == search.steps else high * search.step


def _probe(case: Case, seed: int, bracket: tuple[int, int], search: Search) -> Recipe:
    density = sum(bracket) // 2 * search.step
    return case._replace(density=density).experiment(seed, search.horizon)
