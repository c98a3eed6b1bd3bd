"""How vehicles get passages, and keep them or lose them; in which order is left to each session.

Every `period` the session compares holders with their predictions, and predicts again where they
differ. A holder whose new passage no longer fits loses it if it can still stop, and so does its
follower. So the passage of a vehicle that can no longer stop fits those of all others that cannot,
and the rest yield. What remains is the error of a prediction over the last seconds before the
zones, from a state at most one period old; the buffer of the `Manager` covers it.

If messages fail, no passage is taken away: see `baselines.promises`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

from baselines.manager import Manager, Slot
from minisim.control import (
    Advise,
    Command,
    Go,
    Hold,
    Observed,
    Plan,
    Site,
    View,
    Wake,
    can_stop,
)
from minisim.reasons import Reason


class Passages:
    """Passages of which vehicles hear at once."""

    def __init__(self, manager: Manager, site: Site) -> None:
        self.manager = manager
        self.now = -1  #: when it last looked [steps]
        self.seen: Mapping[int, Observed] = {}  #: the vehicles then, by id
        self.ahead: Mapping[int, int] = {}  #: the one directly ahead in the lane, by id
        self._dt = site.dt
        self._brakes = [it.deceleration for it in site.types]

    def look(self, view: View) -> Iterator[Command]:
        """Note where the vehicles are; take passages away that are no longer kept."""
        self.now = now = round(view.time / self._dt)
        self.seen = {it.id: it for it in view.vehicles}
        pairs = pairwise(view.vehicles)
        self.ahead = {it.id: before.id for before, it in pairs if before.lane == it.lane}
        slots = self.manager.slots
        self.manager.slots = {v: slot for v, slot in slots.items() if slot.ends >= now}
        yield from self._review()

    def since(self, vehicle: int) -> int:  # noqa: ARG002
        """When a vehicle was where it is seen [steps]."""
        return self.now

    def ask(self, vehicle: int) -> Slot | None:
        """The passage that a vehicle could have now; None behind one without a passage."""
        leader = self.ahead.get(vehicle)
        if leader is not None and leader not in self.manager.slots:
            return None
        return self.manager.predict(self.seen[vehicle], self.now)

    def give(self, slot: Slot) -> Command:
        """Give a vehicle its passage."""
        self.manager.slots[slot.vehicle] = slot
        return Go(slot.vehicle)

    def advise(self, vehicle: int, speed: float) -> Iterator[Command]:
        """Advise a vehicle a speed [m/s], as far as it can be told."""
        yield Advise(vehicle, speed)

    def _review(self) -> Iterator[Command]:
        """Renew outdated passages, and take away those that no longer fit.

        Vehicles that cannot stop come first and always keep theirs. If one of them no longer fits,
        every passage of a vehicle that can stop is checked again.
        """
        slots, seen = self.manager.slots, self.seen
        stops = {v: can_stop(seen[v], self._brakes[seen[v].type]) for v in slots if v in seen}
        changed: set[int] = set()
        misfit = False
        for vehicle in sorted(stops, key=stops.__getitem__):
            slot: Slot | None = slots[vehicle]
            off = not slots[vehicle].expects(seen[vehicle], self.now)
            if off or self.ahead.get(vehicle) in changed:
                changed.add(vehicle)
                slot = self.ask(vehicle)
            elif not (misfit and stops[vehicle]):
                continue
            if slot is not None and self.manager.fits(slot, last=False):
                slots[vehicle] = slot
            elif stops[vehicle]:
                changed.add(vehicle)
                del slots[vehicle]
                yield Hold(vehicle)
            else:
                misfit = True
                slots[vehicle] = slot or slots[vehicle]


class PassageSession(ABC):
    """One run: gives passages, and looks again every `period`."""

    def __init__(self, passages: Passages, plan: Plan, period: float, site: Site) -> None:
        self.passages, self.plan = passages, plan
        self._period = site.period("period", period)
        self._dt = site.dt
        self._said: dict[int, Reason] = {}  # as of the last look, if it was asked

    @property
    def manager(self) -> Manager:
        """Knows the passages."""
        return self.passages.manager

    def decide(self, view: View) -> Iterable[Command]:
        """Review the passages that vehicles hold, then give others."""
        commands = [*self.passages.look(view), *self._grant()]
        if view.vehicles:
            commands.append(Wake(view.time + self._period))
        return commands

    @abstractmethod
    def _grant(self) -> Iterator[Command]:
        """Give the passages that are possible."""

    def reasons(self, view: View) -> dict[int, Reason]:
        """Why vehicles before the junction wait or go (`minisim.reasons.Explaining`)."""
        if round(view.time / self._dt) == self.passages.now:  # later, passages may have ended
            self._said = dict(self._explain(view))
        before = (v.id for v in view.vehicles if v.distance >= 0.0)
        return {vehicle: self._said[vehicle] for vehicle in before if vehicle in self._said}

    def _explain(self, view: View) -> Iterator[tuple[int, Reason]]:
        """The reasons of holders and of those that have none without a passage ahead of them."""
        slots, leader = self.manager.slots, None
        for me in view.vehicles:
            if leader is not None and leader.lane != me.lane:
                leader = None
            if me.id in slots:
                yield me.id, Reason("passage", me.id, until=slots[me.id].enters * self._dt)
            elif leader is None or leader.id in slots:
                yield me.id, self._waits(me.id)
            leader = me if me.distance >= 0.0 else None

    def _waits(self, vehicle: int) -> Reason:
        """Why a vehicle has no passage."""
        slot = self.passages.ask(vehicle)
        if slot is None or slot.hard:
            return Reason("no passage", vehicle)
        others = tuple(it.vehicle for it in self.manager.misfits(slot, last=True))
        return Reason("no passage" if others else "looks again", vehicle, others)
