"""How human drivers fare beside the other vehicles of a run."""

from __future__ import annotations

from typing import Any

from dim import Mixed
from minisim.results.run import Run
from minisim.results.trips import group_means


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
