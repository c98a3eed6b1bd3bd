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
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from scenarios.benchmark.definition import SCHEDULE
from scenarios.optimum import DELAY
from scenarios.optimum import LEAST as LEAST_DELAY
from scenarios.statistics import CONFIDENCE, Interval, mean_interval

if TYPE_CHECKING:
    import pandas as pd

#: The measure by which controllers are ranked: the smaller, the better.
RANKED = DELAY.name

#: What the least possible is.
LEAST = LEAST_DELAY.name

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
        both = sorted(values[one].keys() & values[other].keys())
        common = [values[one][seed] - values[other][seed] for seed in both]
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

    mean, _, count = mean_interval(differences)
    spread = float(np.std(differences, ddof=1))
    if spread == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    return 2.0 * float(stdtr(count - 1, -abs(mean) * math.sqrt(count) / spread))


def by_cell(rows: pd.DataFrame, measure: str = RANKED) -> dict[str, dict[str, dict[int, float]]]:
    """Cell -> controller -> seed -> value, of controllers whose runs all count (`trouble`)."""
    values: dict[str, dict[str, dict[int, float]]] = {}
    for cell, name, runs in groups(rows):
        if not trouble(runs):
            pairs = zip(runs["seed"].tolist(), runs[measure].astype(float).tolist(), strict=True)
            values.setdefault(cell, {})[name] = dict(pairs)
    return values


def groups(rows: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """The runs of each controller in each cell, in order."""
    for (cell, name), runs in rows.groupby(["cell", "controller"], sort=False):
        yield str(cell), str(name), runs


def trouble(runs: pd.DataFrame) -> str:
    """Why the runs of a controller in a cell do not count, in a few words; empty if they do."""
    failed = runs["error"].notna()
    if failed.any():
        return str(runs["error"][failed].iloc[0])
    for column, what in (("collisions", "collisions"), ("unfinished", "vehicles not served")):
        if count := int(runs[column].sum()):
            return f"{count} {what}"
    return ""


def scores(rows: pd.DataFrame, cells: Sequence[str]) -> dict[str, dict[int, float]]:
    """Controller -> seed -> mean over these cells of log(delay/least), if it served all of them.

    The exponential is a geometric mean, which ranks controllers alike in any unit (Fleming and
    Wallace 1986, CACM 29:218). Cells without a known least delay are left out for all.
    """
    known = by_cell(rows)
    least = {
        (cell, seed): value
        for cell, seed, value in rows[["cell", "seed", LEAST]].dropna().itertuples(index=False)
        if cell in cells and value > 0.0
    }
    values: dict[str, dict[int, float]] = {}
    for name in dict.fromkeys(rows["controller"]):
        if all(name in known.get(cell, ()) for cell in cells):
            for seed in sorted({seed for _, seed in least}):
                logs = [math.log(known[c][name][seed] / least[c, s]) for c, s in least if s == seed]
                values.setdefault(name, {})[seed] = math.fsum(logs) / len(logs)
    return values


def overall(rows: pd.DataFrame, cells: Sequence[str]) -> dict[str, Standing]:
    """Standing by `scores`, best first; a schedule that knows all arrivals has none."""
    return ranked({name: it for name, it in scores(rows, cells).items() if name != SCHEDULE})
