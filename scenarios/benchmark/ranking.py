"""Who is how good: means with intervals, and ranks with the confidence that the seeds allow.

Controllers are compared run by run on common arrivals. For each pair, Student's t-test on the
differences says whether one is better; Holm's correction (Holm 1979, Scand. J. Statist. 6:65) holds
the probability of any wrong verdict below 5 %. A controller's rank is then at least one more than
the number of those that are better, and at most one more than that of those that are not worse:
simultaneous 95 % intervals of ranks (Al Mohamad, Goeman, van Zwet 2022, Biometrics 78:1,
doi 10.1111/biom.13419).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from scenarios.benchmark.definition import SCHEDULE
from scenarios.statistics import CONFIDENCE, Interval, mean_interval

if TYPE_CHECKING:
    import pandas as pd

#: The measure by which controllers are ranked: the smaller, the better.
RANKED = "delay_s"

#: What the least possible is.
LEAST = "least_delay_s"

#: Value of a controller by seed.
Values = Mapping[int, float]


class Standing(NamedTuple):
    """A controller among the others."""

    mean: Interval
    rank: int  #: by mean
    best: int  #: best … worst hold the true rank with 95 % confidence, for all together
    worst: int

    @property
    def words(self) -> str:
        """The rank with its interval."""
        among = "" if self.best == self.worst else f" ({self.best}–{self.worst})"
        return f"{self.rank}{among}"


def ranked(values: Mapping[str, Values]) -> dict[str, Standing]:
    """Standing of each controller, best first; the smaller values are the better ones."""
    means = {name: mean_interval(by_seed.values()) for name, by_seed in values.items()}
    order = sorted(values, key=lambda name: means[name].mean)
    beaten = _verdicts(values)
    standings = {}
    for place, name in enumerate(order, start=1):
        better = sum((other, name) in beaten for other in order)
        worse = sum((name, other) in beaten for other in order)
        standings[name] = Standing(means[name], place, 1 + better, len(order) - worse)
    return standings


def _verdicts(values: Mapping[str, Values]) -> set[tuple[str, str]]:
    """Pairs of which the first is better, by Holm's procedure."""
    chances = []
    for one, other in combinations(values, 2):
        common = [values[one][seed] - values[other][seed] for seed in values[one].keys() & values[other].keys()]
        if len(common) > 1:
            pair = (one, other) if math.fsum(common) < 0.0 else (other, one)
            chances.append((chance(common), pair))
    beaten = set()
    for k, (p, pair) in enumerate(sorted(chances)):
        if p > (1.0 - CONFIDENCE) / (len(chances) - k):
            break
        beaten.add(pair)
    return beaten


def chance(differences: Sequence[float]) -> float:
    """How probable a mean so far from 0 is by chance: two-sided paired t-test (Student 1908)."""
    from scipy.special import stdtr

    mean, half_width, count = mean_interval(differences)
    spread = float(np.std(differences, ddof=1))
    if spread == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    return 2.0 * float(stdtr(count - 1, -abs(mean) * math.sqrt(count) / spread))


def by_cell(rows: pd.DataFrame, measure: str = RANKED) -> dict[str, dict[str, dict[int, float]]]:
    """Cell -> controller -> seed -> value, of controllers that served all vehicles of all runs."""
    served = serving(rows)
    values: dict[str, dict[str, dict[int, float]]] = {}
    for (cell, name), runs in rows.groupby(["cell", "controller"], sort=False):
        if (cell, name) in served:
            column = runs.set_index("seed")[measure].astype(float).dropna()
            values.setdefault(cell, {})[name] = column.to_dict()
    return values


def serving(rows: pd.DataFrame) -> set[tuple[str, str]]:
    """Cells and controllers whose runs all went well: see `trouble`."""
    grouped = rows.groupby(["cell", "controller"], sort=False)
    return {key for key, runs in grouped if not trouble(runs)}


def trouble(runs: pd.DataFrame) -> str:
    """Why the runs of a controller in a cell do not count, in a few words; empty if they do."""
    failed = runs["error"].notna()
    if failed.any():
        return str(runs["error"][failed].iloc[0])
    for column, what in (("collisions", "collisions"), ("unfinished", "vehicles not served")):
        if count := int(runs[column].sum()):
            return f"{count} {what}"
    return ""


def overall(rows: pd.DataFrame, cells: Sequence[str]) -> dict[str, Standing]:
    """Standing over these cells, of controllers that served all: the mean log of delay/least.

    The exponential of a mean is the geometric mean over cells, which every cell's unit leaves the
    order of (Fleming and Wallace 1986, CACM 29:218). Cells without a known least delay are left
    out of it for all.
    """
    known = {c: v for c, v in by_cell(rows).items() if c in cells}
    least = {
        (cell, seed): value
        for cell, seed, value in rows[["cell", "seed", LEAST]].dropna().itertuples(index=False)
    }
    names = [name for name in dict.fromkeys(rows["controller"]) if name != SCHEDULE]
    served = [name for name in names if all(name in known.get(cell, ()) for cell in cells)]
    values: dict[str, dict[int, float]] = {name: {} for name in served}
    for seed in sorted(set(rows["seed"])):
        counted = [cell for cell in cells if least.get((cell, seed), 0.0) > 0.0]
        for name in served if counted else ():
            logs = [math.log(known[cell][name][seed] / least[cell, seed]) for cell in counted]
            values[name][seed] = math.fsum(logs) / len(logs)
    return ranked(values) if values else {}
