"""What "worse" may mean."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

#: Sum of time loss and departure delay, a column of `with_total_delay`.
TOTAL_DELAY = "total_delay_s"

#: Measure -> column of `with_total_delay`. The complete forms, which count what vehicles still on
#: the road have waited and lost; the others flatter a controller that serves few.
MEASURES: Mapping[str, str] = MappingProxyType({
    "waiting time": "complete_waiting_time_s",
    "time loss": "complete_time_loss_s",
    "time loss and departure delay": TOTAL_DELAY,
})  # fmt: skip


def with_total_delay(rows: pd.DataFrame) -> pd.DataFrame:
    """Add `total_delay_s`: mean time loss on the road plus mean departure delay, both complete.

    SUMO's total delay, but with the vehicles that have not arrived, and those not even departed.
    """
    lost, late = (
        rows[column].astype(float) for column in ("complete_time_loss_s", "complete_depart_delay_s")
    )
    return rows.assign(total_delay_s=lost + late)
