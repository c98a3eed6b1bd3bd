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
#: A table by the names of its columns.
Columns = dict[str, npt.NDArray[Any]]


class Trips(NamedTuple):
    """Trips of a run as columns in demand order, shape (k,) each; times in seconds.

    For a trip that has not ended, `waiting_time`, `travel_time`, `time_loss` and `depart_delay`
    hold what has accumulated up to `end`. `start` is the end of a warm-up that has been left out.
    """

    vehicle: Ints
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
    type: Ints  #: index into the types of the site
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
    """The trips of a run that has reached `end` [s], from its vehicles in the order of demand."""
    return trips_of(
        demand_time, vehicles["lane"], vehicles["manoeuvre"], vehicles["type"], movements, end,
        depart=np.where(vehicles["status"] != WAITING, vehicles["depart_tick"] * dt, np.nan),
        arrival=np.where(vehicles["status"] == ARRIVED, vehicles["arrival_tick"] * dt, np.nan),
        waiting_time=vehicles["waiting_ticks"] * dt, time_loss=vehicles["lost_ticks"] * dt,
    )  # fmt: skip


def trips_of(
    demand_time: Floats, lane: Ints, manoeuvre: Ints, type: Ints, movements: Movements, end: float,
    *,
    depart: Floats, arrival: Floats, waiting_time: Floats, time_loss: Floats,
) -> Trips:  # fmt: skip
    """Trips from what a host has measured up to `end` [s]; times not reached are NaN."""
    departed, arrived = ~np.isnan(depart), ~np.isnan(arrival)
    travel = np.where(arrived, arrival, end) - depart
    return Trips(
        end=end, vehicle=np.arange(len(lane)), demand_time=demand_time, depart=depart,
        arrival=arrival, lane=lane.copy(), manoeuvre=manoeuvre.copy(),
        exit_lane=movements.exits[movements.index_of[lane, manoeuvre]],
        waiting_time=waiting_time, travel_time=np.where(departed, travel, 0.0),
        time_loss=time_loss,
        depart_delay=np.maximum(np.where(departed, depart, end) - demand_time, 0.0),
        departed=departed, arrived=arrived, type=type.copy(),
    )  # fmt: skip


def queue_growth(demand_time: Floats, leave: Floats, end: float, start: float = 0.0) -> float:
    """How many more vehicles were present in the last quarter of a run than in the second.

    A vehicle is present from demand to arrival, so queues before the road count too. The numbers
    are means over a quarter, which evens out the swing of a signal's cycle.
    `scenarios.statistics.growing` tells whether growth is more than chance. Arrays have shape (k,);
    times are in s, from `start`, the end of the warm-up; `leave` is infinite if not reached.
    """
    length = (end - start) / 4.0
    if length <= 0.0:  # the run was stopped during its warm-up
        return 0.0

    def present(quarter: int) -> float:
        first = start + length * quarter
        time = np.minimum(leave, first + length) - np.maximum(demand_time, first)
        return float(np.maximum(time, 0.0).sum()) / length

    return present(3) - present(1)
