"""A controller that lets vehicles pass in a given order, as near to its times as their law allows.

It knows the order of all vehicles of a run beforehand, so it is no rival. It shows how near to the
bound vehicles can be driven. A vehicle gets the right of way when all that are before it in the
order and conflict with it have theirs, and its passage, predicted by its law, fits theirs. Until
then it drives as slowly as makes it come in time, so that it crosses at full speed.

It keeps the protocol of `baselines.reservation`, with two differences. Passages fit if the bodies
keep a clearance (`minisim.junction.coordination`) at any two moments up to `buffer` apart. And
vehicles enter a shared exit lane in the order of the schedule.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from baselines.optimum.alone import drives
from baselines.optimum.planning import drivable
from baselines.prediction import predict
from baselines.reservation import Manager, Reservation, ReservationSession, Slot
from minisim.control import Advise, Command, Cover, Observed, Plan, Site, View
from minisim.errors import InputError, integer, items, number, show
from minisim.junction.coordination import STEP, Region, region
from minisim.parameters import checked, declared, real

#: Time that bodies keep apart by default: less than half of that at the edges of the tiles of the
#: AIM4 simulator, 0.25 s on either side, which `baselines.reservation` keeps [s].
BUFFER = 0.2

#: Bodies are compared at moments so far apart [s].
MOMENT = 0.025

#: Slowest advice [m/s], and how fast a vehicle accelerates on its way to the junction, as a share
#: of what it can: the law accelerates less the nearer it is to the limit.
SLOWEST, SHARE = 2.0, 0.6

#: A vehicle that is so much early is not considered yet [s]; one whose passage does not fit yet
#: counts as so much later.
EARLY, AGAIN = 1.0, 0.3


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

    def alone(self, me: Observed, now: int, mark: float) -> float:
        """When a vehicle would be at a place past the entry [m] if it drove on alone [steps]."""
        way = self._ways[self._rows[me.lane][me.manoeuvre]]
        run = predict(self._law, self._types[me.type], way, -me.distance, me.speed)
        return math.inf if run is None else now + int(run.s.searchsorted(mark))

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


class ScheduledSession(ReservationSession):
    """One run: grants passages in the order of the schedule, and slows the others down in time."""

    manager: Bodies

    def __init__(self, controller: Scheduled, site: Site) -> None:
        super().__init__(Reservation(period=controller.period), site)
        self.manager = Bodies(site, controller.buffer)
        length = site.intersection.approach_length
        self.plan = Plan(marks=(length,), sight=length)
        self._turns = controller.turns
        self._place = {(it.lane, it.rank): k for k, it in enumerate(controller.turns)}
        self._first = 0  # place of the first in the schedule that has not passed
        self._newest: dict[int, int] = {}  # highest rank seen by lane
        self._seen: Mapping[tuple[int, int], Observed] = {}
        self._advice: list[Command] = []
        needs, ways = drivable(site, controller.buffer), drives(site)
        self._between, self._drives = needs.rules.between, ways
        at_mark = needs.until - [way.before for way in ways]
        self._past = at_mark.tolist()  # least time from the entry to the mark [s]
        self._marks = [way.place(t) for way, t in zip(ways, self._past, strict=True)]
        movements, types = site.intersection.movements, len(site.types)
        self._conflict = np.tile(site.conflicts | ~movements.apart, (types, types))
        self._limit, self._types = site.limit, site.types

    def decide(self, view: View) -> Iterable[Command]:
        """Check the passages, grant new ones in order, and advise the others."""
        self._seen = {(it.lane, it.rank): it for it in view.vehicles}
        self._advice = []
        for it in view.vehicles:
            self.manager.place[it.id] = self._place[it.lane, it.rank]
            self._newest[it.lane] = max(self._newest.get(it.lane, -1), it.rank)
        return [*super().decide(view), *self._advice]

    def _grant(self, seen: dict[int, Observed], ahead: dict[int, int], now: int) -> Iterator[int]:
        """Grant passages in the order of the schedule; return the ids of the new holders."""
        free, blocked = np.full(len(self._between), -math.inf), np.zeros(len(self._between), bool)
        left = len(seen)
        while self._first < len(self._turns) and self._passed(self._turns[self._first]):
            self._first += 1
        for turn in self._turns[self._first :]:
            if not left:
                break
            if self._passed(turn):
                continue
            me, time, held = self._seen.get((turn.lane, turn.rank)), turn.time, True
            if me is not None:
                left -= 1
                slot = self.manager.slots.get(me.id)
                held = slot is None
                if slot is None:
                    alone = self.manager.alone(me, now, self._marks[turn.kind]) * self._dt
                    time = max(alone, float(free[turn.kind]))
                    if not blocked[turn.kind] and time - alone < EARLY:
                        slot = self._passage(me, now, ahead.get(me.id))
                        time = max(time, alone + AGAIN)
                if slot is not None:
                    time = self._at_mark(slot, turn.kind)
                    if held:
                        yield me.id
                        self._advice.append(Advise(me.id, math.inf))
                    held = False
                else:
                    speed = self._speed(me, turn.kind, time - now * self._dt)
                    self._advice.append(Advise(me.id, speed))
            if held:
                blocked |= self._conflict[turn.kind]
            free = np.maximum(free, time + self._between[turn.kind])

    def _passed(self, turn: Turn) -> bool:
        """Whether a vehicle has been in view and is no more."""
        place = turn.lane, turn.rank
        return place not in self._seen and self._newest.get(turn.lane, -1) >= turn.rank

    def _passage(self, me: Observed, now: int, leader: int | None) -> Slot | None:
        """A vehicle's passage if it fits all others; then it holds it."""
        slot = self._predict(me, now, leader)
        if slot is None or not self.manager.fits(slot, last=True):
            return None
        self.manager.slots[me.id] = slot
        self._requests.pop(me.id, None)
        return slot

    def _at_mark(self, slot: Slot, kind: int) -> float:
        return (slot.start + int(slot.s.searchsorted(self._marks[kind]))) * self._dt

    def _speed(self, me: Observed, kind: int, left: float) -> float:
        """The speed at which a vehicle passes its mark in the time that is left [m/s].

        It drives at this speed until it has to accelerate or brake for the speed at the entry.
        """
        it, limit, u = self._types[me.type], self._limit(me.lane), me.speed
        final = float(self._drives[kind].speed(0.0))
        for _ in range(3):  # the speed depends on where that is, and the other way round
            a = it.acceleration * SHARE if u < final else it.deceleration
            run_up = min(abs(final * final - u * u) / (2.0 * a), max(me.distance - 1.0, 0.0))
            rest = 2.0 * run_up / max(u + final, 2.0) + self._past[kind]
            u = min(max((me.distance - run_up) / max(left - rest, 0.1), SLOWEST), limit)
        return u if u < limit else math.inf
