"""What a session may command; a host carries it out in its next step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from minisim.control.site import Site
from minisim.control.view import Observed
from minisim.errors import InputError, integer, number, show
from minisim.ticks import first_tick, time_of


@dataclass(frozen=True, slots=True)
class Go:
    """Give one vehicle the right of way: its hold line no longer holds it."""

    vehicle: int


@dataclass(frozen=True, slots=True)
class Reserve(Go):
    """Give one vehicle the right of way from `time` on, as long as it keeps to a passage.

    For sessions whose messages fail (`minisim.link`); a host by itself takes it for a `Go`. It is
    void if it arrives later than `time`, and no `Hold` takes it back. Advice does not count from
    `time` on. The vehicle gives the passage up by itself, and keeps to its last advice again, once
    `keeps(vehicle, time)` is false, if it can still stop.
    """

    time: float  # [s]
    keeps: Callable[[Observed, float], bool]


@dataclass(frozen=True, slots=True)
class Hold:
    """Take away one vehicle's right of way: it stops at its hold line.

    If it is too late for comfortable braking, the vehicle stops before the junction if its brakes
    can; inside the junction, a hold has no effect.
    """

    vehicle: int


@dataclass(frozen=True, slots=True)
class Open:
    """Give a whole lane the right of way (a green signal).

    `amber` says that it is about to end. Only a `CruiseVehicle` that `obeys` heeds it.
    """

    lane: int
    amber: bool = False


@dataclass(frozen=True, slots=True)
class Close:
    """Take a lane's right of way back; vehicles with a `Go` of their own keep theirs."""

    lane: int


@dataclass(frozen=True, slots=True)
class Advise:
    """Cap one vehicle's speed at `speed` [m/s] until advised again; infinity lifts the cap."""

    vehicle: int
    speed: float


@dataclass(frozen=True, slots=True)
class Brake:
    """Make one vehicle brake at `deceleration` [m/s²] or harder until told otherwise; 0 lifts this.

    It acts everywhere, even inside the junction, within what the brakes can do. A standing vehicle
    stays put. It ends when the vehicle leaves the view for good: no session could lift it then.
    """

    vehicle: int
    deceleration: float


@dataclass(frozen=True, slots=True)
class Accelerate:
    """Set one vehicle's acceleration [m/s²] until told otherwise; infinity leaves it to its law.

    It takes the place of what the vehicle would do on a free road. What bounds any vehicle bounds
    this one: its engine and brakes, what its law asks for behind others, limits, advice, its hold
    line, `Brake`. A vehicle that is at its limit keeps it. It ends like `Brake`.
    """

    vehicle: int
    acceleration: float


@dataclass(frozen=True, slots=True)
class Wake:
    """Wake the session at `time` [s] (once; a later `Wake` replaces an earlier one).

    Until `undisturbed` [s], vehicles that pass marks or leave need not wake it.
    """

    time: float
    undisturbed: float = -math.inf


Command = Go | Hold | Open | Close | Advise | Brake | Accelerate | Wake

#: Commands by what they address. Building a union of types at each check would be slow.
TO_VEHICLES, TO_LANES = (Go, Hold, Advise, Brake, Accelerate), (Open, Close)


def check_command(command: Command, tick: int, site: Site, vehicles: int | None = None) -> None:
    """Raise `InputError` for what is not a command, or one that cannot be carried out at `tick`."""
    if isinstance(command, TO_VEHICLES):
        integer("vehicle", command.vehicle, low=0, high=vehicles and vehicles - 1)
        if isinstance(command, Advise) and command.speed != math.inf:
            number("advised speed [m/s]", command.speed, low=0)
        if isinstance(command, Brake):
            number("deceleration to brake at [m/s²]", command.deceleration, low=0)
        if isinstance(command, Accelerate) and command.acceleration != math.inf:
            number("acceleration [m/s²]", command.acceleration)
    elif isinstance(command, TO_LANES):
        integer("lane", command.lane, low=0, high=site.intersection.n - 1)
    elif isinstance(command, Wake):
        if first_tick(number("wake-up time [s]", command.time), site.dt) <= tick:
            now = time_of(tick, site.dt)
            raise InputError(f"wake-up time {command.time:g} s is not after {now:g} s")
        if command.undisturbed != -math.inf:
            number("time until which it is undisturbed [s]", command.undisturbed, high=command.time)
    else:
        raise InputError(f"{show(command)} is not a command")
