"""From a path on which the protocol is unsafe to arrivals with which simulated vehicles collide.

The model knows no seconds. It says who comes, in which order, and that the last one comes when the
ones before it are on their way; the simulator finds out when that is.
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

#: The last vehicle comes so much later than those before it, at most [s]: longer than anybody
#: takes from the start of the yellow zone through the junction.
LATEST = 10.0

#: Simulated time after the last demand [s]: twice 500 m at 10 m/s.
PATIENCE = 100.0


def colliding_arrivals(scenario: Scenario, dim: Dim, paths: Sequence[Path]) -> Arrivals | None:
    """Arrivals in the order of one of `paths` that end in a collision, or None: there are none.

    All vehicles but the last want to enter the road at time 0. The last one comes later, by as
    many steps as it takes: the shortest delay that ends in a collision on any path.

    Args:
        scenario: junction and profile; its demand is not used.
        dim: the rules of the paths.
        paths: to unsafe states (`dim.proofs.modelcheck.explore`).
    """
    for step in range(round(LATEST / scenario.profile.dt)):
        for path in paths:
            arrivals = _table(path, step * scenario.profile.dt)
            replayed = replace(scenario, recorded=arrivals, horizon=LATEST + PATIENCE)
            if simulate(replayed, dim, on_collision="record").collisions:
                return arrivals
    return None


def _table(path: Path, delay: float) -> Arrivals:
    comers = [(event.lane, event.manoeuvre) for event in path if event.what == "arrive"]
    lane, manoeuvre = (np.array(column) for column in zip(*comers, strict=True))
    time = np.zeros(len(lane))
    time[-1] = round(delay, 6)
    return Arrivals(time, lane, manoeuvre)
