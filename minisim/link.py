"""Right of way by messages that come late or never: what vehicles and a controller do about it.

It works for every controller with a `radio`, in every host. Messages go through a `Channel`:

- From `Plan.sight` on, a vehicle says where it is, how fast, what it was told last, and whether it
  has the right of way: every `Radio.interval`, until the controller confirms that it has left.
- The controller knows no more than that. It sees a vehicle where it last said that it was, once it
  has heard from all ahead of it in its lane, and until it has heard that it has left.
- One message tells a vehicle all that it shall do: right of way, speed, brakes. It has a number,
  and is repeated every interval until the vehicle names that number. Vehicles do what the highest
  number says. Until told, they stop at their hold lines.

Safety, after Dresner and Stone (JAIR 31 (2008), section 2: a lost message may cost time, but must
not cause a collision). A vehicle *may hold* the right of way from the first message that gives it
until it has left, or has said that it gave it up. Right of way is given only while no vehicle in
conflict may hold it, whatever the controller commands, so no loss or delay lets two in conflict go
at once. A vehicle that is told to stop and no longer can keeps its right of way, and says so. In
each lane, right of way is given from front to back, so those that hold it can leave, and others get
their turn.

A `Reserve` does not wait for vehicles in conflict: the session answers for it, since it knows when
the vehicle will be where. It is sent once, takes effect at a time that both know (all clocks are
right), and is void if it comes later.

Lights (`Open`, `Close`) are seen, not sent.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any, NamedTuple

from minisim.channel import Air, Channel, chances, steps
from minisim.control import (
    Advise,
    Brake,
    Command,
    Controller,
    Counting,
    Cover,
    Go,
    Hold,
    Observed,
    Plan,
    Radio,
    Report,
    Reserve,
    Session,
    Site,
    View,
    Wake,
    as_controller,
    can_stop,
    cover_of,
    keeps,
)
from minisim.errors import InputError, show
from minisim.hosting import Alarm, check_command
from minisim.names import name_of
from minisim.parameters import checked, declared, part
from minisim.ticks import NEVER, time_of


def radio_of(controller: object) -> Radio | None:
    """The messages of a controller; None if nothing is sent."""
    radio: Radio | None = getattr(controller, "radio", None)
    return radio


def _talking(title: str, value: Controller) -> Controller:
    if isinstance(value, Linked):
        raise InputError(f"the messages of {value.name} fail already")
    if radio_of(as_controller(f"{title} {show(value)}", value)) is None:
        raise InputError(
            f"messages can fail only with a controller that vehicles talk to, such as v2ic; "
            f"{name_of(value)} sends none"
        )
    return value


@declared
class Linked:
    """A controller whose messages fail."""

    controller: Controller = checked("decides, and has a `radio`", _talking, "Controller")
    channel: Channel = part("what its messages go through", Channel, default=Channel())

    @property
    def name(self) -> str:
        """The controller's name and what fails: `v2ic+loss=0.3`."""
        return f"{name_of(self.controller)}{self.channel}"

    @property
    def radio(self) -> Radio | None:
        """That of the controller."""
        return radio_of(self.controller)

    @property
    def covers(self) -> Cover:
        """What the controller covers."""
        return cover_of(self.controller)

    def start(self, site: Site) -> Session:
        """Begin a run; raises what the controller's `start` raises."""
        site = site.with_channel(self.channel)
        session = self.controller.start(site)
        if not self.channel or not isinstance(getattr(session, "plan", None), Plan):
            return session  # without a plan, the host refuses it
        return Link(session, self.radio or Radio(), site)


class Status(NamedTuple):
    """A message from a vehicle."""

    vehicle: Observed
    sent: int  # [steps]
    number: int  # of the order that it follows
    holds: bool  # whether it has the right of way
    left: bool  # whether its rear bumper has left the junction


class Order(NamedTuple):
    """A message to a vehicle: all that it shall do."""

    vehicle: int
    number: int
    go: bool = False
    speed: float = inf  # advised [m/s]
    braking: float = 0.0  # [m/s²]


class Confirmed(NamedTuple):
    """A message to a vehicle: the controller knows that it has left."""

    vehicle: int


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
            me = self._present[vehicle]
            if unit.passage is not None and not unit.passage.keeps(me, time) and self._stops(me):
                unit.passage, unit.holds = None, False
                yield Hold(vehicle)

    def obey(self, message: Order | Reserve | Confirmed, now: int) -> Iterator[Command]:
        """Do what a message says."""
        unit = self._units.get(message.vehicle)
        if isinstance(message, Confirmed):
            self._left.pop(message.vehicle, None)
        elif unit is None:
            return
        elif isinstance(message, Reserve):
            if time_of(now, self._dt) <= message.time:
                unit.reserved = message
        elif message.number > unit.order.number:
            yield from self._follow(unit, message)

    def _follow(self, unit: Unit, new: Order) -> Iterator[Command]:
        old, unit.order = unit.order, new
        if new.go and not unit.holds:
            unit.holds = True
            yield Go(new.vehicle)
        elif unit.holds and not new.go and self._stops(self._present[new.vehicle]):
            unit.holds, unit.passage, unit.reserved = False, None, None
            yield Hold(new.vehicle)
        if new.speed != old.speed:
            yield Advise(new.vehicle, new.speed)
        if new.braking != old.braking:
            yield Brake(new.vehicle, new.braking)

    def _stops(self, me: Observed) -> bool:
        return can_stop(me, self._brakes[me.type])


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

    @property
    def talking(self) -> bool:
        """Whether it has something to say."""
        return bool(self._open or self._wanting)

    def view(self, now: int) -> View:
        """What the session sees: by lane, then front to back."""
        files = [file for lane in self._lanes for file in lane.values()]
        told = {it.vehicle.id: Report(time_of(it.sent, self._dt), it.holds) for it in files}
        return View(time_of(now, self._dt), tuple(it.vehicle for it in files), told)

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

    def _change(self, file: File, **what: Any) -> None:
        file.order = file.order._replace(number=file.order.number + 1, **what)
        file.repeat = 0
        self._open[file.vehicle.id] = None

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


class Link:
    """One run: a session, its vehicles, and the air between them; times in steps."""

    def __init__(self, session: Session, radio: Radio, site: Site) -> None:
        self._session, self._site, self._dt = session, site, site.dt
        plan, road = session.plan, site.intersection.approach_length
        # All that is known comes by message, so the host wakes only for vehicles that come and go.
        self.plan: Plan = replace(
            plan, marks=(min(plan.sight, road),), period=None, wake_on_clear=True,
            wake_when_empty=False,
        )  # fmt: skip
        self._interval = max(steps(radio.interval, site.dt), 1)
        self._vehicles, self._office = Vehicles(site), Office(site, plan)
        random = chances(site.seed)
        self._up: Air[Status] = Air(site.channel, site.dt, random)
        self._down: Air[Order | Reserve | Confirmed] = Air(site.channel, site.dt, random)
        self._alarm = Alarm(plan.period, site.dt)
        self._due = 0  # when vehicles speak next
        self._began = False
        self.__module__ = type(session).__module__  # where errors come from

    def __getattr__(self, name: str) -> Any:
        """Whatever else the session has, such as `kind`."""
        return getattr(self._session, name)

    @property
    def counts(self) -> Mapping[str, float]:
        """What the session counts, and the messages."""
        own = self._session.counts if keeps(self._session, Counting) else {}
        return {
            **own,
            "states_sent": self._up.sent,
            "orders_sent": self._down.sent,
            "messages_lost": self._up.lost + self._down.lost,
        }

    def decide(self, view: View) -> Iterable[Command]:
        """One step: vehicles speak, the controller listens, decides and speaks, vehicles obey."""
        now = round(view.time / self._dt)
        vehicles, office = self._vehicles, self._office
        vehicles.look(view)
        commands = [*vehicles.reserve(now)]
        if now >= self._due:
            self._due = now + self._interval
            for status in vehicles.statuses(now):
                self._up.send(now, status)
        wake = not self._began or now >= self._alarm.tick
        for status in self._up.receive(now):
            wake |= office.hear(status)
            if status.left:
                self._down.send(now, Confirmed(status.vehicle.id))
        if wake:
            commands += self._decide(now)
        for order in office.orders(now, self._interval):
            self._down.send(now, order)
        for message in self._down.receive(now):
            commands += vehicles.obey(message, now)
        commands += vehicles.reserve(now)
        if (at := self._next(now)) is not None:
            commands.append(Wake(time_of(at, self._dt)))
        return commands

    def _decide(self, now: int) -> Iterator[Command]:
        """Ask the session; the commands that need no message."""
        self._began = True
        self._alarm.reset(now)
        for command in self._session.decide(self._office.view(now)):
            check_command(command, now, self._site)
            if isinstance(command, Wake):
                self._alarm.set(command)
            elif isinstance(command, Reserve):
                self._down.send(now, command)
            elif isinstance(command, Go | Hold | Advise | Brake):
                self._office.take(command)
            else:
                yield command

    def _next(self, now: int) -> int | None:
        """When to be woken next; None if nothing is under way."""
        talking = self._vehicles.talking or self._office.talking
        due = min(self._due if talking else NEVER, self._up.next, self._down.next, self._alarm.tick)
        return None if due == NEVER else max(due, now + 1)
