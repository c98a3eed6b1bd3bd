"""Queues that reach the end of their road, so that vehicles have to wait before it."""

from __future__ import annotations

import math

import numpy as np

from minisim.results.trips import Trips
from minisim.vehicle import VehicleType


def clearing_time(vehicle: VehicleType) -> float:
    """How long the start of a road is taken by a vehicle that drives on, at worst from rest [s].

    √(2(l + s₀)/a) + T: the time to drive its length and the gap, and the headway of the next one.
    """
    room = vehicle.length + vehicle.min_gap
    return math.sqrt(2.0 * room / vehicle.acceleration) + vehicle.headway


def spillback(trips: Trips, vehicle: VehicleType, start: float = 0.0) -> dict[int, float]:
    """Lane -> the time at which its queue first reached the end of its road, from `start` on [s].

    It has if a vehicle could not enter for longer than `clearing_time` since it came and the one
    before it entered: that one did not drive on. What a burst of arrivals holds back enters
    sooner. Lanes without spill-back are left out.
    """
    full = {}
    for lane in np.unique(trips.lane).tolist():
        here = trips.lane == lane
        entered = np.where(trips.departed[here], trips.depart[here], trips.end)
        ready = np.maximum(trips.demand_time[here], np.append(-math.inf, entered[:-1]))
        held = ready[(entered - ready > clearing_time(vehicle)) & (entered > start)]
        if len(held):
            full[lane] = max(float(held[0]), start)
    return full
