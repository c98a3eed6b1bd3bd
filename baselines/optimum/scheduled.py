"""A controller that lets vehicles pass in a given order, as near to its times as their law allows.

It knows the order of all vehicles of a run beforehand, so it is no rival: it shows how near to the
bound vehicles can be driven. A vehicle gets the right of way when all that are before it in the
order and conflict with it have theirs, and its passage, predicted by its law, fits theirs
(`baselines.reservation`). Until then it is told to drive as slowly as makes it come in time, so that
it crosses at full speed.

Passages fit if the bodies keep a clearance at any two moments up to `buffer` apart, and vehicles
enter a shared exit lane in their order.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from baselines.optimum.alone import Drive, drives
from baselines.optimum.separations import Separations
from baselines.prediction import Floats
from baselines.reservation import Manager, Reservation, ReservationSession, Slot
from minisim.control import Advise, Command, Cover, Go, Observed, Plan, Site, View, Wake
from minisim.junction.coordination import region
from minisim.junction.movements import Ints
from minisim.names import Name

#: Moments at which bodies are compared [s].
MOMENT = 0.025


class Bodies(Manager):
    """Reservations that fit if bodies keep apart, in the order of a schedule."""

    def __init__(self, site: Site, buffer: float) -> None:
        super().__init__(site, buffer)
        self.place: dict[int, int] = {}  #: of each vehicle in the order
        self._site = site
        self._shifts = (0.0, buffer, -buffer) if buffer else (0.0,)
        junction, types = site.intersection, site.types
        self._kind = {it: k for k, it in enumerate(self._types)}
        self._regions = {
            (p, one, q, other): region(junction, types[one], p, q, types[other])
            for p, q in np.argwhere(site.conflicts).tolist()
            for one in range(len(types)) for other in range(len(types))
        }

    def fits(self, slot: Slot, *, last: bool) -> bool:
        if slot.hard:
            return False
        way = self._ways[slot.movement]
        for other in self.slots.values():
            if other.vehicle == slot.vehicle:
                continue
            key = slot.movement, self._kind[slot.type], other.movement, self._kind[other.type]
            near = self._regions.get(key)
            if near is None:
                continue
            first = self.place[other.vehicle] < self.place[slot.vehicle]
            merges = self._ways[other.movement].exit_arm == way.exit_arm
            if merges and (other.enters < slot.enters) != first:
                return False
            if self._touch(slot, other, near):
                return False
        return True

    def _touch(self, slot: Slot, other: Slot, near) -> bool:
        dt = self._site.dt
        begin = max(slot.start, other.start, min(slot.enters, other.enters) - 10)
        rows, columns = near.close.shape
        ends = [it.start + int(it.s.searchsorted(0.25 * n)) for it, n in ((slot, rows), (other, columns))]
        end = min(max(ends), slot.ends, other.ends)
        if end <= begin: return False
        t = np.arange(begin, end, MOMENT / dt)
        mine = np.interp(t, np.arange(slot.start, slot.ends + 1), slot.s)
        for shift in self._shifts:
            its = np.interp(t + shift / dt, np.arange(other.start, other.ends + 1), other.s)
            if near.touches(mine, its):
                return True
        return False


class Scheduled:
    name = Name("scheduled")
    covers = Cover(alike=True)

    def __init__(self, order, times, separations: Separations, buffer: float = 0.2, period: float = 0.5, depart_speed=None):
        self.order = order  # (lane, rank) pairs
        self.times = times
        self.separations = separations
        self.buffer, self.period, self.depart_speed = buffer, period, depart_speed

    def start(self, site: Site):
        self.covers.check(self.name, site.vehicle)
        return ScheduledSession(self, site)


class ScheduledSession(ReservationSession):
    def __init__(self, controller: Scheduled, site: Site) -> None:
        super().__init__(Reservation(period=controller.period), site)
        self.manager = Bodies(site, controller.buffer)
        length = site.intersection.approach_length
        self.plan = Plan(sight=length)
        self._order = controller.order
        self._times = controller.times
        self._places = {it: k for k, it in enumerate(controller.order)}
        self._site = site
        self._sep = controller.separations
        self._ways = drives(site, controller.depart_speed)
        m = len(site.intersection.movements)
        self._m = m
        self._marks = [float(np.interp(u - w.before, w.time, w.s)) for u, w in zip(self._sep.until, self._ways)]
        c = site.conflicts | ~site.intersection.movements.apart
        t = len(site.types)
        self._conflict = np.tile(c, (t, t))
        self._passed = np.zeros(len(controller.order), bool)
        self._first = 0
        self._kinds = controller.kinds

    def decide(self, view: View) -> Iterable[Command]:
        self._view = view
        self._advice: list[Command] = []
        seen = {(v.lane, v.rank): v for v in view.vehicles}
        for v in view.vehicles:
            self.manager.place[v.id] = self._places[v.lane, v.rank]
        self._seen = seen
        newest = {}
        for lane, rank in seen: newest[lane] = max(newest.get(lane, -1), rank)
        self._newest = getattr(self, "_newest", {})
        self._newest.update(newest)
        commands = list(super().decide(view))
        commands = [c for c in commands if not isinstance(c, Wake)]
        commands += self._advice
        commands.append(Wake(view.time + self._period))
        return commands

    def _grant(self, seen, ahead, now) -> Iterator[int]:
        slots = self.manager.slots
        latest = np.full(len(self._ways), -math.inf)
        blocked = np.zeros(len(self._ways), bool)
        left = len(self._seen)
        while self._first < len(self._order) and self._gone(self._first):
            self._first += 1
        for k in range(self._first, len(self._order)):
            if not left:
                break
            if self._gone(k):
                continue
            lane_rank = self._order[k]
            kind = self._kinds[k]
            me = self._seen.get(lane_rank)
            if me is None:  # still to come
                time = self._times[k]
                blocked |= self._conflict[kind]
                latest = np.maximum(latest, time + self._sep.between[kind])
                continue
            left -= 1
            slot = slots.get(me.id)
            if slot is None:
                free = self._free(me, kind, now)
                time = max(free, latest[kind])
                slot = None
                if not blocked[kind] and time - free < 1.0:
                    slot = self._predict(me, now, ahead.get(me.id))
                    if slot is not None and self.manager.fits(slot, last=True):
                        slots[me.id] = slot
                        self._requests.pop(me.id, None)
                        self._advice.append(Advise(me.id, math.inf))
                        yield me.id
                    else:
                        slot = None
                        time = max(time, free + 0.3)
                if slot is None:
                    blocked |= self._conflict[kind]
                    self._advice.append(Advise(me.id, self._speed(me, kind, time - now * self._dt)))
            if slot is not None:
                i = int(slot.s.searchsorted(self._marks[kind]))
                time = (slot.start + i) * self._dt
            latest = np.maximum(latest, time + self._sep.between[kind])

    def _gone(self, k: int) -> bool:
        if self._passed[k]:
            return True
        lane, rank = self._order[k]
        if (lane, rank) not in self._seen and self._newest.get(lane, -1) >= rank:
            self._passed[k] = True
            return True
        return False

    def _free(self, me: Observed, kind: int, now: int) -> float:
        """When it could be at its mark if it drove on alone."""
        from baselines.prediction import predict
        mgr = self.manager
        run = predict(mgr._law, mgr._types[me.type], mgr._ways[kind % self._m], -me.distance, me.speed)
        return (now + int(run.s.searchsorted(self._marks[kind]))) * self._dt

    def _speed(self, me: Observed, kind: int, left: float) -> float:
        way = self._ways[kind]
        limit = self._site.limit(me.lane)
        final = float(way.speed(0.0))
        a = self.manager._types[me.type].a * 0.6
        b = self.manager._types[me.type].b
        u = me.speed
        for _ in range(3):
            x = (final * final - u * u) / (2 * a) if u < final else (u * u - final * final) / (2 * b)
            x = min(x, max(me.distance - 1.0, 0.0))
            mean = (u + final) / 2.0
            rest = x / max(mean, 1.0) + float(way.until(self._marks[kind]))
            u = min(max((me.distance - x) / max(left - rest, 0.1), 2.0), limit)
        return u if u < limit else math.inf
