"""Human drivers among the vehicles of a run: who they are, and how they fare beside the others."""

from __future__ import annotations

from typing import Any

from dim import Dim, Mixed
from minisim.control import Controller
from minisim.errors import InputError, number
from minisim.results.run import Run
from minisim.results.trips import group_means


def with_humans(controller: Controller, share: float) -> Controller:
    """The controller with a share of human drivers, 0 … 1; with none it is the controller itself.

    Raises:
        InputError: a share out of range, or humans where the controller is not DIM.
    """
    share = number("share of humans", share, low=0, high=1)
    if share == 0.0:
        return controller
    if not isinstance(controller, Dim):
        raise InputError(
            f"humans drive among vehicles of DIM (dim with any parameters), not with "
            f"{controller.name!r}"
        )
    return Mixed(controller, share)


def driver_means(run: Run) -> dict[str, dict[str, Any]]:
    """Means of human drivers (`human`) and of the others (`automated`) in one run.

    Empty without humans. Keys of each group as in `minisim.results.trips.group_means`.
    """
    if not isinstance(run.controller, Mixed):
        return {}
    human = run.controller.human(run.seed, len(run.columns.lane))
    return {
        "human": group_means(run.columns, human),
        "automated": group_means(run.columns, ~human),
    }
