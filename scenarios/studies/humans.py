"""Human drivers among vehicles of DIM, from none to all."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from scenarios.studies.fair import GATES
from scenarios.studies.shared.points import fair
from scenarios.studies.shared.study import Study

if TYPE_CHECKING:
    import pandas as pd

#: Shares of human drivers.
SHARES = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
#: Demands at which they are compared [veh/h/lane]: moderate, and near what humans alone can do.
DENSITIES = (150.0, 250.0)
#: What humans alone are compared with.
STOP = "all-way-stop"

STUDY = Study(
    "humans",
    "What do human drivers cost, and whom?",
    (
        *(
            fair(gate, 4, density, share)
            for density, gate, share in product(DENSITIES, GATES, SHARES)
        ),
        *(fair(STOP, 4, density) for density in DENSITIES),
    ),
)


def delays(rows: pd.DataFrame, group: str) -> pd.Series[float]:
    """Time loss and departure delay of a group in each row [s]; NaN where it has no vehicle.

    Args:
        rows: of the study.
        group: "human" or "automated".
    """
    import pandas as pd

    parts = pd.DataFrame(index=rows.index)
    for metric in ("complete_time_loss_s", "complete_depart_delay_s"):
        column = rows.get(f"kinds_{group}_{metric}", pd.Series(index=rows.index, dtype=float))
        alone = rows[metric].where((rows["humans"] == 0.0) & (group == "automated"))
        parts[metric] = column.astype(float).fillna(alone)
    return parts.sum(axis=1, skipna=False)
