"""The vehicles for which a controller keeps its promise."""

from __future__ import annotations

from dataclasses import dataclass

from minisim.errors import InputError
from minisim.vehicle import MODELS, VehicleType


@dataclass(frozen=True)
class Cover:
    """The vehicles for which a controller promises that none collides and each is served."""

    laws: tuple[str, ...] = tuple(name for name in MODELS if name != "cc")  # of car following
    alike: bool = False  # whether their drivers must be alike: a `speed_deviation` of 0

    def __contains__(self, vehicle: VehicleType) -> bool:
        return vehicle.model in self.laws and not (self.alike and vehicle.speed_deviation > 0.0)

    def __str__(self) -> str:
        laws = f"vehicles of the models {', '.join(self.laws)}" if self.laws else "no vehicles"
        return laws + (" whose drivers are alike (speed_deviation 0)" if self.alike else "")

    def check(self, name: str, vehicle: VehicleType) -> None:
        """Raise `InputError` for a vehicle that the controller `name` does not cover."""
        if vehicle not in self:
            given = f"{vehicle.model!r} with a speed_deviation of {vehicle.speed_deviation:g}"
            raise InputError(f"{name} is for {self}, got model {given}")


#: What a controller covers by default, and what one that may collide covers.
ORDINARY, NOTHING = Cover(), Cover(laws=())


def cover_of(controller: object) -> Cover:
    """What a controller, or its class, covers: its attribute `covers`, if it has one."""
    covers: Cover = getattr(controller, "covers", ORDINARY)
    return covers
