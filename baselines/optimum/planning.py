"""Separations with which vehicles can be driven, for a schedule that can be kept.

Bodies keep a clearance and a time apart, as in `baselines.optimum.scheduled`, and vehicles of a lane
follow each other as their law makes them.
"""

from __future__ import annotations

import numpy as np

from baselines.optimum.alone import Drive, drives
from baselines.optimum.separations import Separations, necessary
from baselines.prediction import Course, Floats, Leader, courses, law_of, predict
from minisim.control import Site
from minisim.junction.coordination import STEP, region
from minisim.junction.partings import branch
from minisim.laws import Law, Traits, traits_of

#: Least separation [s]: a schedule needs an order.
LEAST = 0.01

#: Times between two vehicles of a lane at insertion that are tried [s].
HEADWAYS = np.arange(1.2, 4.0, 0.2)


def sufficient(site: Site, buffer: float, depart_speed: float | None = None) -> Separations:
    """The separations of vehicles that pass `buffer` seconds and a clearance apart."""
    needed, ways = necessary(site, depart_speed), drives(site, depart_speed)
    junction, m = site.intersection, len(site.intersection.movements)
    kinds = [(p, it) for it in site.types for p in range(m)]
    between = needed.between.copy()
    marks = needed.until - [way.before for way in ways]
    reach = branch(junction, site.fleet) - junction.approach_length
    for i, (p, one) in enumerate(kinds):
        for j, (q, other) in enumerate(kinds):
            if not junction.allowed[p] or not junction.allowed[q]:
                continue
            if junction.movements.apart[p, q]:
                near = region(junction, one, p, q, other)
                if near is None:
                    continue
                rows, columns = np.nonzero(near.close)
                first, second = ways[i].until((rows + 1) * STEP), ways[j].until(columns * STEP)
                between[i, j] = (first - second).max() + buffer + marks[j] - marks[i]
            else:
                between[i, j] = _following(site, ways, marks, i, j, float(reach[p, q]))
    return needed._replace(between=np.where(between > -np.inf, np.maximum(between, LEAST), between))


def _following(site, ways, marks, i, j, until) -> float:
    """The least time between marks of two vehicles of a lane that drive by their law."""
    law, m = law_of(site), len(site.intersection.movements)
    me = [traits_of(site.types[k // m]) for k in (i, j)]
    way = [courses(site)[k % m] for k in (i, j)]
    best = np.inf
    for v in np.linspace(3.0, float(ways[i].v[0]), 8):
        for far in (30.0, 60.0, 100.0, 150.0):
            if v > ways[i].speed(-far): continue
            lead = predict(law, me[0], way[0], -far, v)
            passes = np.interp(_time_of(ways[i], marks[i]), lead.s, np.arange(len(lead.s)) * law.dt)
            leader = Leader(lead.s, lead.v, me[0].length, me[0].b_max, until=until)
            behind = me[0].length + me[1].min_gap + v * me[1].headway
            run = predict(law, me[1], way[1], -far - behind, v, lane=[leader])
            at = np.interp(_time_of(ways[j], marks[j]), run.s, np.arange(len(run.s)) * law.dt)
            best = min(best, at - passes)
    return float(best)


def _time_of(way: Drive, time: float) -> float:
    return float(np.interp(time, way.time, way.s))
