"""Flows of connected vehicles as queues: one server, which a rule gives to one lane after another.

Each vehicle needs the junction from when it comes to its entry, and the next one comes a separation
later, which depends on both: the shortest within a lane, longer between movements in conflict, none
between others. A rule chooses the lane of which the first vehicle is next. It looks no further
ahead than to vehicles that will have come by then.

A session plans all vehicles in range with the rule, at every look anew, and has them driven in this
order (`baselines.ordered`). A choice stands when its vehicle holds a passage. It gets it no earlier
than has to be so that it need not brake, so vehicles that come later can still join.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from baselines.optimum.alone import drives
from baselines.ordered import Due, OrderedSession, Times
from baselines.prediction import Floats
from baselines.reservation import Reservation
from minisim.control import Command, Observed, Plan, Site, View
from minisim.junction.conflicts import conflict_zones

#: Least separation of vehicles in conflict [s]: the first one comes before the second.
LEAST = 0.01

#: How far before the junction vehicles register [m]: as with V2I-C (`baselines.v2ic`).
REACH = 200.0


class Waiting(NamedTuple):
    """A vehicle that has not been served."""

    id: int
    kind: int  #: index of its movement, those of each type in turn
    request: int  #: its place in the order in which vehicles ask
    came: float  #: when it would have come if it had not had to wait [s]
    ready: float  #: when it can come now, which is later if it has been slowed down [s]


#: The vehicles of each lane that have not been served, front to back; none came before the one
#: ahead of it.
Lines = Sequence[deque[Waiting]]


class Rule(Protocol):
    """Which lane is next; what a rule remembers is in it, and never changes."""

    def choose(self, lines: Lines, free: Floats, clock: float) -> tuple[int, Rule]:
        """The lane of which the first vehicle is next, and the rule for what comes after it.

        `free` is when the junction is free for each kind of vehicle, and `clock` when the last
        vehicle that was chosen comes [s]. One line at least is not empty.
        """


class Served(NamedTuple):
    """A vehicle that was chosen."""

    vehicle: Waiting
    time: float  #: when it comes [s]
    rule: Rule  #: for what comes after it


def plan(
    lines: Iterable[Iterable[Waiting]], rule: Rule, between: Floats, free: Floats, clock: float
) -> Iterator[Served]:
    """Serve all vehicles by a rule.

    `between` is the least time from one kind of vehicle to another, shape (k, k); `free` is when
    the junction is free for each, shape (k,); `clock` when the last one comes that was served [s].
    """
    left = [deque(line) for line in lines]
    while any(left):
        lane, rule = rule.choose(left, free, clock)
        it = left[lane].popleft()
        clock = max(it.ready, float(free[it.kind]))
        free = np.maximum(free, clock + between[it.kind])
        yield Served(it, clock, rule)


def separations(site: Site, buffer: float) -> Floats:
    """Least time between the entries of two kinds of vehicles, one after the other, (k, k) [s].

    In a lane, they cross at the speed of the slower one, as near as car following lets them. From
    different lanes, the second comes to its conflict zone `buffer` after the first has left its
    own, each driving alone.
    """
    junction, ways, types = site.intersection, drives(site), site.types
    m, same = len(junction.movements), ~junction.movements.apart
    zones = [conflict_zones(junction, it, site.fleet) for it in types]
    kinds = [(k % m, k // m) for k in range(len(ways))]
    speed = np.array([float(way.speed(0.0)) for way in ways])
    gap = np.repeat([it.min_gap for it in types], m)
    headway = np.repeat([it.headway for it in types], m)
    comes = np.array([way.until(zones[t][p, :, 0]) for way, (p, t) in zip(ways, kinds, strict=True)])
    between = np.full((len(ways), len(ways)), -math.inf)
    for way, row, (p, t), v in zip(ways, between, kinds, np.minimum.outer(speed, speed), strict=True):
        leaves = np.tile(way.until(zones[t][p, :, 1]), len(types))
        apart = np.maximum(leaves + buffer - comes[:, p], LEAST)
        behind = (types[t].length + gap) / v + headway
        row[:] = np.where(np.tile(same[p], len(types)), behind, apart)
    return np.nan_to_num(between, nan=-math.inf)


class FlowSession(OrderedSession):
    """One run, in the order of a rule."""

    def __init__(self, rule: Rule, site: Site, protocol: Reservation) -> None:
        ways = drives(site)
        times = Times(separations(site, protocol.buffer), (0.0,) * len(ways), ways)
        super().__init__(protocol, site, times)
        self._commit, reach = self.plan.sight, min(REACH, site.intersection.approach_length)
        self.plan = Plan(marks=(reach, self._commit), sight=reach)
        self._rule = rule
        self._seen: Sequence[Observed] = ()
        self._asked: dict[int, tuple[int, float]] = {}  # how many before it, and when it would come
        self._count = 0  # of those that have asked
        self._planned: list[Served] = []
        self._rows = site.intersection.movements.rows
        self._lanes, self._movements = site.intersection.n, len(site.intersection.movements)

    def decide(self, view: View) -> Iterable[Command]:
        """Plan, grant and advise; choices stand whose vehicles hold a passage."""
        self._seen = view.vehicles
        yield from super().decide(view)
        for it in self._planned:
            if it.vehicle.id not in self.manager.slots:
                break
            self._rule = it.rule

    def _order(self, now: int) -> Iterable[Due]:
        """Those that hold a passage, then the others by the rule."""
        self._ask(now)
        free, clock = np.full(len(self._between), -math.inf), -math.inf
        lines: list[list[Waiting]] = [[] for _ in range(self._lanes)]
        order = []
        for it in self._seen:
            kind = it.type * self._movements + self._rows[it.lane][it.manoeuvre]
            if (slot := self.manager.slots.get(it.id)) is not None:
                order.append(Due(kind, it))
                time = self._at_mark(slot, kind)
                free, clock = np.maximum(free, time + self._between[kind]), max(clock, time)
                continue
            line = lines[it.lane]
            request, came = self._asked[it.id]
            came = max(came, line[-1].came) if line else came
            line.append(Waiting(it.id, kind, request, came, self._when(it, kind, now)))
        self._planned = list(plan(lines, self._rule, self._between, free, clock))
        by_id = {it.id: it for it in self._seen}
        return order + [Due(it.vehicle.kind, by_id[it.vehicle.id]) for it in self._planned]

    def _ask(self, now: int) -> None:
        """Note new vehicles, the nearest first."""
        new = [it for it in self._seen if it.id not in self._asked]
        for it in sorted(new, key=lambda it: (it.distance, it.lane)):
            kind = it.type * self._movements + self._rows[it.lane][it.manoeuvre]
            self._asked[it.id] = self._count, self._when(it, kind, now)
            self._count += 1
