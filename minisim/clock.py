"""Times of day: 07:00 is 25200 s after midnight."""

from __future__ import annotations

import math
import re

from minisim.errors import InputError, number, show
from minisim.inflow import MAX_TIME


def seconds_of(value: object, name: str = "start") -> float:
    """A time of day such as "07:00" or "07:00:30", or seconds, as seconds; raises `InputError`."""
    given = value
    if isinstance(value, str):
        parts = re.fullmatch(r"([0-9]{1,2}):([0-5][0-9])(?::([0-5][0-9]))?", value.strip())
        try:
            hour, minute, second = map(int, parts.groups("0")) if parts else (0, 0, float(value))
        except ValueError:
            wanted = "a time of day such as 07:00 or seconds"
            raise InputError(f"{name} must be {wanted}, got {show(value)}") from None
        given = 3600 * hour + 60 * minute + second
    return number(f"{name} [s]", given, low=0, high=MAX_TIME)


def clock(time: float) -> str:
    """A time in seconds, also as a time of day: "25205 s (07:00:05)"."""
    return f"{time:g} s ({time_of_day(time)})"


def time_of_day(time: float) -> str:
    """A time of day, with seconds only if there are any: "07:00", "07:00:05"."""
    minutes, second = divmod(math.floor(time), 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}" + (f":{second:02d}" if second else "")
