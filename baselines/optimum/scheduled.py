"""A controller that lets vehicles pass in a given order, as near to its times as their law allows.

It knows the order of all vehicles of a run beforehand, so it is no rival. It shows how near to the
bound vehicles can be driven (`baselines.ordered`).

From `baselines.passages` it differs in two ways. Passages fit if the bodies keep
a clearance (`minisim.junction.coordination`) at any two moments up to `buffer` apart. And vehicles
enter a shared exit lane in the order of the schedule.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from baselines.manager import Manager, Slot
from baselines.optimum.alone import drives
from baselines.optimum.planning import drivable
from baselines.ordered import Due, OrderedSession, Times
from baselines.passages import Passages
from minisim.control import Command, Cover, Observed, Site, View
from minisim.errors import InputError, integer, items, number, show
from minisim.junction.coordination import STEP, Region, region
from minisim.parameters import checked, declared, real

#: Time that bodies keep apart by default: less than half of that at the edges of the tiles of the
#: AIM4 simulator, 0.25 s on either side, which `baselines.reservation` keeps [s].
BUFFER = 0.2

#: Bodies are compared at moments so far apart [s].
MOMENT = 0.025


class Turn(NamedTuple):
    """A vehicle in the schedule."""

    lane: int
    rank: int  #: its place in its lane
    kind: int  #: index of its movement, those of each type in turn
    time: float  #: when it passes its mark [s]


def _turns(title: str, value: Any) -> tuple[Turn, ...]:
    made = []
    for k, it in enumerate(items(title, value, "turns")):
        place = f"turn {k + 1} of {title}"
        turn = items(place, it, "lane, rank, kind and time")
        if len(turn) != len(Turn._fields):
            raise InputError(f"{place} must be {', '.join(Turn._fields)}, got {show(it)}")
        lane, rank, kind = (integer(place, one, low=0) for one in turn[:3])
        made.append(Turn(lane, rank, kind, number(f"time of {place} [s]", turn[3])))
    return tuple(made)


@declared
class Scheduled:
    """Vehicles pass in the order of a schedule that is known beforehand."""

    covers = Cover(alike=True)

    turns: tuple[Turn, ...] = checked("the schedule, first vehicle first", _turns, "Turns")
    buffer: float = real("time that bodies keep apart", "s", low=0, high=10, default=BUFFER)
    period: float = real("time between two looks", "s", low=0.01, high=10, default=0.5)

    @property
    def name(self) -> str:
        """A short one: a schedule has thousands of numbers."""
        return f"scheduled#{hashlib.sha256(repr(self).encode()).hexdigest()[:8]}"

    def start(self, site: Site) -> ScheduledSession:
        """Begin a run; raises `InputError` for vehicles whose motion cannot be predicted."""
        self.covers.check("scheduled", site.vehicle)
        return ScheduledSession(self, site)


class Bodies(Manager):
    """Reservations that fit if bodies keep apart, in the order of the schedule."""

    def __init__(self, site: Site, buffer: float) -> None:
        super().__init__(site, buffer)
        self.place: dict[int, int] = {}  #: of each vehicle in the schedule, by id
        self._dt, self._shifts = site.dt, (0.0, buffer / site.dt, -buffer / site.dt)
        self._junction, self._kinds = site.intersection, site.types
        self._number = {it: k for k, it in enumerate(self._types)}
        self._conflicts = site.conflicts

    def fits(self, slot: Slot, *, last: bool) -> bool:  # noqa: ARG002  (Manager's argument)
        """Whether a passage fits every other."""
        return not slot.hard and all(
            self._apart(slot, other)
            for other in self.slots.values()
            if other.vehicle != slot.vehicle and self._conflicts[slot.movement, other.movement]
        )

    def _apart(self, slot: Slot, other: Slot) -> bool:
        """Whether two vehicles pass each other in their order."""
        first = self.place[other.vehicle] < self.place[slot.vehicle]
        exits = self._ways[slot.movement].exit_arm, self._ways[other.movement].exit_arm
        if exits[0] == exits[1] and (other.enters < slot.enters) != first:
            return False
        kinds = (self._kinds[self._number[it.type]] for it in (slot, other))
        near = region(self._junction, next(kinds), slot.movement, other.movement, next(kinds))
        return near is None or not self._touch(slot, other, near)

    def _touch(self, slot: Slot, other: Slot, near: Region) -> bool:
        """Whether the bodies come close at any two moments up to the buffer apart."""
        begin = max(slot.start, other.start)
        moments = np.arange(begin, min(slot.ends, other.ends), MOMENT / self._dt)
        mine = np.interp(moments, np.arange(slot.start, slot.ends + 1), slot.s)
        moments = moments[(mine > 0.0) & (mine < STEP * len(near.close))]
        mine = np.interp(moments, np.arange(slot.start, slot.ends + 1), slot.s)
        its = np.arange(other.start, other.ends + 1)
        return any(
            near.touches(mine, np.interp(moments + shift, its, other.s)) for shift in self._shifts
        )


class ScheduledSession(OrderedSession):
    """One run, in the order of the schedule."""

    def __init__(self, controller: Scheduled, site: Site) -> None:
        needs, ways = drivable(site, controller.buffer), drives(site)
        past = (needs.until - [way.before for way in ways]).tolist()
        times = Times(needs.rules.between, past, ways)
        self._bodies, reach = Bodies(site, controller.buffer), site.intersection.approach_length
        super().__init__(Passages(self._bodies, site), controller.period, reach, site, times)
        self._turns = controller.turns
        self._place = {(it.lane, it.rank): k for k, it in enumerate(controller.turns)}
        self._first = 0  # place of the first in the schedule that has not passed
        self._newest: dict[int, int] = {}  # highest rank seen by lane
        self._seen: Mapping[tuple[int, int], Observed] = {}

    def decide(self, view: View) -> Iterable[Command]:
        """Note which vehicles have come, and decide in the order of the schedule."""
        self._seen = {(it.lane, it.rank): it for it in view.vehicles}
        for it in view.vehicles:
            self._bodies.place[it.id] = self._place[it.lane, it.rank]
            self._newest[it.lane] = max(self._newest.get(it.lane, -1), it.rank)
        return super().decide(view)

    def _order(self) -> Iterator[Due]:
        """Those that have not passed, up to the last one in view."""
        left = len(self._seen)
        while self._first < len(self._turns) and self._passed(self._turns[self._first]):
            self._first += 1
        for it in self._turns[self._first :]:
            if not left:
                break
            if not self._passed(it):
                me = self._seen.get((it.lane, it.rank))
                left -= me is not None
                yield Due(it.kind, me, it.time)

    def _passed(self, it: Turn) -> bool:
        """Whether a vehicle has been in view and is no more."""
        place = it.lane, it.rank
        return place not in self._seen and self._newest.get(it.lane, -1) >= it.rank
