"""The arrival table of a run: every controller meets the same one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from minisim.clock import clock
from minisim.errors import InputError
from minisim.inflow import MAX_TIME, Floats, Ints
from minisim.junction.movements import ARM_NAMES, Bools

#: A driver's factor on the speed limit; SUMO cuts its speedFactor to the same range.
LEAST_FACTOR, MOST_FACTOR = 0.2, 2.0


@dataclass(frozen=True, eq=False)
class Arrivals:
    """An arrival table, sorted by demand time and lane; all columns have the shape (k,).

    Raises `InputError` for columns of another shape or type, or a value out of range.
    """

    time: Floats  # demand time [s]
    lane: Ints  # index of the approach lane
    manoeuvre: Ints  # 1 … n−1
    speed_factor: Floats | None = None  # drivers' factors on the speed limit; None: they are drawn
    type: npt.NDArray[np.str_] | None = None  # names of the vehicles' types; None: they are drawn

    #: What a clock shows at time 0 [s]; messages tell times by it. No field: it changes no run.
    origin: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        time = _column("demand_time_s", self.time, np.float64)
        lane = _column("lane", self.lane, np.int64)
        manoeuvre = _column("manoeuvre", self.manoeuvre, np.int64)
        columns: dict[str, npt.NDArray[Any]]
        columns = {"time": time, "lane": lane, "manoeuvre": manoeuvre}
        if self.speed_factor is not None:
            factors = _column("speed_factor", self.speed_factor, np.float64)
            if len(factors) and not LEAST_FACTOR <= factors.min() <= factors.max() <= MOST_FACTOR:
                raise InputError(f"a speed_factor must be {LEAST_FACTOR:g} … {MOST_FACTOR:g}")
            columns["speed_factor"] = factors
        if self.type is not None:
            columns["type"] = np.asarray(self.type, dtype=np.str_)
        if any(len(column) != len(time) for column in columns.values()):
            raise InputError("an arrival table needs as many times as lanes and manoeuvres")
        if not np.isfinite(time).all() or time.min(initial=0.0) < 0:
            raise InputError("demand times must be finite and not negative")
        if (last := time.max(initial=0.0)) > MAX_TIME:
            raise InputError(f"demand times must be at most {MAX_TIME:g} s, got {last:g}")
        order = np.lexsort((lane, time))
        for name, column in columns.items():
            column = column[order]
            column.setflags(write=False)
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.time)

    @cached_property
    def rank(self) -> Ints:
        """Each vehicle's place among those of its lane, from 0.

        Random traits, such as a human driver, are drawn by lane and rank, so they do not
        depend on other lanes or on the horizon.
        """
        return ranks(self.lane)

    def between(self, start: float, end: float) -> Arrivals:
        """The arrivals from `start` [s] to before `end`, with times counted from `start`.

        Messages go on to tell times by the clock of this table.
        """
        here = slice(*self.time.searchsorted((start, end)))
        factors = None if self.speed_factor is None else self.speed_factor[here]
        types = None if self.type is None else self.type[here]
        made = Arrivals(
            self.time[here] - start, self.lane[here], self.manoeuvre[here], factors, types
        )
        object.__setattr__(made, "origin", self.origin + start)
        return made

    def check(self, n: int, allowed: Bools | None = None) -> None:
        """Raise `InputError` for a lane or manoeuvre that does not exist with n arms.

        Or for one that no vehicle may take there, if `allowed` is given, shape (n, n−1).
        """
        for bad in self.lane[(self.lane < 0) | (self.lane >= n)].tolist():
            name = ARM_NAMES[bad] if 0 <= bad < len(ARM_NAMES) else str(bad)
            raise InputError(f"lane {name} is not in the geometry (lanes a … {ARM_NAMES[n - 1]})")
        for bad in self.manoeuvre[(self.manoeuvre < 1) | (self.manoeuvre >= n)].tolist():
            raise InputError(f"manoeuvre {bad} does not exist with {n} arms (1 … {n - 1})")
        if allowed is not None:
            for bad in np.flatnonzero(~allowed[self.lane, self.manoeuvre - 1]).tolist():
                way = f"{ARM_NAMES[self.lane[bad]]}{self.manoeuvre[bad]}"
                raise InputError(
                    f"the vehicle of {clock(self.origin + self.time[bad])} takes {way}, which is "
                    "forbidden here or against a one-way road"
                )

    def rates(self, n: int, horizon: float) -> tuple[float, ...]:
        """Mean inflow of each lane over the first `horizon` seconds [veh/h]."""
        counts = np.bincount(self.lane[self.time < horizon], minlength=n)
        return tuple(float(c) * 3600.0 / horizon for c in counts)


def ranks(lane: Ints) -> Ints:
    """`Arrivals.rank`, given the lanes in order of demand."""
    order = np.argsort(lane, kind="stable")
    ahead = np.searchsorted(lane[order], lane[order])
    rank = np.empty(len(lane), int)
    rank[order] = np.arange(len(lane)) - ahead
    return rank


def _column(name: str, value: npt.ArrayLike, dtype: type) -> npt.NDArray[np.generic]:
    wanted = InputError(f"{name} must be a one-dimensional column of {dtype.__name__} numbers")
    try:
        raw = np.asarray(value)
    except (ValueError, TypeError, OverflowError):
        raise wanted from None
    if raw.ndim != 1 or raw.dtype.kind not in "iuf":
        raise wanted
    if raw.dtype == dtype:
        return raw
    with np.errstate(invalid="ignore", over="ignore"):
        column: npt.NDArray[np.generic] = raw.astype(dtype)
    if not np.array_equal(column, raw, equal_nan=True):
        raise wanted
    return column
