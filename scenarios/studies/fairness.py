"""How evenly a priority rule spreads waiting over the lanes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import product
from typing import TYPE_CHECKING

from minisim.errors import InputError, numbers
from minisim.junction.movements import ARM_NAMES
from scenarios.paper import DENSITIES
from scenarios.studies.shared.points import fair_grid
from scenarios.studies.shared.study import Study

if TYPE_CHECKING:
    import pandas as pd

#: Priority rules that need no communication.
PRIORITIES = ("dim", "dim:priorities=rotating", "dim:priorities=waiting")

STUDY = Study(
    "fairness", "Which lanes wait under which priority?", fair_grid(PRIORITIES, (4,), DENSITIES)
)

#: Column of a lane's mean waiting, in the complete form, or a starved lane would look served.
LANE_WAIT = "lanes_{}_complete_waiting_time_s"


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


def lane_waits(rows: pd.DataFrame, arms: int) -> pd.DataFrame:
    """Add the longest mean wait of a lane and the Gini coefficient of all, weighted by trips."""
    lanes = ARM_NAMES[:arms]
    waits = rows[[LANE_WAIT.format(lane) for lane in lanes]].astype(float).fillna(0.0)
    trips = rows[[f"lanes_{lane}_trips" for lane in lanes]].astype(float)
    return rows.assign(
        worst_lane_s=waits.max(axis=1),
        gini=[*map(gini, waits.to_numpy().tolist(), trips.to_numpy().tolist())],
    )
