"""Vehicles pass in an order, driven as near to the times that follow from it as their law allows.

A vehicle gets the right of way when all that are before it in the order and conflict with it have
theirs, and its passage, predicted by its law, fits theirs. Until then it drives as slowly as makes
it come in time, so that it crosses at full speed. The rest is `baselines.passages`,
which keeps it safe. Where the order comes from is left to each session.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from baselines.manager import Slot
from baselines.optimum.alone import Drive
from baselines.passages import Passages, PassageSession
from baselines.prediction import Floats
from minisim.control import Command, Observed, Plan, Site, View
from minisim.reasons import Reason

#: Slowest advice [m/s], and how fast a vehicle accelerates on its way to the junction, as a share
#: of what it can: the law accelerates less the nearer it is to the limit.
SLOWEST, SHARE = 2.0, 0.6

#: A vehicle that is so much early is not considered yet [s]; one whose passage does not fit yet
#: counts as so much later.
EARLY, AGAIN = 1.0, 0.3


class Due(NamedTuple):
    """A vehicle in the order."""

    kind: int  #: index of its movement, those of each type in turn
    vehicle: Observed | None  #: as it is seen; None if it has not come yet
    time: float = math.inf  #: when it passes its mark, if it has not come yet [s]


class Times(NamedTuple):
    """What times in the order keep to. Each kind of vehicle counts where it passes its mark."""

    between: Floats  #: least time from the mark of the first to that of the second, (k, k) [s]
    past: Sequence[float]  #: least time from the entry to the mark [s], (k,)
    drives: Sequence[Drive]  #: of each kind, alone


class OrderedSession(PassageSession):
    """One run: grants passages in an order, and slows the others down in time."""

    def __init__(
        self, passages: Passages, period: float, reach: float, site: Site, times: Times
    ) -> None:
        super().__init__(passages, Plan(marks=(reach,), sight=reach), period, site)
        self._due: dict[int, tuple[int, float]] = {}  # kinds and times at the mark [s], in order
        self._alone: dict[int, float] = {}  # when each passes its mark if it drives on alone [s]
        self._between, self._past, ways = times
        self._marks = [way.place(t) for way, t in zip(ways, self._past, strict=True)]
        self._finals = [float(way.speed(0.0)) for way in ways]  # at the entry [m/s]
        movements, types = site.intersection.movements, len(site.types)
        self._crosses = np.tile(site.conflicts, (types, types))
        self._conflict = np.tile(site.conflicts | ~movements.apart, (types, types))
        self._limit, self._types = site.limit, site.types

    @abstractmethod
    def _order(self) -> Iterable[Due]:
        """All vehicles in view, and what is before them, in their order."""

    def decide(self, view: View) -> Iterable[Command]:
        """Review the passages, give new ones in order, and advise the others."""
        self._alone, self._due = {}, {}
        return super().decide(view)

    def _grant(self) -> Iterator[Command]:
        """Give passages in order."""
        passages, slots = self.passages, self.manager.slots
        free, blocked = np.full(len(self._between), -math.inf), np.zeros(len(self._between), bool)
        for kind, me, time in self._order():
            held = True
            if me is not None:
                slot = slots.get(me.id)
                held = slot is None
                if slot is None:
                    alone = self._when(me, kind)
                    time = max(alone, float(free[kind]))
                    if not blocked[kind] and time - alone < EARLY:
                        slot = self._passage(me.id)
                        time = max(time, alone + AGAIN)
                if slot is not None:
                    time = self._at_mark(slot, kind)
                    if held:
                        yield passages.give(slot)
                        yield from passages.advise(me.id, math.inf)
                    held = False
                else:
                    left = time - passages.since(me.id) * self._dt
                    yield from passages.advise(me.id, self._speed(me, kind, left))
                self._due[me.id] = kind, time
            if held:
                blocked |= self._conflict[kind]
            free = np.maximum(free, time + self._between[kind])

    def _waits(self, vehicle: int) -> Reason:
        """When a vehicle is to pass, and after which vehicles in view."""
        own, until = self._due[vehicle]
        before = list(self._due)[: list(self._due).index(vehicle)]
        others = tuple(v for v in before if self._crosses[own, self._due[v][0]])
        return Reason("after" if others else "planned", vehicle, others, until=until)

    def _when(self, me: Observed, kind: int) -> float:
        """When a vehicle passes its mark if it drives on alone [s]."""
        if me.id not in self._alone:
            since = self.passages.since(me.id)
            self._alone[me.id] = self.manager.alone(me, since, self._marks[kind]) * self._dt
        return self._alone[me.id]

    def _passage(self, vehicle: int) -> Slot | None:
        """A vehicle's passage if it fits all others."""
        slot = self.passages.ask(vehicle)
        return slot if slot is not None and self.manager.fits(slot, last=True) else None

    def _at_mark(self, slot: Slot, kind: int) -> float:
        return (slot.start + int(slot.s.searchsorted(self._marks[kind]))) * self._dt

    def _speed(self, me: Observed, kind: int, left: float) -> float:
        """The speed at which a vehicle passes its mark in the time that is left [m/s].

        It drives at this speed until it has to accelerate or brake for the speed at the entry.
        """
        it, limit, u = self._types[me.type], self._limit(me.lane), me.speed
        final = self._finals[kind]
        for _ in range(3):  # the speed depends on where that is, and the other way round
            a = it.acceleration * SHARE if u < final else it.deceleration
            run_up = min(abs(final * final - u * u) / (2.0 * a), max(me.distance - 1.0, 0.0))
            rest = 2.0 * run_up / max(u + final, 2.0) + self._past[kind]
            u = min(max((me.distance - run_up) / max(left - rest, 0.1), SLOWEST), limit)
        return u if u < limit else math.inf
