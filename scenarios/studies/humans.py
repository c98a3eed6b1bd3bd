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
#: Demands [veh/h/lane]: a moderate one, and one near the capacity of humans alone.
DENSITIES = (150.0, 250.0)
#: The controller that humans alone are compared with.
STOP = "all-way-stop"

STUDY = Study(
    "humans",
    "How much delay do human drivers cause, and to which vehicles?",
    (
        *(
            fair(gate, 4, density, share)
            for density, gate, share in product(DENSITIES, GATES, SHARES)
        ),
        *(fair(STOP, 4, density) for density in DENSITIES),
    ),
)


def delays(rows: pd.DataFrame, group: str) -> pd.Series[float]:
    """Time loss and departure delay [s] of "human" or "automated" vehicles, one value per row.

    NaN if there is no such vehicle.
    """
    import pandas as pd

    parts = pd.DataFrame(index=rows.index)
    for metric in ("complete_time_loss_s", "complete_depart_delay_s"):
        column = rows.get(f"kinds_{group}_{metric}", pd.Series(index=rows.index, dtype=float))
        alone = rows[metric].where((rows["humans"] == 0.0) & (group == "automated"))
        parts[metric] = column.astype(float).fillna(alone)
    return parts.sum(axis=1, skipna=False)
