"""The least time in which a vehicle can reach each place on its path, whatever decides.

No vehicle is faster than its law makes it on an empty road: limits, leaders and commands only lower
its acceleration. So a speed that bounds it at each place bounds all its times from below.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.prediction import Course, Floats, courses, law_of
from minisim.control import Site
from minisim.laws import Law, Traits, follow, traits_of, within

#: Spacing of the places on a path [m].
STEP = 0.1

#: More than a speed is off that is interpolated between two places [m/s].
BETWEEN = 1e-3


class Drive(NamedTuple):
    """One movement of one type of vehicle, alone. Places count from the junction entry [m]."""

    s: Floats  #: where its front is, from insertion to arrival
    v: Floats  #: upper bound on its speed there [m/s]
    time: Floats  #: lower bound on the time since the entry [s]; negative before it
    at_limit: float  #: time that the whole way takes at the limits of its roads [s]
    crossing: float  #: where the junction ends [m]
    limit: float  #: before the junction [m/s]
    behind: float  #: and behind it [m/s]

    @property
    def before(self) -> float:
        """Least time from insertion to the junction entry [s]."""
        return -float(self.time[0])

    @property
    def loss(self) -> float:
        """What it loses at least on its whole way against driving at the limits [s]."""
        return float(self.time[-1] - self.time[0]) - self.at_limit

    def until(self, s: npt.ArrayLike) -> Floats:
        """Least time from the entry to a place [s]."""
        return np.asarray(np.interp(np.asarray(s, float), self.s, self.time))

    def place(self, time: float) -> float:
        """The place that is reached in this time from the entry [s], at the earliest [m]."""
        return float(np.interp(time, self.time, self.s))

    def speed(self, s: npt.ArrayLike) -> Floats:
        """Upper bound on the speed at a place [m/s]."""
        return np.asarray(np.interp(np.asarray(s, float), self.s, self.v) + BETWEEN)


def drives(site: Site, depart_speed: float | None = None) -> tuple[Drive, ...]:
    """The drives of all movements, those of each type in turn (`Movements` with types).

    `depart_speed` is the highest at insertion [m/s]; None means the limit.
    """
    law, ways = law_of(site), courses(site)
    starts = [path.start - path.entry for path in site.intersection.paths]
    return tuple(
        _drive(law, traits_of(it), way, start + it.length + law.margin, depart_speed)
        for it in site.types
        for way, start in zip(ways, starts, strict=True)
    )


@lru_cache(maxsize=1024)
def _drive(law: Law, me: Traits, way: Course, start: float, depart: float | None) -> Drive:
    s = np.linspace(start, way.end, int((way.end - start) / STEP) + 2)
    s = np.sort(np.append(s, [0.0, way.crossing]))
    limit = np.where(s < 0.0, way.before, np.where(s < way.crossing, way.turn, way.behind))
    v = limit.copy()
    first = way.before if depart is None else min(depart, way.before)
    for place, speed, behind in (
        (start, first, way.before),
        (0.0, way.before, way.turn),
        (way.crossing, way.turn, way.behind),
    ):  # fmt: skip
        after = s >= place
        if behind > speed:
            v[after] = np.minimum(v[after], _rising(law, me, speed, behind, s[after] - place))
        elif behind < speed:
            # It brakes comfortably for the lower limit. The step in which it gets there may end
            # past the place, so for a step's way on either side it may still be faster, by b·dt at
            # most: it slows down evenly in that step.
            last = behind + me.b * law.dt
            braking = np.sqrt(behind**2 + 2.0 * me.b * (place - s[~after]))
            near = s[~after] > place - last * law.dt
            v[~after] = np.minimum(v[~after], np.maximum(braking, np.where(near, last, 0.0)))
            late = after & (s < place + behind * law.dt)
            v[late] += me.b * law.dt * (1.0 - (s[late] - place) / (behind * law.dt))
    pace = np.diff(s) / np.maximum(v[:-1], v[1:])
    time = np.concatenate([[0.0], np.cumsum(pace)])
    at_limit = -start / way.before + way.crossing / way.turn
    at_limit += (way.end - way.crossing) / way.behind
    since = time - time[s.searchsorted(0.0)]
    return Drive(s, v, since, at_limit, way.crossing, way.before, way.behind)


def _rising(law: Law, me: Traits, v: float, limit: float, past: Floats) -> Floats:
    """Bound on the speed at places past the one where a higher limit begins.

    A step is as fast throughout as at its end, which holds for both rules of moving. A vehicle
    whose steps lie otherwise begins to accelerate later.
    """
    places, speeds = zip(*_steps(law, me, v, limit, float(past[-1])), strict=True)
    return np.asarray(speeds)[np.searchsorted(places, past, side="right") - 1]


def _steps(
    law: Law, me: Traits, v: float, limit: float, end: float
) -> Iterator[tuple[float, float]]:
    s = 0.0
    while s <= end and limit - v > 1e-6 * limit:
        v += law.dt * within(v, follow(v, limit, 0.0, me, law), limit, law)
        yield s, v
        s += v * law.dt
    yield s, limit
