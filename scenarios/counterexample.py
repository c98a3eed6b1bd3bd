"""Turns a path on which the protocol is unsafe into arrivals that make simulated vehicles collide.

The model has no clock: it gives the order of the vehicles; we find out when the last has to come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dim import Dim
from dim.proofs.modelcheck import Path
from minisim.arrivals import Arrivals
from minisim.simulation import simulate
from scenarios.scenario import Scenario

#: The largest delay of the last vehicle [s]: longer than any drive from yellow zone to exit.
LATEST = 10.0

#: Simulated time after the last demand [s]: twice 500 m at 10 m/s.
PATIENCE = 100.0


def colliding_arrivals(scenario: Scenario, dim: Dim, paths: Sequence[Path]) -> Arrivals | None:
    """Arrivals in the order of one of `paths` that end in a collision; None if there are none.

    All vehicles want to enter the road at time 0, except the last one. It comes after the shortest
    delay that ends in a collision on any path. The scenario gives junction and profile, `dim` the
    rules under which the paths to unsafe states were found (`dim.proofs.modelcheck.explore`).
    """
    for step in range(round(LATEST / scenario.profile.dt)):
        for path in paths:
            arrivals = _table(path, step * scenario.profile.dt)
            replayed = replace(scenario, recorded=arrivals, horizon=LATEST + PATIENCE)
            if simulate(replayed, dim, on_collision="record").collisions:
                return arrivals
    return None


def _table(path: Path, delay: float) -> Arrivals:
    arrivals = [(event.lane, event.manoeuvre) for event in path if event.what == "arrive"]
    lane, manoeuvre = np.array(arrivals).T
    time = np.zeros(len(lane))
    time[-1] = round(delay, 6)
    return Arrivals(time, lane, manoeuvre)
