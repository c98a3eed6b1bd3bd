"""What the delay of DIM consists of: the least possible, and what each cause adds to it.

The same arrivals are driven again and again, each time with one cause more. A part of the delay is
the difference that a cause makes, so the parts of a controller add up to its delay, seed by seed.
A part may be negative.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from scenarios.optimum import DELAY, LEAST
from scenarios.studies.optimum import DENSITIES, HARMLESS, SCHEDULE, DrainedPoint
from scenarios.studies.shared.study import Study

if TYPE_CHECKING:
    import pandas as pd

#: Vehicles that drive through each other at the limits of the roads.
FREE = "unregulated"
RESERVATION = "reservation"
CLEAR, HARMONIOUS, PASSED = "dim", "dim:gate=harmonious", "dim:gate=passed"


def _fair(gate: str) -> str:
    """A gate with the priorities that wait longest first."""
    return f"{gate}{',' if ':' in gate else ':'}priorities=waiting"


class Part(NamedTuple):
    """A cause of delay."""

    label: str
    weights: Mapping[str, int]  #: its delay is the sum of those of these series, each times this


_LEAST = Part("least possible", {LEAST.name: 1})
_FOLLOWING = Part("following and merging", {FREE: 1, LEAST.name: -1})
_CONFLICTS = Part("conflicts, in the best order", {SCHEDULE: 1, FREE: -1})
_ASKED = Part("first come, first served", {RESERVATION: 1, SCHEDULE: -1})
_ZONES = Part("slow zones", {HARMLESS: 1, FREE: -1})
_ALONE = Part(
    "decided at the line, without messages",
    {_fair(PASSED): 1, HARMLESS: -1, RESERVATION: -1, FREE: 1},
)
_HARMONY = Part("waits for those out of its way", {_fair(HARMONIOUS): 1, _fair(PASSED): -1})
_EMPTY = Part("waits for those in harmony", {_fair(CLEAR): 1, _fair(HARMONIOUS): -1})
_MESSAGES = (_LEAST, _FOLLOWING, _CONFLICTS, _ASKED)
_COMMON = (*_MESSAGES, _ZONES, _ALONE)


#: The one cause that differs between gates: what a fixed order of the lanes adds.
ORDER = "lane a before b before c …"


def _order(gate: str) -> Part:
    return Part(ORDER, {gate: 1, _fair(gate): -1})


#: Controller -> the parts that add up to its delay.
PARTS: Mapping[str, tuple[Part, ...]] = {
    SCHEDULE: _MESSAGES[:3],
    RESERVATION: _MESSAGES,
    PASSED: (*_COMMON, _order(PASSED)),
    HARMONIOUS: (*_COMMON, _HARMONY, _order(HARMONIOUS)),
    CLEAR: (*_COMMON, _HARMONY, _EMPTY, _order(CLEAR)),
}

#: What is run.
SERIES = (FREE, HARMLESS, *PARTS, *map(_fair, (PASSED, HARMONIOUS, CLEAR)))


def delays(rows: pd.DataFrame) -> pd.DataFrame:
    """Mean delays [s]: a row per arms, density and seed; a column per series, and the least delay.

    Where a run is missing, or a vehicle has not arrived, the row is left out.
    """
    where = ["arms", "density", "seed"]
    known = rows[rows[LEAST.name].notna()].astype({LEAST.name: float, DELAY.name: float})
    table = known.pivot(index=where, columns="series", values=DELAY.name).reindex(columns=SERIES)
    table[LEAST.name] = known.groupby(where)[LEAST.name].first()
    return table.dropna()


def seconds(part: Part, table: pd.DataFrame) -> pd.Series[float]:
    """The delay that a cause adds [s], row by row of `delays`."""
    return table[[*part.weights]].mul(np.array([*part.weights.values()])).sum(axis=1)


STUDY = Study(
    "gap",
    "What does the delay of DIM above the least possible consist of?",
    tuple(
        DrainedPoint(name, arms, density)
        for arms, density, name in product((3, 4, 5), DENSITIES, SERIES)
    ),
    about_collisions=True,
)
