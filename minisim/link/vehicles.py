"""The vehicles' side of a link: they say what they do, and do what they are told."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Command,
    Go,
    Hold,
    Observed,
    Reserve,
    Site,
    View,
    can_stop,
)
from minisim.link.messages import Confirmed, Order, Status
from minisim.reasons import Reason
from minisim.ticks import time_of


@dataclass(slots=True)
class Unit:
    """What a vehicle knows about itself."""

    order: Order
    holds: bool = False
    reserved: Reserve | None = None  # not yet in effect
    passage: Reserve | None = None  # in effect


class Vehicles:
    """The vehicles' side: they say what they do, and do what they are told."""

    def __init__(self, site: Site) -> None:
        self._dt = site.dt
        self._brakes = [it.deceleration for it in site.types]
        self._units: dict[int, Unit] = {}
        self._present: dict[int, Observed] = {}
        self._left: dict[int, Observed] = {}  # that still say so

    @property
    def talking(self) -> bool:
        """Whether any vehicle has something to say."""
        return bool(self._present or self._left)

    def look(self, view: View) -> None:
        """Note where the vehicles are, and which have left."""
        before, self._present = self._present, {v.id: v for v in view.vehicles}
        for vehicle, seen in before.items():
            if vehicle not in self._present:
                self._left[vehicle] = seen
                del self._units[vehicle]
        for vehicle in self._present.keys() - before.keys():
            self._units[vehicle] = Unit(Order(vehicle, 0))

    def holds(self, vehicle: int) -> bool:
        """Whether a vehicle in view has the right of way."""
        return self._units[vehicle].holds

    def reason(self, vehicle: int) -> Reason | None:
        """Why it waits, if it knows from when on it may go."""
        passage = self._units[vehicle].reserved
        if passage is None:
            return None
        return Reason("told for later", vehicle, until=passage.time)

    def statuses(self, now: int) -> Iterator[Status]:
        """What they say now."""
        for vehicle, seen in self._present.items():
            unit = self._units[vehicle]
            yield Status(seen, now, unit.order.number, unit.holds, left=False)
        for seen in self._left.values():
            yield Status(seen, now, 0, holds=False, left=True)

    def reserve(self, now: int) -> Iterator[Command]:
        """Begin reserved passages, and give up those that are not kept."""
        time = time_of(now, self._dt)
        for vehicle, unit in self._units.items():
            if unit.reserved is not None and unit.reserved.time <= time:
                unit.passage, unit.reserved, unit.holds = unit.reserved, None, True
                yield Go(vehicle)
                if unit.order.speed < inf:
                    yield Advise(vehicle, inf)
            me = self._present[vehicle]
            if unit.passage is not None and not unit.passage.keeps(me, time) and self._stops(me):
                unit.passage, unit.holds = None, False
                yield Hold(vehicle)
                if unit.order.speed < inf:
                    yield Advise(vehicle, unit.order.speed)

    def obey(self, message: Order | Reserve | Confirmed, now: int) -> Iterator[Command]:
        """Do what a message says."""
        unit = self._units.get(message.vehicle)
        if isinstance(message, Confirmed):
            self._left.pop(message.vehicle, None)
        elif unit is None:
            return
        elif isinstance(message, Reserve):
            if time_of(now, self._dt) <= message.time and message is not unit.passage:
                unit.reserved = message
        elif message.number > unit.order.number:
            yield from self._follow(unit, message)

    def _follow(self, unit: Unit, new: Order) -> Iterator[Command]:
        old, unit.order = unit.order, new
        if unit.passage is None:
            if new.go and not unit.holds:
                unit.holds = True
                yield Go(new.vehicle)
            elif unit.holds and not new.go and self._stops(self._present[new.vehicle]):
                unit.holds = False
                yield Hold(new.vehicle)
            if new.speed != old.speed:
                yield Advise(new.vehicle, new.speed)
        if new.braking != old.braking:
            yield Brake(new.vehicle, new.braking)
        if new.acceleration != old.acceleration:
            yield Accelerate(new.vehicle, new.acceleration)

    def _stops(self, me: Observed) -> bool:
        return can_stop(me, self._brakes[me.type])
