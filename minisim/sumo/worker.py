"""The process that runs libsumo. It moves the vehicles; the caller's process decides.

libsumo holds one simulation per process, and a crash would take its caller down. So it has a
process of its own, without controllers. That process advances until a wake-up, sends a view
and carries out the commands that come back, as `minisim.simulation` does with the compiled kernel.
SUMO follows, integrates and finds collisions; `minisim.sumo.steering` tells it what else to obey.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np

from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Close,
    Command,
    Go,
    Hold,
    Observed,
    Open,
    Wake,
)
from minisim.engine.collision import Collision
from minisim.engine.state import TRACE, Records
from minisim.hosting import Alarm
from minisim.laws import Traits
from minisim.sumo.cruising import Cruiser
from minisim.sumo.forks import forked
from minisim.sumo.messages import Asked, Channel, Ended, Failed, Fork, Job, Started
from minisim.sumo.steering import Car, Follower, Steering, limits
from minisim.ticks import NEVER, time_of

#: Lines of a recording that are held as Python objects before they become an array.
TRACE_LINES = 100_000

#: Longest time between two looks at a vehicle that no controller needs to know about [s].
GLANCE = 1.0


class Worker:
    """One run in SUMO: `minisim.simulation.Simulation` without the session.

    SUMO first moves all vehicles and then inserts those that are due, so a vehicle's first state is
    the one at its insertion. Vehicles that a controller or a recording may need are watched in
    every step; the others are read now and then.
    """

    def __init__(self, job: Job, libsumo: Any, caller: Channel) -> None:
        self.job, self._libsumo, self._caller = job, libsumo, caller
        layout, law = job.layout, job.law
        self._steering: Steering = (
            Follower(job, libsumo, self._located)
            if job.cruise is None
            else Cruiser(job, libsumo, self._located, job.cruise)
        )
        self._limits = limits(job)
        self._marks = layout.marks.tolist()
        self._exit, self._end, _, self._start = layout.ends.T.tolist()
        self._stretch = [
            (leave - law.entry) / inside
            for leave, inside in zip(self._exit, job.network.inside, strict=True)
        ]
        types = [Traits(*map(float, it)) for it in layout.types]
        cars = (Car(row, record, types, law) for row, record in enumerate(job.vehicles))
        self._cars = {car.name: car for car in cars}
        recorded_from = law.record_start if law.record_from != NEVER else math.inf
        needed_from = self._steering.near, law.entry - law.sight, self._marks[0], recorded_from
        # A metre earlier, so that the acceleration is already known when it is first needed.
        self._near = min(needed_from) - 1.0
        self._watching = False  # all vehicles, always
        self._glances: dict[int, list[Car]] = defaultdict(list)
        self._lanes: list[list[Car]] = [[] for _ in range(job.movements.n)]
        self._open = [job.plan.lanes_open] * job.movements.n
        self._collisions: dict[tuple[int, int], Collision] = {}
        self._lines: list[tuple[int, int, float, float, float, bool]] = []
        self._traces: list[Records] = []
        self._alarm = Alarm(job.plan.period, law.dt)
        self._tick = self._arrived = self._told = 0
        self._pause = 0  # the tick at which the caller wants to be asked

    def run(self) -> Ended:
        """Advance to the horizon, the last arrival, a collision that ends the run, or until told.

        A step begins at the state of the last view, so what is commanded then acts in it.
        """
        job = self.job
        self._steering.load(self._cars.values())
        goes_on = self._ask(woken=True)
        self._libsumo.simulationStep()
        passed = self._observe()
        while goes_on and self._tick < job.horizon and not self._done:
            if job.stop_on_collision and self._collisions:
                break
            woken = (passed and self._tick >= self._alarm.heeds) or self._tick >= self._alarm.tick
            if woken or self._tick >= self._pause or len(self._collisions) > self._told:
                goes_on = self._ask(woken)
                if not goes_on:
                    break
            self._steering.steer(self._lanes, self._released)
            self._libsumo.simulationStep()
            self._tick += 1
            passed = self._observe()
            self._collide()
        vehicles = tuple(self._view())
        for name in self._libsumo.vehicle.getIDList():
            self._glance(self._cars[name])
        return Ended(
            tick=self._tick,
            done=self._done,
            vehicles=vehicles,
            collisions=tuple(self._collisions.values()),
            time_loss={car.id: car.lost_ticks * job.law.dt for car in self._cars.values()},
            trace=np.concatenate([*self._traces, np.array(self._lines, TRACE)]),
        )

    @property
    def _done(self) -> bool:
        return self._arrived == len(self._cars)

    def _ask(self, woken: bool) -> bool:
        """Show a view, and carry out the commands that come back; returns whether to go on."""
        if woken:
            self._alarm.reset(self._tick)
        news = tuple(self._collisions.values())[self._told :]
        self._told = len(self._collisions)
        self._caller.send(Asked(self._tick, woken, tuple(self._view()), news))
        while isinstance(answer := self._caller.receive(), Fork):
            self.job = forked(self.job, self._caller, answer)
        if answer is None:
            return False
        commands, self._pause = answer
        for command in commands:
            self._apply(command)
        return True

    def _view(self) -> Iterator[Observed]:
        law, movements = self.job.law, self.job.movements
        for lane in self._lanes:
            for car in lane:
                distance = law.entry - car.s
                if distance > law.sight:
                    break
                manoeuvre = movements[car.path].manoeuvre
                yield Observed(
                    car.id, car.lane, manoeuvre, distance, car.v, car.traits.length,
                    car.demand_time, car.rank, car.factor, car.type,
                )  # fmt: skip

    def _apply(self, command: Command) -> None:
        match command:
            case Go(vehicle) | Hold(vehicle):
                self._cars[str(vehicle)].go = isinstance(command, Go)
            case Open(lane) | Close(lane):
                self._open[lane] = isinstance(command, Open)
            case Advise(vehicle, speed):
                car = self._cars[str(vehicle)]
                car.advice = speed
                if car.present:
                    self._steering.advise(car)
            case Accelerate(vehicle, acceleration):
                self._watch()
                self._cars[str(vehicle)].told = acceleration
            case Brake(vehicle, deceleration):
                car = self._cars[str(vehicle)]
                if car.s < self._near:
                    self._watch()
                car.brake = min(deceleration, car.traits.b_max)
            case Wake():
                self._alarm.set(command)

    def _watch(self) -> None:
        """Watch all vehicles from now on: a command drives one that may be anywhere."""
        if not self._watching:
            self._watching, self._near = True, -math.inf
            self._glances.clear()
            for car in [car for car in self._cars.values() if car.present]:
                self._glance(car)
                self._turn_to(car)

    def _released(self, car: Car) -> bool:
        return car.go or self._open[car.lane]

    def _observe(self) -> bool:
        """Read the new state; returns whether to wake the session."""
        sumo = self._libsumo
        if self._tick < self.job.horizon:
            for name in sumo.simulation.getDepartedIDList():
                self._depart(self._cars[name])
        passed = False
        for name in sumo.simulation.getArrivedIDList():
            passed |= self._arrive(self._cars[name])
        for car in self._glances.pop(self._tick, ()):
            if car.present:
                self._glance(car)
                self._turn_to(car)
        for name, values in sumo.vehicle.getAllSubscriptionResults().items():
            travelled = values[sumo.VAR_DISTANCE]
            if travelled >= 0.0:  # not while SUMO teleports it
                passed |= self._move(self._cars[name], travelled, values[sumo.VAR_SPEED])
        return passed and not (self.job.law.wake_when_empty and self._occupied())

    def _occupied(self) -> bool:
        return any(car.s > self.job.law.entry for lane in self._lanes for car in lane)

    def _depart(self, car: Car) -> None:
        law = self.job.law
        car.present, car.seen = True, self._tick
        car.s = self._start[car.path] + car.traits.length + law.margin
        car.v = self._libsumo.vehicle.getSpeed(car.name)
        if car.v > law.depart_speed:  # SUMO was told "max", since it never lowers a given speed
            car.v = law.depart_speed
            self._libsumo.vehicle.setPreviousSpeed(car.name, car.v)
        self._lanes[car.lane].append(car)
        self._steering.depart(car)
        self._turn_to(car)

    def _arrive(self, car: Car) -> bool:
        """Note an arrival; returns whether SUMO removed the car before it had left the junction."""
        self._arrived += 1
        self._travel(car, self._end[car.path])
        car.present = False
        if car.cleared:
            return False
        self._lanes[car.lane].remove(car)
        return True

    def _turn_to(self, car: Car) -> None:
        """Watch a vehicle from now on, or arrange the next glance at it."""
        sumo, law = self._libsumo, self.job.law
        ahead = self._near - car.s
        if ahead <= 0.0 and not self._unneeded(car):
            sumo.vehicle.subscribe(car.name, [sumo.VAR_DISTANCE, sumo.VAR_SPEED])
            return
        seconds = min(GLANCE, ahead / self.job.top_speed) if ahead > 0.0 else GLANCE
        self._glances[self._tick + max(1, int(seconds / law.dt))].append(car)

    def _unneeded(self, car: Car) -> bool:
        """Whether the car has passed every place where it may be needed."""
        return car.cleared and not self._watching and self.job.law.record_from == NEVER

    def _glance(self, car: Car) -> None:
        s = self._locate(car)
        if s is not None:
            self._travel(car, s)
            car.v = self._libsumo.vehicle.getSpeed(car.name)

    def _travel(self, car: Car, s: float) -> None:
        """Add the time lost since the last look, and move on to `s`."""
        limit = self._limits[car.path][1][car.section] * car.factor
        due = (s - car.s) / (limit * self.job.law.dt)
        car.lost_ticks += max(self._tick - car.seen - due, 0.0)
        car.s, car.seen = s, self._tick

    def _move(self, car: Car, travelled: float, v: float) -> bool:
        law, p = self.job.law, car.path
        s = self._position(car, travelled)
        car.a, car.s, car.v = (v - car.v) / law.dt, s, v
        self._record(car)
        passed = False
        while s >= self._marks[car.mark]:
            car.mark += 1
            passed = True
        starts, speeds = self._limits[p]
        while s >= starts[car.section + 1]:
            car.section += 1
        if self._tick > car.seen:
            car.lost_ticks += max(1.0 - v / (speeds[car.section] * car.factor), 0.0)
            car.seen = self._tick
        if not car.cleared and s >= max(self._exit[p] + car.traits.length, law.leave):
            self._clear(car)
            passed |= law.wake_on_clear
        return passed

    def _position(self, car: Car, travelled: float) -> float:
        """`s` of a vehicle that has driven `travelled` since its insertion [m]."""
        law, network, p = self.job.law, self.job.network, car.path
        inside = travelled + car.traits.length + law.margin - network.approach[p]
        if inside <= 0.0:
            return float(law.entry + inside)
        if inside <= network.inside[p]:
            return float(law.entry + inside * self._stretch[p])
        return float(self._exit[p] + inside - network.inside[p])

    def _locate(self, car: Car) -> float | None:
        """`s` of any vehicle on the road [m], watched or not; None while SUMO teleports it."""
        travelled = self._libsumo.vehicle.getDistance(car.name)
        return self._position(car, travelled) if travelled >= 0.0 else None

    def _located(self, car: Car) -> tuple[float, float]:
        """Where a vehicle on the road is now [m], and its speed [m/s], watched or not."""
        if car.seen == self._tick:
            return car.s, car.v
        s = self._locate(car)
        return (car.s if s is None else s), self._libsumo.vehicle.getSpeed(car.name)

    def _clear(self, car: Car) -> None:
        """Leave a car to SUMO alone: its rear has left the junction."""
        car.cleared = True
        self._lanes[car.lane].remove(car)
        self._steering.clear(car)
        if self._unneeded(car):
            self._libsumo.vehicle.unsubscribe(car.name)
            self._turn_to(car)

    def _record(self, car: Car) -> None:
        law = self.job.law
        past = car.s - car.traits.length - self._exit[car.path]
        here = car.s >= law.record_start and past <= law.record_past
        if here and law.record_from <= self._tick < law.record_to:
            released = self._released(car)
            self._lines.append((self._tick, car.row, car.s, car.v, car.a, released))
            if len(self._lines) == TRACE_LINES:  # an array takes a quarter of the memory
                self._traces.append(np.array(self._lines, TRACE))
                self._lines.clear()

    def _collide(self) -> None:
        """Note each pair that SUMO finds touching, once."""
        for collision in self._libsumo.simulation.getCollisions():
            first, second = sorted((int(collision.collider), int(collision.victim)))
            if (first, second) not in self._collisions:
                self._collisions[first, second] = self._describe(collision)

    def _describe(self, collision: Any) -> Collision:
        names = self.job.movements.names
        both = []
        for name, speed in (
            (collision.collider, collision.colliderSpeed),
            (collision.victim, collision.victimSpeed),
        ):
            car = self._cars[name]
            both.append((car.id, names[car.path], self._touched(car, collision), float(speed)))
        time = time_of(self._tick, self.job.law.dt)
        return Collision(time, *zip(*sorted(both), strict=True))

    def _touched(self, car: Car, collision: Any) -> float:
        """`s` of a vehicle in a collision [m]; one that has been removed was near the end."""
        s = self._locate(car) if car.present else None
        return self._exit[car.path] + float(collision.pos) if s is None else s


def main() -> None:
    """Receive a job on stdin, run it, and answer on stdout; what SUMO prints goes to stderr."""
    with os.fdopen(os.dup(1), "wb") as target:
        os.dup2(2, 1)
        caller = Channel(sys.stdin.buffer, target)
        job: Job = caller.receive()
        import libsumo

        worker = Worker(job, libsumo, caller)
        try:
            os.chdir(job.folder)
            libsumo.start(list(job.command))
            caller.send(Started(libsumo.getVersion()[1]))
            ended = worker.run()
            libsumo.close()  # writes the trips
            caller.send(ended)
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            caller.send(Failed(str(error)))
        except (EOFError, BrokenPipeError):
            if worker.job.temporary:  # the caller was killed and cannot remove it
                shutil.rmtree(worker.job.folder, ignore_errors=True)
