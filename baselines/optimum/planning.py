"""Rules under which vehicles can really be driven, for a schedule that can nearly be kept."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from baselines.optimum.alone import Drive, drives
from baselines.optimum.separations import Needs, alike, necessary
from baselines.prediction import Floats, Leader, Motion, courses, law_of, predict
from minisim.control import Site
from minisim.junction.coordination import STEP, region
from minisim.junction.partings import branch
from minisim.laws import traits_of

#: Least separation [s]: a schedule needs an order.
LEAST = 0.01

#: How many speeds of two vehicles that follow each other are tried, from `SLOWEST` on [m/s], and
#: how far before the junction they begin to drive freely [m].
SPEEDS, SLOWEST, FREE = 8, 3.0, (30.0, 60.0, 100.0, 150.0)


def drivable(site: Site, buffer: float, depart_speed: float | None = None) -> Needs:
    """The needs of vehicles whose bodies keep `CLOSE` and `buffer` seconds apart.

    In a lane they follow each other as their law lets them from the best of some equal speeds.
    """
    return _drivable(alike(site), buffer, depart_speed)


@lru_cache(maxsize=64)
def _drivable(site: Site, buffer: float, depart_speed: float | None) -> Needs:
    needs, ways = necessary(site, depart_speed), drives(site, depart_speed)
    junction, types, m = site.intersection, site.types, len(site.intersection.movements)
    marks = needs.until - [way.before for way in ways]
    reach = branch(junction, site.fleet) - junction.approach_length
    between = np.full((len(ways), len(ways)), -np.inf)
    for i, j in np.ndindex(between.shape):
        p, q = i % m, j % m
        if not junction.allowed[p] or not junction.allowed[q]:
            continue
        if not junction.movements.apart[p, q]:
            least = _following(site, ways, (i, j), marks, float(reach[p, q]))
        else:
            near = region(junction, types[i // m], p, q, types[j // m])
            if near is None or not near.close.any():
                continue
            rows, columns = np.nonzero(near.close)
            first, second = ways[i].until((rows + 1) * STEP), ways[j].until(columns * STEP)
            least = float((first - second).max() + buffer + marks[j] - marks[i])
        between[i, j] = max(least, LEAST)
    exits = np.tile(junction.movements.exits, len(types))
    joins = (between > -np.inf) & (exits[:, None] == exits)
    return needs._replace(rules=needs.rules._replace(between=between, joins=joins))


def _following(
    site: Site, ways: Sequence[Drive], kinds: tuple[int, int], marks: Floats, until: float
) -> float:
    """The least time between the marks of two vehicles of a lane that drive by their law [s]."""
    law, m = law_of(site), len(site.intersection.movements)
    (first, second), courses_ = kinds, courses(site)
    me, other = (traits_of(site.types[k // m]) for k in kinds)
    least = np.inf
    for v in np.linspace(SLOWEST, float(ways[first].v.max()), SPEEDS).tolist():
        for far in FREE:
            if far > -ways[first].s[0] or v > ways[first].speed(-far):
                continue
            lead = predict(law, me, courses_[first % m], -far, v)
            if lead is None:
                continue
            leader = Leader(lead.s, lead.v, me.length, me.b_max, until=until)
            behind = far + me.length + other.min_gap + v * other.headway
            run = predict(law, other, courses_[second % m], -behind, v, lane=[leader])
            if run is not None:
                passes = _passes(run, ways[second], marks[second], law.dt)
                least = min(least, passes - _passes(lead, ways[first], marks[first], law.dt))
    return least


def _passes(run: Motion, way: Drive, mark: float, dt: float) -> float:
    """When a vehicle passes its mark [s]."""
    return float(np.interp(way.place(mark), run.s, dt * np.arange(len(run.s))))
