"""minisim, SUMO and the paper on common arrivals.

Both hosts simulate a cell with the same arrivals and the same controller, so that a difference is
one of physics. Where the cell replays a published run, the paper's numbers stand beside theirs.
"""

from scenarios.crossval.cases import Case, replayed_cases
from scenarios.crossval.report import write_report
from scenarios.crossval.results import Result
from scenarios.crossval.runs import crossvalidate, film

__all__ = [
    "Case",
    "Result",
    "crossvalidate",
    "film",
    "replayed_cases",
    "write_report",
]
