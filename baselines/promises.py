"""Passages by messages that fail (`minisim.link`): they are promises, and none is revoked.

A `Reserve` takes effect when the slowest message has arrived, as in Crossroads (Andert, Khayatian,
Shrivastava, DAC 2017). Until then the vehicle counts as held, so its passage is known even if the
manager last heard of it a while ago. If the message gets lost, the vehicle says later that it holds
nothing. Only then is its passage free again: until then, the message may have been heard.

Each promise that a vehicle did not hear lets its next one take effect a period later, so the link
can repeat it more often. The first promise to another vehicle begins with what the last one that
was heard took, less a period. With `n` repetitions a period, the k-th promise to a vehicle is lost
with a probability of at most loss^(1 + n (k - 1)). So the number of promises needs no limit: it is
finite at every loss below 1, and at a loss of 1 no vehicle is ever heard of.

A vehicle keeps to its passage within half the `buffer`, or gives it up while it can stop, as the
vehicles of Dresner and Stone cancel. So two in conflict stay out of each other's zones, and a
vehicle gives up if the one ahead of it did not hear of its own passage. A vehicle that another one
slows down in its exit lane would be early without that one. So its request is refused until the
other has said that it holds.

Advice ends when a promise takes effect. Until then a passage depends on it, so a vehicle gets a
promise or other advice only once it has said that it follows the advice before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from baselines.manager import POSITION_TOLERANCE, Manager, Slot
from baselines.passages import Passages
from minisim.channel import steps
from minisim.control import Command, Observed, Report, Reserve, Site, View
from minisim.ticks import time_of

#: Advice that differs no more is alike [m/s]: so vehicles tell each other of a new speed, too (the
#: rule by which a CAM is generated: ETSI EN 302 637-2, V1.3.1 (2014), 6.1.3).
ALIKE = 0.5


class _Said(NamedTuple):
    """What a vehicle was told."""

    effect: int = -1  # when its last promise takes effect [steps]
    late: int | None = None  # so many periods later than it could; None before the first promise
    heard: bool = False  # whether it has heard that promise
    advice: float = math.inf  # [m/s]


class Promises(Passages):
    """Passages of which vehicles hear late or never: kept in line with what they say."""

    def __init__(self, manager: Manager, site: Site, period: float, buffer: float) -> None:
        super().__init__(manager, site)
        self._rows = site.intersection.movements.rows
        self._exits = [path.exit_arm for path in site.intersection.paths]
        self._wait = steps(site.channel.slowest, site.dt)
        self._longer = steps(period, site.dt)
        self._late = 0  # how many periods later the first promise to a vehicle takes effect
        self._slack = buffer / 2.0 / site.dt
        self._reports: Mapping[int, Report] = {}
        self._told: dict[int, _Said] = {}
        self._sure: set[int] = set()  # vehicles that are known to keep to their passages
        self._strays: list[Observed] = []  # that hold the right of way after their passage

    def look(self, view: View) -> Iterator[Command]:
        """Note what the vehicles say."""
        self._reports = view.reports
        self._told = {it.id: self._told.get(it.id, _Said()) for it in view.vehicles}
        return super().look(view)

    def since(self, vehicle: int) -> int:
        """When a vehicle was where it is seen [steps]."""
        return round(self._reports[vehicle].time / self._dt)

    def _review(self) -> Iterator[Command]:
        """Forget passages of which vehicles did not hear or that they gave up; which are sure."""
        slots, seen = self.manager.slots, self.seen
        self._sure = slots.keys() - seen.keys()
        self._strays = [seen[v] for v in seen if v not in slots and self._reports[v].holds]
        for vehicle in seen:
            leader, told = self.ahead.get(vehicle), self._told[vehicle]
            if vehicle not in slots or self.since(vehicle) <= told.effect:
                continue
            if not self._reports[vehicle].holds:
                del slots[vehicle]
                self._note(vehicle, heard=False)
                continue
            if not told.heard:
                self._note(vehicle, heard=True)
            if leader is None or leader in self._sure:
                self._sure.add(vehicle)
        yield from ()

    def _note(self, vehicle: int, *, heard: bool) -> None:
        """Let promises take effect earlier if one was heard, or else later."""
        told = self._told[vehicle]
        late = told.late or 0
        if heard:
            self._late = max(late - 1, 0)
        else:
            late += 1
            self._late = max(self._late, late)
        self._told[vehicle] = told._replace(late=late, heard=heard)

    def ask(self, vehicle: int) -> Slot | None:
        """A vehicle's passage from when a promise takes effect; None if it cannot be sure."""
        manager, report, me = self.manager, self._reports[vehicle], self.seen[vehicle]
        then, leader = self.since(vehicle), self.ahead.get(vehicle)
        met = [slot for slot in manager.slots.values() if self._meets(me, slot)]
        unknown = leader is not None and leader not in manager.slots
        if report.holds or not report.follows or unknown or any(slot.start > then for slot in met):
            return None
        held, advice = self._effect(vehicle) - then, self._told[vehicle].advice
        slot = manager.predict(me, then, held, advice=advice)
        doubtful = [it.vehicle for it in met if it.vehicle not in self._sure and it.lane != me.lane]
        if slot is None or any(
            self._rows[it.lane][it.manoeuvre] in slot.zones for it in self._strays
        ):
            return None
        if doubtful:
            without = manager.predict(me, then, held, doubtful, advice)
            if without is None or without.s.shape != slot.s.shape or (without.s != slot.s).any():
                return None
        return slot

    def give(self, slot: Slot) -> Command:
        """Promise a vehicle its passage."""
        vehicle, dt, slack = slot.vehicle, self._dt, self._slack
        effect, last = self._effect(vehicle), len(slot.s) - 1
        self.manager.slots[vehicle] = slot
        told = self._told[vehicle]
        self._told[vehicle] = told._replace(effect=effect, late=self._periods(vehicle))

        def keeps(me: Observed, time: float) -> bool:
            now = time / dt - slot.start
            first, end = math.ceil(now - slack - 1e-6), math.floor(now + slack + 1e-6)
            low, high = (slot.s[min(max(k, 0), last)] for k in (first, end))
            return bool(low - POSITION_TOLERANCE <= -me.distance <= high + POSITION_TOLERANCE)

        return Reserve(vehicle, time_of(effect, dt), keeps)

    def advise(self, vehicle: int, speed: float) -> Iterator[Command]:
        """Advise a vehicle a speed [m/s], unless it may hold or has not said that it follows.

        No more than `ALIKE` from the advice before is no news: it would only delay a promise.
        """
        report = self._reports[vehicle]
        if math.isclose(speed, self._told[vehicle].advice, rel_tol=0.0, abs_tol=ALIKE):
            return
        if report.follows and not report.holds and vehicle not in self.manager.slots:
            self._told[vehicle] = self._told[vehicle]._replace(advice=speed)
            yield from super().advise(vehicle, speed)

    def _effect(self, vehicle: int) -> int:
        """When a promise that is made now takes effect [steps]."""
        return self.now + self._wait + self._longer * self._periods(vehicle)

    def _periods(self, vehicle: int) -> int:
        """How many periods later than it could a promise to a vehicle takes effect."""
        late = self._told[vehicle].late
        return self._late if late is None else late

    def _meets(self, me: Observed, slot: Slot) -> bool:
        """Whether a vehicle leaves by the same lane as a holder, or comes from the same one."""
        exits = self._exits
        return slot.lane == me.lane or (
            exits[slot.movement] == exits[self._rows[me.lane][me.manoeuvre]]
        )


def passages_of(manager: Manager, site: Site, period: float, buffer: float) -> Passages:
    """Promises if messages fail, else passages of which vehicles hear at once."""
    if site.channel:
        return Promises(manager, site, period, buffer)
    return Passages(manager, site)
