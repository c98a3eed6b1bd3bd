"""The paper's gate, which waits until the junction is clear, against those that do not."""

from __future__ import annotations

from scenarios.paper import DENSITIES
from scenarios.studies.fair import GATES
from scenarios.studies.shared.points import fair_grid
from scenarios.studies.shared.study import Study

STUDY = Study(
    "gate",
    "What does entering beside crossing vehicles gain?",
    fair_grid(GATES, (3, 4, 5), DENSITIES),
)
