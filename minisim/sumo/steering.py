"""Tells vehicles in SUMO what the road ahead and the controller ask of them.

`Follower` steers SUMO's IDM and Krauss. minisim's laws (`minisim.laws`) compute what a hold line, a
marking or a turn asks for. SUMO gets it as a speed: a desired speed (`setMaxSpeed`) where a lower
limit applies, or a commanded speed (`setSpeed`) while a vehicle has to brake for what is ahead.
A command heeds the leaders, too. `minisim.sumo.cruising` steers SUMO's `CC`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from minisim import laws
from minisim.engine.state import Records
from minisim.laws import STOP_MARGIN, Law, Traits
from minisim.sumo.messages import Job

#: SUMO keeps the maximum acceleration (2) but not the right of way (8 off). A commanded speed may
#: brake harder than is comfortable (4 off) and keeps the gaps itself: if SUMO kept them (1),
#: vehicles would stop faster than their brakes allow. (SUMO, TraCI/Change Vehicle State, speed
#: mode.) Inside the junction, SUMO's vehicles also yield to crossing ones, although the controller
#: alone decides which vehicle goes. So a vehicle ignores all others in the junction (32) while one
#: of them shares neither lane nor exit with it, and follows the one ahead by minisim's law.
FOLLOWING, IGNORING = 2, 2 + 32

#: SUMO accepts no desired speed of zero [m/s]; a vehicle that has to stop gets a command.
LEAST_SPEED = 0.01


class Car:
    """A vehicle; `minisim.engine.state.VEHICLE` explains most of the values."""

    __slots__ = (
        "a", "advice", "brake", "cleared", "commanded", "demand_time", "desired", "factor", "go",
        "id", "ignoring", "lane", "lost_ticks", "mark", "name", "path", "present", "rank", "row",
        "s", "section", "seen", "told", "traits", "type", "v",
    )  # fmt: skip

    def __init__(self, row: int, record: Records, types: Sequence[Traits], law: Law) -> None:
        self.row = row
        self.id = int(record["id"])
        self.name = str(self.id)
        self.lane = int(record["lane"])
        self.rank = int(record["rank"])
        self.path = int(record["path"])
        self.type = int(record["type"])
        self.traits = types[self.type]
        self.factor = float(record["factor"])
        self.demand_time = int(record["demand_tick"]) * law.dt
        self.s = self.v = self.a = 0.0
        # Between rare looks it grows by the time that exceeds a drive at the limit.
        self.lost_ticks = 0.0
        self.brake = 0.0  # how hard it must brake [m/s²]; 0 without such a command
        self.section = self.mark = 0
        self.seen = 0  # tick of the last look at it
        self.present = False  # on the road
        self.go = self.cleared = self.commanded = self.ignoring = False
        self.advice = self.told = math.inf
        self.desired = math.inf  # the last value given to SUMO


class Gap(NamedTuple):
    """What a vehicle has ahead."""

    distance: float  #: to its rear [m]
    v: float  #: its speed [m/s]
    b_max: float  #: how hard it can brake [m/s²]


#: Whether a vehicle has the right of way, on its own or through its lane.
Released = Callable[[Car], bool]

#: Where a vehicle is now [m] and its speed [m/s], watched or not.
Located = Callable[[Car], tuple[float, float]]


class Steering(ABC):
    """What the worker needs in order to steer one of SUMO's car-following models."""

    near = -math.inf  #: `s` from which vehicles have to be steered in every step [m]

    def __init__(self, job: Job, law: Law, libsumo: Any, located: Located) -> None:
        self._law, self._vehicle, self._located = law, libsumo.vehicle, located
        self._exit = [(float(end[0]), int(end[2])) for end in job.layout.ends]
        self._branch = job.layout.branch
        self._inside: list[Car] = []  # in the order in which they entered the junction
        self._out: dict[int, Car] = {}  # the last one that left the junction by each arm

    def load(self, cars: Iterable[Car]) -> None:  # noqa: B027  (does nothing by default)
        """Called when SUMO knows the vehicles, before any is on the road."""

    def advise(self, car: Car) -> None:  # noqa: B027  (likewise)
        """Called when the advice for a vehicle on the road has changed."""

    @abstractmethod
    def depart(self, car: Car) -> None:
        """Called when a vehicle has been inserted."""

    @abstractmethod
    def steer(self, lanes: Sequence[Sequence[Car]], released: Released) -> None:
        """Called before a step with each lane's vehicles, front to back, up to the exit."""

    def command(self, car: Car, speed: float) -> None:
        """Drive the car at this speed [m/s], whatever the model says."""
        self._vehicle.setSpeed(car.name, max(speed, 0.0))
        car.commanded = True

    def release(self, car: Car) -> None:
        """Leave the car to the model."""
        if car.commanded:
            self._vehicle.setSpeed(car.name, -1.0)
            car.commanded = False

    def clear(self, car: Car) -> None:
        """Leave the car to the model for good: it has left the junction."""
        self._out[self._exit[car.path][1]] = car
        self.release(car)

    def _enter(self, lanes: Sequence[Sequence[Car]]) -> None:
        """Note which cars are inside the junction."""
        self._inside = [car for car in self._inside if not car.cleared]
        ids = {car.id for car in self._inside}
        entered = (car for lane in lanes for car in lane if car.s >= self._law.entry)
        self._inside += [car for car in entered if car.id not in ids]

    def _leading(self, car: Car, lane: Sequence[Car]) -> Iterator[Gap]:
        """The vehicle of its own lane that this car follows, if any; `lane` is ahead of it."""
        for ahead in reversed(lane):
            rear = ahead.s - ahead.traits.length
            if rear < self._branch[ahead.path, car.path]:
                yield Gap(rear - car.s, ahead.v, ahead.traits.b_max)
                return

    def _merging(self, car: Car) -> Iterator[Gap]:
        """The vehicle from another lane that takes the same exit before this car, if any."""
        arm = self._exit[car.path][1]
        before = takewhile(lambda other: other is not car, self._inside)
        merging = [it for it in before if it.lane != car.lane and self._exit[it.path][1] == arm]
        yield from (self._behind(car, ahead, ahead.s, ahead.v) for ahead in merging[-1:])

    def _leaving(self, car: Car) -> Iterator[Gap]:
        """The vehicle that was the last to leave the junction by the exit of this car, if any."""
        ahead = self._out.get(self._exit[car.path][1])
        if ahead is not None and ahead.present:
            yield self._behind(car, ahead, *self._located(ahead))

    def _behind(self, car: Car, ahead: Car, s: float, v: float) -> Gap:
        """The gap to a vehicle that is at `s`, both measured from their exit."""
        mine, other = self._exit[car.path][0], self._exit[ahead.path][0]
        distance = (s - other) - ahead.traits.length - (car.s - mine)
        return Gap(distance, v, ahead.traits.b_max)


class Follower(Steering):
    """Steers SUMO's IDM or Krauss: limits, markings, turns and hold lines are minisim's."""

    def __init__(self, job: Job, libsumo: Any, located: Located) -> None:
        # SUMO's Krauss may drive vehicles with another law.
        law = job.law if job.model == "IDM" else job.law._replace(model=laws.KRAUSS)
        super().__init__(job, law, libsumo, located)
        self._limits = limits(job)
        apart, exits = job.movements.apart, job.movements.exits
        crossed = apart & (exits[:, None] != exits)  # sharing neither lane nor exit
        self._crossing = [frozenset(np.flatnonzero(row).tolist()) for row in crossed]

    def depart(self, car: Car) -> None:
        """Let the controller alone decide."""
        self._vehicle.setSpeedMode(car.name, FOLLOWING)

    def steer(self, lanes: Sequence[Sequence[Car]], released: Released) -> None:
        """Tell SUMO what the road ahead asks of each vehicle up to the exit in the next step."""
        entry = self._law.entry
        self._enter(lanes)
        inside = {car.path for car in self._inside}
        told = any(car.told < math.inf for lane in lanes for car in lane)
        wary = told or any(car.brake > 0.0 for lane in lanes for car in lane)
        for lane in lanes:
            foremost = True  # on the approach; it also follows vehicles from other lanes
            for k, car in enumerate(lane):
                held = car.s < entry and not released(car)
                crossed = not inside.isdisjoint(self._crossing[car.path])
                alone = crossed or car.told < math.inf  # SUMO does not follow for it
                merges = alone and not held and (car.s >= entry or foremost)
                foremost &= car.s >= entry
                z = self._closeness(car, self._merging(car)) if merges else 0.0
                # While it slows down by command, SUMO does not follow for it either.
                slows = car.brake > 0.0 or max(car.v, LEAST_SPEED) > car.advice
                ahead = [*self._leading(car, lane[:k])] if wary or slows else []
                if told or slows:
                    ahead += self._leaving(car)
                self._steer(car, lane[:k], held, z, ahead)
                ignoring = held or crossed
                if ignoring != car.ignoring:
                    self._vehicle.setSpeedMode(car.name, IGNORING if ignoring else FOLLOWING)
                    car.ignoring = ignoring

    def clear(self, car: Car) -> None:
        """Leave the car to SUMO for good, at the exit's speed limit."""
        limit = self._limits[car.path][1][car.section]
        self._desire(car, min(limit * car.factor, car.advice))
        super().clear(car)

    def _closeness(self, car: Car, ahead: Iterable[Gap]) -> float:
        """The most that the law asks for behind these vehicles; 0 if there are none."""
        me, law = car.traits, self._law
        asked = [float(laws.closeness(car.v, it.distance, it.v, me, law)) for it in ahead]
        return max(asked, default=0.0)

    def _room(self, car: Car, ahead: Iterable[Gap]) -> float:
        """The room in which the car must be able to stop behind these; see `laws.room_behind`."""
        me, law = car.traits, self._law
        rooms = [laws.room_behind(it.distance, it.v, it.b_max, me, law) for it in ahead]
        return float(min(rooms, default=math.inf))

    def _steer(
        self, car: Car, lane: Sequence[Car], held: bool, z: float, ahead: Sequence[Gap]
    ) -> None:
        """Steer a car; it keeps room behind `ahead`, which commands may make brake hard."""
        law, me = self._law, car.traits
        v, s, section = car.v, car.s, car.section
        starts, speeds = self._limits[car.path]
        limit = speeds[section] * car.factor
        v0 = min(limit, car.advice)
        k = section + 1
        slower = laws.braking_begins(v, starts[k] - s, me, law)
        held = held and near(v, law.hold - s, me, law)
        # SUMO would drop to a lower desired speed at once, so the law does the braking.
        self._desire(car, max(v0, v))
        room = self._room(car, ahead)
        tight = laws.short_of(room, v, v + me.a * law.dt, me, law)
        ours = v > v0 or v0 < LEAST_SPEED or car.told < math.inf or tight
        if not (slower or held or car.brake > 0.0 or ours or z > 0.0):
            self.release(car)
            return
        free, acc = self._drive(car, limit, 0.0), self._drive(car, limit, z)
        while laws.braking_begins(v, starts[k] - s, me, law):
            lower = speeds[k] * car.factor
            acc = min(acc, laws.slow_down(v, acc, lower, starts[k] - s, me, law))
            k += 1
        if held:
            acc = min(acc, laws.hold(v, s, me, law))
        if car.brake > 0.0:
            acc = min(acc, -car.brake)
        if acc < free or ours:
            z = max(z, self._closeness(car, ahead or self._leading(car, lane)))
            acc = min(acc, self._drive(car, limit, z))
            if tight:
                acc = min(acc, float(laws.keep_room(v, room, me, law)))
            self.command(car, v + max(acc, -me.b_max) * law.dt)
        else:
            self.release(car)

    def _drive(self, car: Car, limit: float, z: float) -> float:
        """The acceleration by the law, or by what the car is told."""
        if car.told < math.inf:
            limit = min(limit, car.advice)
            return float(laws.obey(car.told, car.v, limit, z, car.traits, self._law))
        return float(laws.drive(car.v, limit, car.advice, z, car.traits, self._law))

    def _desire(self, car: Car, speed: float) -> None:
        speed = max(speed, LEAST_SPEED)
        if speed != car.desired:
            self._vehicle.setMaxSpeed(car.name, speed)
            car.desired = speed


def limits(job: Job) -> list[tuple[list[float], list[float]]]:
    """Each path's sections as lists: their starts [m] and limits [m/s]."""
    starts, speeds = job.layout.section_start.tolist(), job.layout.section_speed.tolist()
    return list(zip(starts, speeds, strict=True))


def near(v: float, distance: float, me: Traits, law: Law) -> bool:
    """Whether a hold line `distance` ahead may matter in this step, with a metre to spare."""
    return laws.braking_begins(v, distance - STOP_MARGIN - 1.0, me, law)
