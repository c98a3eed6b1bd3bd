"""The paper's grid as its text prescribes it."""

from __future__ import annotations

from scenarios.paper import BASELINE_GRID, GRID, SERIES, Cell
from scenarios.studies.shared.paper_comparison import agreement
from scenarios.studies.shared.points import ControllerPoint
from scenarios.studies.shared.study import Study

#: The text's rules for unbalanced inflow: "the lane priorities are set according to the incoming
#: traffic", and the greens of its table, equal for every lane (§ Comparison Models).
UNBALANCED = {"dim": "dim:priorities=inflow", "fixed-time": "fixed-time:equal_greens=true"}


def point_of(cell: Cell) -> ControllerPoint:
    """A published cell with the rules and parameters of the text."""
    series = SERIES[cell.controller]
    controller = series if cell.split == "balanced" else UNBALANCED.get(series, series)
    return ControllerPoint("paper", series, controller, cell.arms, cell.split, float(cell.density))


STUDY = Study(
    "text",
    "What do the paper's rules and parameters give, as its text prescribes them?",
    tuple(map(point_of, (*GRID, *BASELINE_GRID))),
    verdict=agreement,
)
