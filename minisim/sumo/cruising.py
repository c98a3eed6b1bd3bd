"""SUMO's `CC`, the model of `minisim.vehicle.CruiseVehicle`: its vehicle type, and its steering.

Such a vehicle obeys no speed limit or marking, only the advised speed. It gets a command for a hold
line only while the line asks for more braking than the model does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from minisim.carfollowing import cruise_control
from minisim.engine.cruise.law import FASTEST, Cruise, follow, obey, realise
from minisim.errors import InputError
from minisim.laws import STOP_MARGIN, hold
from minisim.sumo.messages import Job
from minisim.sumo.steering import Car, Gap, Located, Released, Steering, near
from minisim.vehicle import CruiseVehicle

#: Spacing and radar range, fixed in SUMO's code (`MSCFModel_CC`) [m].
FIXED = (2.0, 250.0)

#: The published runs' speed mode: the model alone. If SUMO kept a safe gap (1), it would limit
#: the engine to what its controller asks for, and the lag would vanish.
CRUISING = 0

#: SUMO's number for the controller with both cruise control and ACC (`Plexe::ACC`).
ACC = 1


def attributes(vehicle: CruiseVehicle) -> dict[str, object]:
    """What only CC's `vType` has; raises `InputError` if SUMO fixes another value."""
    if (vehicle.spacing, vehicle.radar) != FIXED:
        spacing, radar = FIXED
        raise InputError(
            f"SUMO's model CC has spacing {spacing:g} m and radar {radar:g} m, but the vehicles "
            f"have {vehicle.spacing:g} m and {vehicle.radar:g} m"
        )
    if vehicle.obeys:
        raise InputError("hosted in SUMO, a CruiseVehicle cannot obey limits and lights by itself")
    return {
        "accel": vehicle.engine_acceleration, "decel": vehicle.max_deceleration,
        "ccAccel": vehicle.cruise_acceleration, "ccDecel": vehicle.cruise_deceleration,
        "kp": vehicle.cruise_gain, "lambda": vehicle.spacing_gain, "tauEngine": vehicle.lag,
        "lanesCount": 1,
    }  # fmt: skip


class Cruiser(Steering):
    """Steers SUMO's `CC` as a cruise control with ACC, through its desired speed."""

    def __init__(self, job: Job, libsumo: Any, located: Located, cruise: Cruise) -> None:
        super().__init__(job, job.law, libsumo, located)
        self._cruise, law = cruise, job.law
        self._limit = job.layout.section_speed[:, 0]
        top = max(cruise.cruise_speed, job.layout.section_speed.max())
        b = cruise.type.b
        self.near = law.hold - STOP_MARGIN - 1.0 - (top + 4.0 * b * law.dt) ** 2 / (2.0 * b)

    def load(self, cars: Iterable[Car]) -> None:
        """Switch the controller on: SUMO inserts vehicles by the active controller's rule."""
        for car in cars:
            self._vehicle.setSpeedMode(car.name, CRUISING)
            self._set(car, "ccaht", self._cruise.headway)
            self._set(car, "ccac", ACC)
            self.advise(car)

    def depart(self, car: Car) -> None:
        """Set the desired speed again: advice may have come before the vehicle did."""
        self.advise(car)

    def advise(self, car: Car) -> None:
        """Set the desired speed in SUMO."""
        speed = self._desired(car)
        if speed != car.desired:
            self._set(car, "ccds", speed)
            car.desired = speed

    def steer(self, lanes: Sequence[Sequence[Car]], released: Released) -> None:
        """Brake for hold lines and on command, if the model itself brakes less."""
        law = self._law
        if any(car.told < math.inf for lane in lanes for car in lane):
            self._enter(lanes)
        for lane in lanes:
            for k, car in enumerate(lane):
                acc = -car.brake if car.brake > 0.0 else math.inf
                held = car.s < law.entry and not released(car)
                if held and near(car.v, law.hold - car.s, car.traits, law):
                    acc = min(acc, max(hold(car.v, car.s, car.traits, law), -car.traits.b_max))
                told = car.told < math.inf
                own = self._own(car, lane[:k]) if told or acc < math.inf else -math.inf
                if told or acc < own:
                    self.command(car, car.v + min(acc, own) * law.dt)
                else:
                    self.release(car)

    def _own(self, car: Car, lane: Sequence[Car]) -> float:
        """The acceleration of the model on the approach, or of a car that is told one [m/s²].

        `lane` is ahead of it in its own lane.
        """
        law, cruise = self._law, self._cruise
        v0 = self._desired(car)
        u = cruise_control(car.v, v0, cruise.cruise_gain, cruise.a, cruise.b)
        if car.told < math.inf:
            u = obey(car.told, car.v, car.advice, law, cruise)
            gaps = [*self._leading(car, lane), *self._merging(car), *self._leaving(car)]
        else:
            last = lane[-1:]
            gaps = [Gap(it.s - it.traits.length - car.s, it.v, it.traits.b_max) for it in last]
            if car.brake > 0.0:
                gaps += self._leaving(car)
        for it in gaps:
            u = min(u, follow(car.v, it.distance - car.traits.min_gap, it.v, law, cruise))
        u = min(u, (FASTEST * v0 / self._limit[car.path] - car.v) / law.dt)
        return realise(car.v, car.a, u, law, cruise)

    def _desired(self, car: Car) -> float:
        return self._cruise.cruise_speed if car.advice == math.inf else car.advice

    def _set(self, car: Car, key: str, value: float) -> None:
        self._vehicle.setParameter(car.name, f"carFollowModel.{key}", repr(value))
