"""Human drivers among vehicles of DIM, from none to all."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

from scenarios.controllers import label_of
from scenarios.statistics import Interval, mean_interval
from scenarios.studies.shared.points import fair
from scenarios.studies.shared.study import TOTAL_DELAY, Results, Study, with_total_delay
from scenarios.sweep.cells import pairs

if TYPE_CHECKING:
    import pandas as pd

#: Shares of human drivers.
SHARES = tuple(k / 10.0 for k in range(11))
#: Demands [veh/h/lane]: a moderate one, up to one that only saturated lanes can serve.
DENSITIES = (150.0, 250.0, 350.0, 500.0)
#: Gates of DIM; where humans come, every gate lets vehicles in beside those in harmony.
GATES = ("dim", "dim:gate=harmonious")
#: The controller that humans alone are compared with.
STOP = "all-way-stop"


def against_humans(rows: pd.DataFrame) -> dict[tuple[str, float, float], Interval]:
    """Total delay of a mixture less that of humans alone: (gate, demand, share) -> mean [s]."""
    rows = with_total_delay(rows).assign(drivers=rows["humans"].map("{:g}".format))
    return {
        (gate, demand, share): mean_interval(values)
        for share in SHARES[:-1]
        for (gate, demand), values in pairs(
            rows, TOTAL_DELAY, "drivers", (f"{share:g}", "1"), ["series", "density"]
        ).items()
        if len(values) > 1
    }


def verdict(results: Results) -> str:
    """Whether a mixture is ever slower than humans alone."""
    known = {} if results.good.empty else against_humans(results.good)
    if not known:
        made_by = results.effort.command("humans")
        return f"Whether humans alone are faster than a mixture is not known: run {made_by}."
    slower = [cell for cell, it in known.items() if it.mean > it.half_width]
    gate, demand, share = cell = max(known, key=lambda cell: known[cell].mean)
    return (
        f"Slower than humans alone, with 95 % confidence each, are {len(slower)} of {len(known)} "
        f"mixtures with DIM. The slowest beside them loses {known[cell].mean:.1f} ± "
        f"{known[cell].half_width:.1f} s more ({label_of(gate)}, {demand:g} veh/h/lane, "
        f"{share:.0%} humans)."
    )


STUDY = Study(
    "humans",
    "How much delay do human drivers cause, and is a mixture slower than humans alone?",
    (
        *(
            fair(gate, 4, density, share)
            for density, gate, share in product(DENSITIES, GATES, SHARES)
        ),
        *(fair(STOP, 4, density) for density in DENSITIES),
    ),
    verdict=verdict,
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
