"""The controller's side of a link: what it has heard, which vehicles may hold, what it says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from minisim.channel import steps
from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Command,
    Go,
    Hold,
    Observed,
    Plan,
    Report,
    Reserve,
    Site,
    View,
)
from minisim.link.messages import Order, Status
from minisim.reasons import Reason
from minisim.ticks import time_of


@dataclass(slots=True)
class File:
    """What the controller knows about a vehicle, and has told it."""

    vehicle: Observed
    sent: int
    number: int
    holds: bool
    movement: int
    order: Order
    repeat: int = 0  # when to send the order again [steps]
    wanted: bool = False  # whether the session has given it the right of way
    revoked: int = 0  # number of the order that last took it away


class Promise(NamedTuple):
    """A reserved passage, and when to send it again."""

    command: Reserve
    repeat: int = 0  # [steps]


class Office:
    """The controller's side: what it has heard, which vehicles may hold, and what it tells them."""

    def __init__(self, site: Site, plan: Plan) -> None:
        self._plan = plan
        self._dt = site.dt
        self._rows = site.intersection.movements.rows
        self._foes = [[int(q) for q in row.nonzero()[0]] for row in site.conflicts]
        self._known: dict[int, File] = {}
        self._lanes: list[dict[int, File]] = [{} for _ in range(site.intersection.n)]
        #: By lane and rank, vehicles heard before one ahead of them; None has already left.
        self._early: list[dict[int, File | None]] = [{} for _ in range(site.intersection.n)]
        self._next = [0] * site.intersection.n  # rank of the next vehicle to be known
        self._gone: set[int] = set()
        self._holders: dict[int, int] = {}  # that may hold -> movement
        self._wanting: dict[int, None] = {}  # to be given the right of way, in order
        self._open: dict[int, None] = {}  # whose order is not confirmed
        self._promises: dict[int, Promise] = {}  # that can still come in time
        self._slowest = steps(site.channel.slowest, site.dt)

    @property
    def talking(self) -> bool:
        """Whether it has something to say."""
        return bool(self._open or self._wanting or self._promises)

    def view(self, now: int) -> View:
        """What the session sees: by lane, then front to back."""
        files = [file for lane in self._lanes for file in lane.values()]
        dt, waiting = self._dt, self._open
        told = {
            (me := it.vehicle.id): Report(time_of(it.sent, dt), it.holds, me not in waiting)
            for it in files
        }
        return View(time_of(now, dt), tuple(it.vehicle for it in files), told)

    def reason(self, vehicle: int) -> Reason | None:
        """Why a vehicle waits, if that is due to messages."""
        file = self._known.get(vehicle)
        if file is None:
            return Reason("not heard", vehicle)
        if not file.wanted:
            return None
        if file.order.go:
            return Reason("not told", vehicle)
        foes = self._foes[file.movement]
        others = tuple(v for v, movement in self._holders.items() if movement in foes)
        return Reason("in doubt", vehicle, others)

    def hear(self, status: Status) -> bool:
        """Note a message; returns whether the session is to be woken."""
        me = status.vehicle
        if me.id in self._gone:
            return False
        if status.left:
            return self._leave(me)
        file = self._known.get(me.id)
        if file is None:
            movement = self._rows[me.lane][me.manoeuvre]
            file = File(*status[:4], movement, Order(me.id, 0))
            self._known[me.id] = file
            self._early[me.lane][me.rank] = file
            return self._admit(me.lane)
        if status.sent < file.sent:
            return False
        passed = file.vehicle.distance
        file.vehicle, file.sent, file.number, file.holds = status[:4]
        if file.number >= file.order.number:
            self._open.pop(me.id, None)
        if not file.order.go and not file.holds and file.number >= file.revoked:
            self._holders.pop(me.id, None)
        return any(me.distance <= mark < passed for mark in self._plan.marks)

    def _admit(self, lane: int) -> bool:
        """Let the session see vehicles that have none ahead of them unheard."""
        early, new = self._early[lane], False
        while self._next[lane] in early:
            file = early.pop(self._next[lane])
            self._next[lane] += 1
            if file is not None:
                self._lanes[lane][file.vehicle.id] = file
                new = True
        return new

    def _leave(self, me: Observed) -> bool:
        self._gone.add(me.id)
        self._known.pop(me.id, None)
        self._lanes[me.lane].pop(me.id, None)
        self._holders.pop(me.id, None)
        self._wanting.pop(me.id, None)
        self._open.pop(me.id, None)
        self._promises.pop(me.id, None)
        if me.rank >= self._next[me.lane]:
            self._early[me.lane][me.rank] = None
            self._admit(me.lane)
        return self._plan.wake_on_clear

    def take(self, command: Command) -> None:
        """Note what the session wants of a vehicle; none can tell one that has left."""
        file = self._known.get(getattr(command, "vehicle", -1))
        if file is None:
            return
        match command:
            case Reserve(vehicle):
                self._promises[vehicle] = Promise(command)
            case Go(vehicle):
                if not file.wanted:
                    file.wanted, self._wanting[vehicle] = True, None
            case Hold(vehicle):
                self._wanting.pop(vehicle, None)
                if file.order.go:
                    self._change(file, go=False)
                    file.revoked = file.order.number
                file.wanted = False
            case Advise(vehicle, speed) if speed != file.order.speed:
                self._change(file, speed=speed)
            case Brake(vehicle, braking) if braking != file.order.braking:
                self._change(file, braking=braking)
            case Accelerate(vehicle, asked) if asked != file.order.acceleration:
                self._change(file, acceleration=asked)

    def _change(self, file: File, **what: Any) -> None:
        file.order = file.order._replace(number=file.order.number + 1, **what)
        file.repeat = 0
        self._open[file.vehicle.id] = None

    def promises(self, now: int, interval: int) -> Iterator[Reserve]:
        """The promises to send now: each at once, and again while that is sure to come in time."""
        for vehicle, (command, repeat) in list(self._promises.items()):
            if time_of(now + self._slowest, self._dt) > command.time and repeat:
                del self._promises[vehicle]
            elif now >= repeat:
                self._promises[vehicle] = Promise(command, now + interval)
                yield command

    def orders(self, now: int, interval: int) -> Iterator[Order]:
        """Give the right of way where that is safe; what to send now."""
        for vehicle in list(self._wanting):
            file = self._known[vehicle]
            if self._is_next(file) and self._is_free(file):
                del self._wanting[vehicle]
                self._holders[vehicle] = file.movement
                self._change(file, go=True)
        for vehicle in self._open:
            file = self._known[vehicle]
            if now >= file.repeat:
                file.repeat = now + interval
                yield file.order

    def _is_next(self, me: File) -> bool:
        """Whether every vehicle ahead in its lane has been given the right of way."""
        lane = self._lanes[me.vehicle.lane].values()
        return all(it.order.go for it in lane if it.vehicle.rank < me.vehicle.rank)

    def _is_free(self, me: File) -> bool:
        """Whether no vehicle in conflict may hold the right of way."""
        return not any(q in self._holders.values() for q in self._foes[me.movement])
