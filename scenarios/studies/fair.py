"""Every controller on equal terms, and the demands at which DIM does worse than another."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from scenarios.controllers import RIVALS
from scenarios.studies.shared.crossing import (
    Crossing,
    crossing,
    paired_differences,
)
from scenarios.studies.shared.delay import MEASURES, with_total_delay
from scenarios.studies.shared.points import fair_grid
from scenarios.studies.shared.study import Study

if TYPE_CHECKING:
    import pandas as pd

#: DIM with either gate, and what it may lose to.
GATES = ("dim", "dim:gate=harmonious")
OTHERS = tuple(name for name in RIVALS if name not in GATES)

#: From nearly free flow to far beyond the capacity of every controller [veh/h/lane].
DENSITIES = (50, 100, 150, 200, 250, 300, 350, 400, 500, 600, 700, 800)

STUDY = Study(
    "fair",
    "Which controller is best with one vehicle and speed limit for all?",
    fair_grid(RIVALS, (4,), DENSITIES),
)


def losses(rows: pd.DataFrame) -> dict[tuple[str, str, str], Crossing]:
    """From which demand on DIM does worse: (measure, gate, rival) -> crossing.

    Pairs without two demands in common are left out.
    """
    rows = with_total_delay(rows)
    known = {}
    for (measure, column), gate, rival in product(MEASURES.items(), GATES, OTHERS):
        differences = paired_differences(rows, gate, rival, column)
        if len(differences) > 1:
            known[measure, gate, rival] = crossing(differences)
    return known
