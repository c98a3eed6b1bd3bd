"""The process that runs libsumo: it moves, the controller's own process decides.

libsumo holds one simulation a process, and what crashes it would take its caller down, so it has
a process of its own. That one knows no controller: it advances until a wake-up, sends a view, and
carries out the commands that come back, as `minisim.simulation` does with the compiled kernel.

SUMO follows leaders, integrates and finds collisions. What a held vehicle, a marking or a turn
asks for is computed by minisim's own kernel functions and told to SUMO as a speed: a desired one
(`setMaxSpeed`) where a lower limit holds, a commanded one (`setSpeed`) while a vehicle has to
brake for what is ahead. SUMO still drives slower than that behind a leader.
"""

from __future__ import annotations

import math
import os
import pickle
import sys
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

from minisim import kernel
from minisim.collision import Collision
from minisim.control import (
    Advise,
    Close,
    Command,
    Go,
    Hold,
    Observed,
    Open,
    Wake,
)
from minisim.geometry import Movement
from minisim.state import NEVER, STOP_MARGIN, TRACE, Law, Records, first_tick
from minisim.sumo.messages import Asked, Ended, Failed, Job, Started

#: SUMO keeps a safe gap (1) and the maximal acceleration (2) but knows no right of way (no 8), and
#: braking (no 4) is limited by minisim. (SUMO, TraCI/Change Vehicle State, speed mode.) In the
#: junction it follows whoever comes from the same lane or leaves by the same. That also makes it
#: yield to whoever crosses, where the controller alone is to say who goes: so it ignores all in
#: the junction (32) as long as somebody drives there who neither shares lane nor exit.
FOLLOWING, IGNORING = 1 + 2, 1 + 2 + 32

#: Lines of a recording that are kept as Python objects.
TRACE_LINES = 100_000

#: SUMO knows no desired speed of zero [m/s]; a vehicle told to stop is commanded to.
LEAST_SPEED = 0.01


class Car:
    """A vehicle; `minisim.state.VEHICLE` explains the values."""

    __slots__ = (
        "a", "advice", "commanded", "desired", "factor", "go", "id", "ignoring", "lane", "mark",
        "name", "path", "row", "s", "section", "v",
    )  # fmt: skip

    def __init__(self, row: int, record: Records) -> None:
        self.row = row
        self.id = int(record["id"])
        self.name = str(self.id)
        self.lane = int(record["lane"])
        self.path = int(record["path"])
        self.factor = float(record["factor"])
        self.s = self.v = self.a = 0.0
        self.section = self.mark = 0
        self.go = False
        self.advice = math.inf
        self.desired = math.inf  # as SUMO was told last
        self.commanded = self.ignoring = False


class Worker:
    """One run in SUMO: `minisim.simulation.Simulation` without the session.

    A tick is the state that SUMO writes at that time: it moves everybody, then inserts whoever
    is due, so a vehicle's first state is that of its insertion.
    """

    def __init__(self, job: Job, libsumo: Any, caller: Caller) -> None:
        self._job, self._libsumo, self._caller = job, libsumo, caller
        road, law = job.road, job.law
        self._limits = [
            (start.tolist(), speed.tolist())
            for start, speed in zip(road.section_start, road.section_speed, strict=True)
        ]
        self._marks = road.marks.tolist()
        self._exit = road.ends[:, 0].tolist()
        self._stretch = [
            (leave - law.entry) / inside
            for leave, inside in zip(self._exit, job.network.inside, strict=True)
        ]
        self._crossing = [_crossing(path, job.movements) for path in range(len(job.movements))]
        self._cars = {
            car.id: car for row, record in enumerate(job.vehicles) for car in [Car(row, record)]
        }
        self._watched: dict[str, Car] = {}
        self._lanes: list[list[Car]] = [[] for _ in range(job.lanes)]
        self._open = [job.plan.lanes_open] * job.lanes
        self._collisions: dict[tuple[int, int], Collision] = {}
        self._lines: list[tuple[int, int, float, float, float, bool]] = []
        self._traces: list[Records] = []
        self._arrived = 0
        self._wake_tick = NEVER
        self._period_tick = 0 if job.plan.period is not None else NEVER
        self._tick = 0

    def run(self) -> Ended:
        """Advance to the horizon, the last arrival, or a collision that ends the run."""
        job = self._job
        self._decide()
        self._libsumo.simulationStep()
        passed = self._observe()
        while self._tick < job.horizon and not self._done and not self._stopped:
            if passed or self._tick >= min(self._wake_tick, self._period_tick):
                self._decide()
            self._steer_all()
            self._libsumo.simulationStep()
            self._tick += 1
            passed = self._observe()
            self._collide()
        return Ended(
            tick=self._tick,
            done=self._done,
            collisions=tuple(self._collisions.values()),
            positions={
                int(name): self._locate(self._cars[int(name)])
                for name in self._libsumo.vehicle.getIDList()
            },
            trace=np.concatenate([*self._traces, np.array(self._lines, TRACE)]),
        )

    @property
    def _done(self) -> bool:
        return self._arrived == len(self._cars)

    @property
    def _stopped(self) -> bool:
        return self._job.stop_on_collision and bool(self._collisions)

    def _decide(self) -> None:
        """Ask what the session commands; all answers are collected before any is carried out."""
        dt, period = self._job.law.dt, self._job.plan.period
        if self._tick >= self._wake_tick:
            self._wake_tick = NEVER
        if period is not None and self._tick >= self._period_tick:
            self._period_tick = self._tick + max(1, first_tick(period, dt))
        for command in self._caller.ask(Asked(self._tick, tuple(self._view()))):
            self._apply(command)

    def _view(self) -> Iterator[Observed]:
        law, movements = self._job.law, self._job.movements
        for lane in self._lanes:
            for car in lane:
                distance = law.entry - car.s
                if distance > law.sight:
                    break
                manoeuvre = movements[car.path].manoeuvre
                yield Observed(car.id, car.lane, manoeuvre, distance, car.v, law.length)

    def _apply(self, command: Command) -> None:
        match command:
            case Go(vehicle) | Hold(vehicle):
                self._cars[vehicle].go = isinstance(command, Go)
            case Open(lane) | Close(lane):
                self._open[lane] = isinstance(command, Open)
            case Advise(vehicle, speed):
                self._cars[vehicle].advice = speed
            case Wake(time):
                self._wake_tick = first_tick(time, self._job.law.dt)

    def _steer_all(self) -> None:
        entry = self._job.law.entry
        inside = {car.path for lane in self._lanes for car in lane if car.s >= entry}
        for lane in self._lanes:
            for car in lane:
                self._steer(car)
                held = car.s < entry and not self._released(car)
                ignoring = held or not inside.isdisjoint(self._crossing[car.path])
                if ignoring != car.ignoring:
                    mode = IGNORING if ignoring else FOLLOWING
                    self._libsumo.vehicle.setSpeedMode(car.name, mode)
                    car.ignoring = ignoring

    def _steer(self, car: Car) -> None:
        """Tell SUMO what the road ahead asks of one vehicle in the next step."""
        law = self._job.law
        v, s, section = car.v, car.s, car.section
        starts, speeds = self._limits[car.path]
        v0 = min(speeds[section] * car.factor, car.advice)
        k = section + 1
        slower = kernel.braking_begins(v, starts[k] - s, law)
        held = s < law.entry and not self._released(car) and near(v, law.hold - s, law)
        # SUMO would drop to a lower desired speed at once; the law brakes.
        self._desire(car, max(v0, v))
        if not (slower or held or v > v0 or v0 < LEAST_SPEED):
            self._hand_back(car)
            return
        free = acc = self._free(v, v0)
        while kernel.braking_begins(v, starts[k] - s, law):
            acc = min(acc, kernel.slow_down(v, acc, speeds[k] * car.factor, starts[k] - s, law))
            k += 1
        if held:
            acc = min(acc, kernel.hold(v, s, law))
        if acc < free or v > v0 or v0 < LEAST_SPEED:
            speed = v + max(acc, -law.b_max) * law.dt
            self._libsumo.vehicle.setSpeed(car.name, max(speed, 0.0))
            car.commanded = True
        else:
            self._hand_back(car)

    def _released(self, car: Car) -> bool:
        return car.go or self._open[car.lane]

    def _free(self, v: float, v0: float) -> float:
        """Acceleration of the model on an empty road."""
        law = self._job.law
        if self._job.model == "IDM":
            return kernel.follow(v, v0, 0.0, law)
        return min(law.a, max((v0 - v) / law.dt, -law.b))

    def _desire(self, car: Car, speed: float) -> None:
        speed = max(speed, LEAST_SPEED)
        if speed != car.desired:
            self._libsumo.vehicle.setMaxSpeed(car.name, speed)
            car.desired = speed

    def _hand_back(self, car: Car) -> None:
        if car.commanded:
            self._libsumo.vehicle.setSpeed(car.name, -1.0)
            car.commanded = False

    def _observe(self) -> bool:
        """Read the new state; whether a front has passed a mark, or a rear left the junction."""
        sumo = self._libsumo
        distance, speed = sumo.VAR_DISTANCE, sumo.VAR_SPEED
        if self._tick < self._job.horizon:
            for name in sumo.simulation.getDepartedIDList():
                self._watch(self._cars[int(name)])
        self._arrived += sumo.simulation.getArrivedNumber()
        passed = False
        for name, values in sumo.vehicle.getAllSubscriptionResults().items():
            car = self._watched[name]
            passed |= self._move(car, values[distance], values[speed])
        return passed

    def _watch(self, car: Car) -> None:
        sumo = self._libsumo
        sumo.vehicle.subscribe(car.name, [sumo.VAR_DISTANCE, sumo.VAR_SPEED])
        sumo.vehicle.setSpeedMode(car.name, FOLLOWING)
        car.v = sumo.vehicle.getSpeed(car.name)
        self._watched[car.name] = car
        self._lanes[car.lane].append(car)

    def _move(self, car: Car, travelled: float, v: float) -> bool:
        law, p = self._job.law, car.path
        s = self._position(p, travelled)
        car.a = (v - car.v) / law.dt
        car.s, car.v = s, v
        self._record(car)
        passed = False
        while s >= self._marks[car.mark]:
            car.mark += 1
            passed = True
        starts = self._limits[p][0]
        while s >= starts[car.section + 1]:
            car.section += 1
        if s - law.length >= self._exit[p] and car in self._lanes[car.lane]:
            self._clear(car)
            passed |= law.wake_on_clear
        return passed

    def _position(self, p: int, travelled: float) -> float:
        """`s` on path p of a vehicle that has driven so far since its insertion [m]."""
        law, network = self._job.law, self._job.network
        inside = travelled + law.length - network.approach[p]
        if inside <= 0.0:
            return float(law.entry + inside)
        if inside <= network.inside[p]:
            return float(law.entry + inside * self._stretch[p])
        return float(self._exit[p] + inside - network.inside[p])

    def _locate(self, car: Car) -> float:
        """`s` of any vehicle on the road [m], watched or not."""
        return self._position(car.path, self._libsumo.vehicle.getDistance(car.name))

    def _clear(self, car: Car) -> None:
        """Its rear has left the junction: nobody but SUMO steers it any more."""
        self._lanes[car.lane].remove(car)
        limit = self._limits[car.path][1][car.section]
        self._desire(car, min(limit * car.factor, car.advice))
        self._hand_back(car)
        if self._job.law.record_from == NEVER:
            self._libsumo.vehicle.unsubscribe(car.name)
            del self._watched[car.name]

    def _record(self, car: Car) -> None:
        law = self._job.law
        past = car.s - law.length - self._exit[car.path]
        if (
            law.record_from <= self._tick < law.record_to
            and car.s >= law.record_start
            and past <= law.record_past
        ):
            released = self._released(car)
            self._lines.append((self._tick, car.row, car.s, car.v, car.a, released))
            if len(self._lines) == TRACE_LINES:  # an array takes a quarter of the memory
                self._traces.append(np.array(self._lines, TRACE))
                self._lines.clear()

    def _collide(self) -> None:
        """Note each pair that SUMO finds touching, once."""
        for found in self._libsumo.simulation.getCollisions():
            i, j = sorted((int(found.collider), int(found.victim)))
            if (i, j) not in self._collisions:
                self._collisions[i, j] = self._describe(self._cars[i], self._cars[j])

    def _describe(self, *cars: Car) -> Collision:
        vehicle, movements = self._libsumo.vehicle, self._job.movements
        first, second = (
            (
                car.id,
                str(movements[car.path]),
                self._locate(car),
                vehicle.getSpeed(car.name),
            )
            for car in cars
        )
        time = round(self._tick * self._job.law.dt, 6)
        return Collision(time, *zip(first, second, strict=True))


def _crossing(path: int, movements: tuple[Movement, ...]) -> frozenset[int]:
    """The paths that share neither lane nor exit with this one."""
    n = max(m.origin for m in movements) + 1

    def exit_of(movement: Movement) -> int:
        return (movement.origin + movement.manoeuvre) % n

    mine = movements[path]
    return frozenset(
        q
        for q, other in enumerate(movements)
        if other.origin != mine.origin and exit_of(other) != exit_of(mine)
    )


def near(v: float, distance: float, law: Law) -> bool:
    """Whether a hold line `distance` ahead may matter in this step; a metre of room is enough."""
    return kernel.braking_begins(v, distance - STOP_MARGIN - 1.0, law)


class Caller:
    """The other side: the process that holds the session."""

    def __init__(self, source: BinaryIO, target: BinaryIO) -> None:
        self._source, self._target = source, target

    def receive(self) -> Any:
        """The next object; `EOFError` when the caller has gone."""
        return pickle.load(self._source)

    def send(self, message: Started | Asked | Ended | Failed) -> None:
        """Send one object."""
        pickle.dump(message, self._target)
        self._target.flush()

    def ask(self, asked: Asked) -> list[Command]:
        """Send a view and return the answer."""
        self.send(asked)
        answer: list[Command] = self.receive()
        return answer


def main() -> None:
    """Receive a job on stdin, run it, and talk on stdout; what SUMO prints goes to stderr."""
    with os.fdopen(os.dup(1), "wb") as target:
        os.dup2(2, 1)
        caller = Caller(sys.stdin.buffer, target)
        job: Job = caller.receive()
        import libsumo

        try:
            os.chdir(job.folder)
            libsumo.start(list(job.command))
            caller.send(Started(libsumo.getVersion()[1]))
            ended = Worker(job, libsumo, caller).run()
            libsumo.close()  # writes the trips
            caller.send(ended)
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            caller.send(Failed(str(error)))
