"""How evenly a rule of priority spreads waiting over the lanes."""

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

#: Rules of priority that need no communication.
PRIORITIES = ("dim", "dim:priorities=rotating", "dim:priorities=waiting")

STUDY = Study(
    "fairness",
    "Which lanes wait under which rule of priority?",
    fair_grid(PRIORITIES, (4,), DENSITIES),
)

#: Column of a sweep that holds a lane's mean waiting time, the complete form: what the vehicles
#: still on the road have waited counts, or a starved lane would look served.
LANE_WAIT = "lanes_{}_complete_waiting_time_s"
LANE_TRIPS = "lanes_{}_trips"


def gini(values: Iterable[float], weights: Iterable[float] | None = None) -> float:
    """Gini's coefficient Σᵢⱼ wᵢwⱼ|xᵢ − xⱼ| / (2 Σwᵢ Σwᵢxᵢ) (Gini 1912, mean difference form).

    0 where all are equal, or all are 0; 1 − 1/n where one of n has everything.

    Args:
        values: ≥ 0.
        weights: > 0 in sum, such as the trips behind each mean; equal by default.

    Raises:
        InputError: no value, a negative one, or weights that do not match.
    """
    xs = numbers("values", values)
    ws = (1.0,) * len(xs) if weights is None else numbers("weights", weights)
    if not xs or len(ws) != len(xs) or min(*xs, *ws) < 0.0 or not math.fsum(ws):
        raise InputError(f"Gini needs values ≥ 0 with a weight ≥ 0 each, got {xs} and {ws}")
    total = math.fsum(w * x for w, x in zip(ws, xs, strict=True))
    if total == 0.0:
        return 0.0
    pairs = product(zip(ws, xs, strict=True), repeat=2)
    difference = math.fsum(wi * wj * abs(xi - xj) for (wi, xi), (wj, xj) in pairs)
    return difference / (2.0 * math.fsum(ws) * total)


def lane_waits(rows: pd.DataFrame, arms: int) -> pd.DataFrame:
    """Add `worst_lane_s`, the longest of the lanes' mean waits, and `gini` of them to a sweep.

    The lanes' means are weighted by their trips. Rows of failed runs are left out.
    """
    good = rows[rows["error"].isna()]
    lanes = ARM_NAMES[:arms]
    waits = good[[LANE_WAIT.format(lane) for lane in lanes]].astype(float).fillna(0.0)
    trips = good[[LANE_TRIPS.format(lane) for lane in lanes]].astype(float)
    return good.assign(
        worst_lane_s=waits.max(axis=1),
        gini=[*map(gini, waits.to_numpy().tolist(), trips.to_numpy().tolist())],
    )
