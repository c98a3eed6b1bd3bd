"""A controller whose messages fail, and its sessions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from minisim.channel import Air, Chances, Channel, steps
from minisim.control import (
    TO_VEHICLES,
    Command,
    Controller,
    Counting,
    Cover,
    Plan,
    Radio,
    Reserve,
    Session,
    Site,
    View,
    Wake,
    as_controller,
    check_command,
    cover_of,
    keeps,
)
from minisim.errors import InputError, show
from minisim.hosting import Alarm, listed
from minisim.link.messages import Confirmed, Order, Status
from minisim.link.office import Office
from minisim.link.vehicles import Vehicles
from minisim.names import name_of
from minisim.parameters import checked, declared, part
from minisim.reasons import Explaining, Reason
from minisim.ticks import NEVER, time_of


def radio_of(controller: object) -> Radio | None:
    """The messages of a controller; None if nothing is sent."""
    radio: Radio | None = getattr(controller, "radio", None)
    return radio


def _talking(title: str, value: Controller) -> Controller:
    if isinstance(value, Linked):
        raise InputError(f"the messages of {value.name} fail already")
    if radio_of(as_controller(value, f"{title} {show(value)}")) is None:
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
        sound = keeps(session, Session) and isinstance(session.plan, Plan)  # or the host refuses it
        return Link(session, self.radio or Radio(), site) if self.channel and sound else session


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
        random = Chances(site.seed)
        self._up: Air[Status] = Air(site.channel, site.dt, random)
        self._down: Air[Order | Reserve | Confirmed] = Air(site.channel, site.dt, random)
        self._alarm = Alarm(plan.period, site.dt)
        self._due = 0  # when vehicles speak next
        self._began = False
        self.__module__ = type(session).__module__  # where errors come from

    def __getattr__(self, name: str) -> Any:
        """Whatever else the session has, such as `kind`."""
        if name.startswith("_"):  # a copy has no session yet when it is asked for its methods
            raise AttributeError(name)
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

    def reasons(self, view: View) -> dict[int, Reason]:
        """Why the first vehicles of the lanes wait, and which messages are missing."""
        fronts = {v.lane: v.id for v in reversed(view.vehicles) if v.distance >= 0.0}
        waiting = [v for v in fronts.values() if not self._vehicles.holds(v)]
        known, said = self._office.view(round(view.time / self._dt)), {}
        if isinstance(self._session, Explaining):
            said = dict(self._session.reasons(known))
        for vehicle in list(said):
            if vehicle not in waiting:
                del said[vehicle]
            elif said[vehicle].kind == "passage":  # which the vehicle does not hold yet
                said[vehicle] = Reason("not told", vehicle)
        for vehicle in waiting:
            reason = self._vehicles.reason(vehicle) or self._office.reason(vehicle)
            if reason is not None:
                said[vehicle] = reason
        return said

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
        for promise in office.promises(now, self._interval):
            self._down.send(now, promise)
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
        for command in listed(self._session.decide(self._office.view(now))):
            check_command(command, now, self._site)
            if isinstance(command, Wake):
                self._alarm.set(command)
            elif isinstance(command, TO_VEHICLES):
                self._office.take(command)
            else:
                yield command

    def _next(self, now: int) -> int | None:
        """When to be woken next; None if nothing is under way."""
        talking = self._vehicles.talking or self._office.talking
        due = min(self._due if talking else NEVER, self._up.next, self._down.next, self._alarm.tick)
        return None if due == NEVER else max(due, now + 1)
