"""How evenly a priority rule spreads waiting over the lanes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from minisim.junction.movements import ARM_NAMES
from minisim.results.fairness import gini
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


def lane_waits(rows: pd.DataFrame, arms: int) -> pd.DataFrame:
    """Add the longest mean wait of a lane and the Gini coefficient of all, weighted by trips."""
    lanes = ARM_NAMES[:arms]
    waits = rows[[LANE_WAIT.format(lane) for lane in lanes]].astype(float).fillna(0.0)
    trips = rows[[f"lanes_{lane}_trips" for lane in lanes]].astype(float)
    return rows.assign(
        worst_lane_s=waits.max(axis=1),
        gini=[*map(gini, waits.to_numpy().tolist(), trips.to_numpy().tolist())],
    )
