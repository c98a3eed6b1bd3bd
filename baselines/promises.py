"""Reservations by messages that fail (`minisim.link`): passages are promises, and none is revoked.

A `Reserve` takes effect when the slowest message has arrived, as in Crossroads (Andert, Khayatian,
Shrivastava, DAC 2017). Until then the vehicle counts as held, so its passage is known even if the
manager last heard of it a while ago. If the message gets lost, the vehicle says later that it holds
nothing. Only then is its passage free again: until then, the message may have been heard.

A vehicle keeps to its passage within half the `buffer`, or gives it up while it can stop, as the
vehicles of Dresner and Stone cancel. So two in conflict stay out of each other's zones, and a
vehicle gives up if the one ahead of it did not hear of its own passage. A vehicle that another one
slows down in its exit lane would be early without that one. So its request is refused until the
other has said that it holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping

from baselines.reservation import POSITION_TOLERANCE, Reservation, ReservationSession, Slot
from minisim.channel import steps
from minisim.control import Command, Observed, Plan, Report, Reserve, Site, View
from minisim.ticks import time_of


class PromiseSession(ReservationSession):
    """One run in which messages fail: keeps promises in line with what is heard."""

    def __init__(self, controller: Reservation, site: Site) -> None:
        channel, reach = site.channel, controller.reach
        super().__init__(controller, site)
        self._rows = site.intersection.movements.rows
        self._exits = [path.exit_arm for path in site.intersection.paths]
        self._wait = steps(channel.slowest, site.dt)
        if reach is None:
            late = 2.0 * channel.slowest + controller.radio.interval
            reach = min(
                self.plan.sight + late * site.speed_limit, site.intersection.approach_length
            )
            self.plan = Plan(marks=(reach,), sight=reach)
        self._slack = controller.buffer / 2.0 / site.dt
        self._reports: Mapping[int, Report] = {}
        self._effect: dict[int, int] = {}  #: when each vehicle's reservation takes effect [steps]
        self._sure: set[int] = set()  #: vehicles that are known to keep to their passages
        self._strays: list[Observed] = []  #: that hold the right of way after their passage

    def decide(self, view: View) -> Iterable[Command]:
        """Note what the vehicles say, then consider their requests."""
        self._reports = view.reports
        return super().decide(view)

    def _revoke(self, seen: dict[int, Observed], ahead: dict[int, int], now: int) -> Iterator[int]:  # noqa: ARG002
        """Forget reservations that did not arrive or were given up, and note which are sure."""
        slots = self.manager.slots
        self._sure = slots.keys() - seen.keys()
        self._strays = [seen[v] for v in seen if v not in slots and self._reports[v].holds]
        for vehicle in seen:
            report, leader = self._reports[vehicle], ahead.get(vehicle)
            if vehicle not in slots or self._step(report) <= self._effect[vehicle]:
                continue
            if not report.holds:
                del slots[vehicle]
            elif leader is None or leader in self._sure:
                self._sure.add(vehicle)
        yield from ()

    def _grant(self, seen: dict[int, Observed], ahead: dict[int, int], now: int) -> Iterator[int]:
        """Reserve what is possible; return the ids of the new holders."""
        slots = self.manager.slots
        for vehicle in list(self._requests):
            slot = self._passage(seen[vehicle], ahead.get(vehicle), now + self._wait)
            if slot is not None and self.manager.fits(slot, last=True):
                slots[vehicle], self._effect[vehicle] = slot, now + self._wait
                del self._requests[vehicle]
                yield vehicle

    def _passage(self, me: Observed, leader: int | None, effect: int) -> Slot | None:
        """A vehicle's passage from `effect` [steps] on; None if it cannot be sure."""
        manager, report = self.manager, self._reports[me.id]
        then = self._step(report)
        met = [slot for slot in manager.slots.values() if self._meets(me, slot)]
        unknown = leader is not None and leader not in manager.slots
        if report.holds or unknown or any(slot.start > then for slot in met):
            return None
        slot = manager.predict(me, then, effect - then)
        doubtful = [it.vehicle for it in met if it.vehicle not in self._sure and it.lane != me.lane]
        if slot is None or any(
            self._rows[it.lane][it.manoeuvre] in slot.zones for it in self._strays
        ):
            return None
        if doubtful:
            without = manager.predict(me, then, effect - then, doubtful)
            if without is None or without.s.shape != slot.s.shape or (without.s != slot.s).any():
                return None
        return slot

    def _possible(self, me: Observed, leader: int | None) -> Slot | None:
        return self._passage(me, leader, self._now + self._wait)

    def _meets(self, me: Observed, slot: Slot) -> bool:
        """Whether a vehicle leaves by the same lane as a holder, or comes from the same one."""
        exits = self._exits
        return slot.lane == me.lane or (
            exits[slot.movement] == exits[self._rows[me.lane][me.manoeuvre]]
        )

    def _permit(self, vehicle: int) -> Command:
        """The promise of a passage."""
        slot, dt, slack = self.manager.slots[vehicle], self._dt, self._slack
        last = len(slot.s) - 1

        def keeps(me: Observed, time: float) -> bool:
            now = time / dt - slot.start
            first, end = math.ceil(now - slack - 1e-6), math.floor(now + slack + 1e-6)
            low, high = (slot.s[min(max(k, 0), last)] for k in (first, end))
            return bool(low - POSITION_TOLERANCE <= -me.distance <= high + POSITION_TOLERANCE)

        return Reserve(vehicle, time_of(self._effect[vehicle], dt), keeps)

    def _step(self, report: Report) -> int:
        return round(report.time / self._dt)
