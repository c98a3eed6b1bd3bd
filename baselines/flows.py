"""Flows of connected vehicles as queues: one server, which a rule gives to one lane after another.

A vehicle comes to the junction, and the next one no sooner than a separation later. It depends on
both: there is one in a lane and between movements in conflict, and none between others. A rule
chooses the lane of which the first vehicle is next. It knows only of vehicles that will have come
by then.

At every look, a session plans for all vehicles in range by the rule, and has them driven in this
order (`baselines.ordered`). A choice stands once its vehicle holds a passage.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from baselines.manager import Manager
from baselines.optimum.alone import drives
from baselines.ordered import Due, OrderedSession, Times
from baselines.prediction import Floats
from baselines.promises import passages_of
from minisim.control import Command, Cover, Observed, Radio, Site, View, stopping_distance
from minisim.junction.conflicts import conflict_zones
from minisim.names import Name
from minisim.parameters import declared, real

#: Vehicles keep to their passages as closely as if the buffer were no longer than this, that of
#: `baselines.reservation` [s].
CLOSE = 0.5

#: Least separation of vehicles in conflict [s]: the first one comes before the second.
LEAST = 0.01


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
    m, same = len(junction.movements), np.tile(~junction.movements.apart, (len(types), len(types)))
    zones = np.concatenate([conflict_zones(junction, it, site.fleet) for it in types])
    first, last = (
        np.array([way.until(row) for way, row in zip(ways, zones[..., end], strict=True)])
        for end in (0, 1)
    )
    apart = np.tile(last, len(types)) + buffer - np.tile(first, len(types)).T
    speed = np.array([float(way.speed(0.0)) for way in ways])
    length, gap, headway = (
        np.repeat([getattr(it, name) for it in types], m)
        for name in ("length", "min_gap", "headway")
    )
    behind = np.add.outer(length, gap) / np.minimum.outer(speed, speed) + headway
    between = np.where(same, behind, np.maximum(apart, LEAST))
    return np.where(np.isnan(between), -math.inf, between)


@declared
class Flow(ABC):
    """Connected vehicles are served by a rule, for vehicles whose drivers are alike."""

    name = Name("flow")
    covers = Cover(alike=True)
    radio = Radio()

    # As with V2I-C (`baselines.v2ic`), since that of the sources could not be had.
    reach: float = real(
        "how far before the junction, on the road, vehicles register", "m",
        low=1, high=2000, default=200.0,
    )  # fmt: skip
    buffer: float | None = real(
        "time between one vehicle's leaving a conflict zone and another's entering its own; none "
        "means the time in which one at the limit drives its stopping distance", "s",
        low=0, high=10, optional=True, default=None,
    )  # fmt: skip
    period: float = real("time between two looks", "s", low=0.01, high=10, default=0.5)

    @property
    @abstractmethod
    def rule(self) -> Rule:
        """By which lanes are served, as it is before the first vehicle."""

    def start(self, site: Site) -> FlowSession:
        """Begin a run; raises `InputError` for vehicles whose motion cannot be predicted."""
        self.covers.check(self.name, site.vehicle)
        return FlowSession(self, site)


class FlowSession(OrderedSession):
    """One run, in the order of a rule."""

    def __init__(self, controller: Flow, site: Site) -> None:
        buffer, ways = controller.buffer, drives(site)
        if buffer is None:
            limit = site.speed_limit
            buffer = stopping_distance(limit, site.vehicle.deceleration) / limit
        times = Times(separations(site, buffer), (0.0,) * len(ways), ways)
        reach = min(controller.reach, site.intersection.approach_length)
        passages = passages_of(Manager(site, buffer), site, controller.period, min(buffer, CLOSE))
        super().__init__(passages, controller.period, reach, site, times)
        self._rule = controller.rule
        self._asked: dict[int, tuple[int, float]] = {}  # how many before it, and when it would come
        self._count = 0  # of those that have asked
        self._planned: list[Served] = []
        self._movements = site.intersection.movements
        self._lanes = site.intersection.n

    def decide(self, view: View) -> Iterable[Command]:
        """Plan, grant and advise; choices stand whose vehicles hold a passage."""
        yield from super().decide(view)
        for it in self._planned:
            if it.vehicle.id not in self.manager.slots:
                break
            self._rule = it.rule

    def _order(self) -> Iterable[Due]:
        """Those that hold a passage, then the others by the rule."""
        seen = self.passages.seen
        self._ask()
        free, clock = np.full(len(self._between), -math.inf), -math.inf
        lines: list[list[Waiting]] = [[] for _ in range(self._lanes)]
        order = []
        for it in seen.values():
            kind = self._kind(it)
            if (slot := self.manager.slots.get(it.id)) is not None:
                order.append(Due(kind, it))
                time = self._at_mark(slot, kind)
                free, clock = np.maximum(free, time + self._between[kind]), max(clock, time)
                continue
            line = lines[it.lane]
            request, came = self._asked[it.id]
            came = max(came, line[-1].came) if line else came
            line.append(Waiting(it.id, kind, request, came, self._when(it, kind)))
        self._planned = list(plan(lines, self._rule, self._between, free, clock))
        return order + [Due(it.vehicle.kind, seen[it.vehicle.id]) for it in self._planned]

    def _ask(self) -> None:
        """Note new vehicles, the nearest first."""
        new = [it for it in self.passages.seen.values() if it.id not in self._asked]
        for it in sorted(new, key=lambda it: (it.distance, it.lane)):
            self._asked[it.id] = self._count, self._when(it, self._kind(it))
            self._count += 1

    def _kind(self, it: Observed) -> int:
        return it.type * len(self._movements) + self._movements.rows[it.lane][it.manoeuvre]
