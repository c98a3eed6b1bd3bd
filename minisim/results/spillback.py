"""Queues that reach the end of their road, so that vehicles have to wait before it."""

from __future__ import annotations

import math

import numpy as np

from minisim.control import Site
from minisim.results.trips import Trips
from minisim.vehicle import VehicleType

#: How far slow drivers are below the mean speed, in standard deviations (1 in 740 is slower), and
#: the least share of the limit that a driver keeps (SUMO's; see `VehicleType.speed_deviation`).
SLOW, SLOWEST = 3.0, 0.2


def clearing_time(vehicle: VehicleType, limit: float) -> float:
    """The longest that a vehicle which drives on keeps the next one from entering a road [s].

    That is the headway T, and the time from rest to drive its length and the gap, l + s₀, with its
    acceleration a up to the speed v of a slow driver under the `limit` [m/s]: √(2(l + s₀)/a), or
    (l + s₀)/v + v/2a where that speed is reached.
    """
    room, a = vehicle.length + vehicle.min_gap, vehicle.acceleration
    factor = max(1.0 - SLOW * vehicle.speed_deviation, SLOWEST)
    v = min(limit * factor, math.sqrt(2.0 * room * a))
    return room / v + v / (2.0 * a) + vehicle.headway


def spillback(trips: Trips, site: Site, start: float = 0.0) -> dict[int, float]:
    """When the queue of a lane first reached the end of its road, from `start` [s] on.

    It did if a vehicle had to wait longer than `clearing_time` and a step, from when it had come
    and the one before it had entered: that one did not drive on. What a burst of arrivals holds
    back enters sooner.

    Args:
        trips: of a run, including those before the warm-up.
        site: of the run; the worst vehicle of its fleet counts.
        start: the end of the warm-up [s].

    Returns:
        Lane -> the time [s]; lanes without spill-back are left out.
    """
    full = {}
    for lane in np.unique(trips.lane).tolist():
        here = trips.lane == lane
        entered = np.where(trips.departed[here], trips.depart[here], trips.end)
        ready = np.maximum(trips.demand_time[here], np.append(-math.inf, entered[:-1]))
        longest = clearing_time(site.vehicle, site.limit(lane)) + site.dt
        held = ready[(entered - ready > longest) & (entered > start)]
        if len(held):
            full[lane] = max(float(held[0]), start)
    return full
