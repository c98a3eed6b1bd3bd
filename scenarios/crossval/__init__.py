"""minisim, SUMO and the paper on common arrivals.

Both hosts simulate a cell with the same arrivals and the same controller, so that a difference is
one of physics; where the cell replays a published run, the paper's numbers stand beside them.
"""

from scenarios.crossval.cases import Case, drawn_cases, replayed_cases
from scenarios.crossval.report import write_report
from scenarios.crossval.results import Result
from scenarios.crossval.runs import crossvalidate, film

__all__ = [
    "Case",
    "Result",
    "crossvalidate",
    "drawn_cases",
    "film",
    "replayed_cases",
    "write_report",
]
