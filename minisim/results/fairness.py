"""Who waits, and who goes first: order reversals, and how unequal lanes are."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from minisim.errors import InputError, numbers
from minisim.results.tracks import entry_times
from minisim.results.trips import Floats, Trips

if TYPE_CHECKING:
    from minisim.results.run import Run


def order_reversals(run: Run) -> Floats:
    """How many vehicles on conflicting ways came later than each one but went first, shape (k,).

    These are slips (Larson 1987, Perspectives on queues, Operations Research 35:895). A vehicle
    comes when it would be at the junction at the limit, from its demand on; it goes when its front
    enters the junction. Raises `InputError` unless all of the time was recorded.
    """
    trips, site = run.columns, run.site
    paths = site.intersection.paths
    movement = site.intersection.movements.index_of[trips.lane, trips.manoeuvre]
    free = [(path.entry - path.start) / site.limit(path.movement.origin) for path in paths]
    comes, goes = trips.demand_time + np.array(free)[movement], entry_times(run)
    slips = np.zeros(len(movement))
    ways = [np.flatnonzero(movement == p) for p in range(len(paths))]
    for p, q in np.argwhere(site.conflicts).tolist():
        me, other = ways[p][:, None], ways[q]
        slips[ways[p]] += ((comes[other] > comes[me]) & (goes[other] < goes[me])).sum(axis=1)
    return slips


def gini(values: Iterable[float], weights: Iterable[float] | None = None) -> float:
    """Gini's coefficient Σᵢⱼ wᵢwⱼ|xᵢ − xⱼ| / (2 Σwᵢ Σwᵢxᵢ) (Gini 1912, mean difference form).

    It is 0 if all values are equal, and 1 − 1/n if one of n has everything. Weights have a sum > 0
    and are equal by default. `InputError` for no value, a negative one, or weights that do not fit.
    """
    xs = numbers("values", values)
    ws = (1.0,) * len(xs) if weights is None else numbers("weights", weights)
    if not xs or len(ws) != len(xs) or min(*xs, *ws) < 0.0 or not math.fsum(ws):
        raise InputError(f"Gini needs values ≥ 0 with a weight ≥ 0 each, got {xs} and {ws}")
    weighted = [*zip(ws, xs, strict=True)]
    total = math.fsum(w * x for w, x in weighted)
    if total == 0.0:
        return 0.0
    pairs = product(weighted, repeat=2)
    difference = math.fsum(wi * wj * abs(xi - xj) for (wi, xi), (wj, xj) in pairs)
    return difference / (2.0 * math.fsum(ws) * total)


def lane_gini(trips: Trips) -> float | None:
    """`gini` of the lanes' mean waiting, weighted by trips; None without trips."""
    means, weights = _lane_means(trips)
    return gini(means, weights) if weights else None


def worst_lane(trips: Trips) -> float | None:
    """Longest mean waiting of a lane [s]; None without trips."""
    return max(_lane_means(trips)[0], default=None)


def _lane_means(trips: Trips) -> tuple[list[float], list[int]]:
    """Mean waiting of each lane that had trips, with the unfinished ones [s]; and its trips."""
    lanes, index, came = np.unique(trips.lane, return_inverse=True, return_counts=True)
    entered = np.bincount(index, trips.departed, len(lanes))
    waits = np.bincount(index, trips.waiting_time * trips.departed, len(lanes))
    return (waits / np.maximum(entered, 1.0)).tolist(), came.tolist()
