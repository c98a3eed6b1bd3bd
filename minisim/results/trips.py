"""The trip table and its metrics, with SUMO's definitions so that they compare.

Waiting time: Σ dt with v ≤ 0.1 m/s. Time loss: Σ (1 − v/v_allowed) dt, v_allowed the limit where
the vehicle is. Travel time: from insertion to leaving. Departure delay: from demand to insertion.
(SUMO, Simulation/Output/TripInfo.)

Every mean comes in two forms. SUMO's, which the paper used, is over the trips that ended before
the horizon. The complete one is over all demanded trips: what a trip that has not ended has
waited, lost and travelled up to the horizon counts, and so does the departure delay of a vehicle
that never got on the road.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.engine.state import ARRIVED, WAITING, Records
from minisim.junction.movements import ARM_NAMES, Movements

if TYPE_CHECKING:
    import pandas as pd

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

#: Columns of the trip table, the same in CSV. Times in seconds, NaN where not reached.
TRIP_COLUMNS: Final = (
    "demand_time_s",
    "depart_s",
    "arrival_s",
    "lane",
    "manoeuvre",
    "exit_lane",
    "waiting_time_s",
    "travel_time_s",
    "time_loss_s",
    "depart_delay_s",
)

#: The metrics that are averaged.
METRICS: Final = ("waiting_time_s", "travel_time_s", "time_loss_s", "depart_delay_s")


class Trips(NamedTuple):
    """All trips of a run as columns in demand order, shape (k,) each; times in seconds.

    `waiting_time`, `travel_time`, `time_loss` and `depart_delay` of a trip that has not ended
    are what it has gathered up to `end`; `arrived` and `departed` tell which have.
    """

    end: float
    demand_time: Floats
    depart: Floats
    arrival: Floats
    lane: Ints
    manoeuvre: Ints
    exit_lane: Ints
    waiting_time: Floats
    travel_time: Floats
    time_loss: Floats
    depart_delay: Floats
    departed: npt.NDArray[np.bool_]
    arrived: npt.NDArray[np.bool_]

    def metric(self, name: str) -> Floats:
        """The column of one of `METRICS`."""
        column: Floats = getattr(self, name.removesuffix("_s"))
        return column


def collect_trips(
    vehicles: Records, demand_time: Floats, movements: Movements, dt: float, end: float
) -> Trips:
    """Build the trips of a run that has reached `end` [s] from its vehicle array."""
    order = np.argsort(vehicles["id"], kind="stable")
    rows = vehicles[order]
    departed = rows["status"] != WAITING
    arrived = rows["status"] == ARRIVED
    depart = np.where(departed, rows["depart_tick"] * dt, np.nan)
    arrival = np.where(arrived, rows["arrival_tick"] * dt, np.nan)
    travel = np.where(arrived, arrival, end) - depart
    return Trips(
        end=end,
        demand_time=demand_time,
        depart=depart,
        arrival=arrival,
        lane=rows["lane"].copy(),
        manoeuvre=rows["manoeuvre"].copy(),
        exit_lane=movements.exits[rows["path"]],
        waiting_time=rows["waiting_ticks"] * dt,
        travel_time=np.where(departed, travel, 0.0),
        time_loss=rows["lost_ticks"] * dt,
        depart_delay=np.maximum(np.where(departed, depart, end) - demand_time, 0.0),
        departed=departed,
        arrived=arrived,
    )


def trip_table(trips: Trips) -> pd.DataFrame:
    """The trips as a DataFrame with `TRIP_COLUMNS`; what has not ended is NaN."""
    import pandas as pd

    names = np.array(list(ARM_NAMES))
    ended = np.where(trips.arrived, 1.0, np.nan)
    columns = (
        trips.demand_time,
        trips.depart,
        trips.arrival,
        names[trips.lane],
        trips.manoeuvre,
        names[trips.exit_lane],
        trips.waiting_time * ended,
        trips.travel_time * ended,
        trips.time_loss * ended,
        np.where(trips.departed, trips.depart_delay, np.nan),
    )
    return pd.DataFrame(
        {
            name: np.round(column, 6) if column.dtype.kind == "f" else column
            for name, column in zip(TRIP_COLUMNS, columns, strict=True)
        }
    )


def summarise(trips: Trips, n: int) -> dict[str, Any]:
    """Means of a run: SUMO's form at the top and by lane, the complete form under `complete`.

    Keys: `trips` (demanded), `unfinished`, the `METRICS` (None where no trip ended), `lanes`.
    """
    demanded = trips.demand_time <= trips.end
    return {
        "trips": int(demanded.sum()),
        "unfinished": int((demanded & ~trips.arrived).sum()),
        **_means(trips, trips.arrived),
        "lanes": {ARM_NAMES[i]: _lane(trips, demanded & (trips.lane == i)) for i in range(n)},
        "complete": _complete(trips, demanded),
    }


def group_means(trips: Trips, chosen: npt.NDArray[np.bool_]) -> dict[str, Any]:
    """Means of some trips of a run in both forms, as `summarise` gives them of all.

    Args:
        trips: of the run.
        chosen: which, shape (k,); only those demanded before the end count.
    """
    return _lane(trips, chosen & (trips.demand_time <= trips.end))


def _lane(trips: Trips, chosen: npt.NDArray[np.bool_]) -> dict[str, Any]:
    return {
        "trips": int(chosen.sum()),
        "unfinished": int((chosen & ~trips.arrived).sum()),
        **_means(trips, chosen & trips.arrived),
        "complete": _complete(trips, chosen),
    }


def _complete(trips: Trips, chosen: npt.NDArray[np.bool_]) -> dict[str, float | None]:
    return {**_means(trips, chosen & trips.departed), **_means(trips, chosen, "depart_delay_s")}


def _means(trips: Trips, chosen: npt.NDArray[np.bool_], *names: str) -> dict[str, float | None]:
    return {name: _mean(trips.metric(name)[chosen]) for name in names or METRICS}


def _mean(values: Floats) -> float | None:
    return math.fsum(values.tolist()) / len(values) if len(values) else None
