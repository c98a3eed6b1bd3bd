"""All trips of a run as arrays. The definitions are SUMO's, so that results can be compared.

They come from SUMO's page Simulation/Output/TripInfo; `minisim.results.metrics.TABLE` lists them.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.engine.state import ARRIVED, WAITING, Records
from minisim.junction.movements import Movements

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class Trips(NamedTuple):
    """All trips of a run as columns in demand order, shape (k,) each; times in seconds.

    For a trip that has not ended, `waiting_time`, `travel_time`, `time_loss` and `depart_delay`
    hold what has accumulated up to `end`. Means are over the trips demanded from `start` on.
    """

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
    end: float
    start: float = 0.0

    def taken(self, rows: Ints | slice) -> Trips:
        """Some of the trips, by index."""
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in TRIP_ARRAYS}
        return self._replace(**columns)

    def counted(self, start: float) -> slice:
        """Indices of the trips demanded from `start` [s] to before the end."""
        return slice(*self.demand_time.searchsorted((start, self.end)).tolist())


#: The columns among the fields of `Trips`.
TRIP_ARRAYS: Final = Trips._fields[:-2]


def collect_trips(
    vehicles: Records, demand_time: Floats, movements: Movements, dt: float, end: float
) -> Trips:
    """Build, from its vehicle array, the trips of a run that has reached `end` [s]."""
    rows = vehicles[np.argsort(vehicles["id"], kind="stable")]
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
