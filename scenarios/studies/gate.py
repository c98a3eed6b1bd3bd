"""The paper's gate, which waits until the junction is clear, against the harmonious one."""

from __future__ import annotations

from scenarios.paper import DENSITIES
from scenarios.studies.fair import GATES
from scenarios.studies.shared.points import fair_grid
from scenarios.studies.shared.study import Study

STUDY = Study(
    "gate",
    "What does entering beside crossing vehicles in harmony gain?",
    fair_grid(GATES, (3, 4, 5), DENSITIES),
)
