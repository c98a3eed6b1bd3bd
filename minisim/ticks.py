"""Steps of simulated time, counted from 0."""

from __future__ import annotations

import math

#: A tick that never comes.
NEVER = 2**62


def first_tick(time: float, dt: float) -> int:
    """First tick at or after `time` [s]."""
    return NEVER if time / dt >= NEVER else math.ceil(time / dt - 1e-6)


def time_of(tick: int, dt: float) -> float:
    """Simulated time at a tick [s], free of rounding errors."""
    return round(tick * dt, 6)
