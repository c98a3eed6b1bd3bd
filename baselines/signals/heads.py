"""What all signals share: heads that prevent collisions, and the order of the greens.

A head turns green only when no vehicle in the junction conflicts with its lane, so safety does not
depend on the length of an amber. If vehicles give way to those crossing (`VehicleType`), it
turns green at once, as the published signals did. At the end of a green, vehicles that can no
longer stop comfortably keep their right of way; all others stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from typing import Any

import numpy as np

from minisim.carfollowing import braking_distance
from minisim.control import (
    COMMIT_MARGIN,
    Close,
    Command,
    Go,
    Observed,
    Open,
    Site,
    View,
    can_stop,
    stopping_distance,
)
from minisim.errors import InputError, choice, integer, items
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES
from minisim.parameters import checked
from minisim.vehicle import CruiseVehicle

#: The fastest driver's factor on the speed limit, where drivers differ (`VehicleType`).
FASTEST_DRIVER = 2.0
#: Room for the last steps before a vehicle comes into view [m].
SIGHT_MARGIN = 5.0


class Colour(Enum):
    """What a signal head can show."""

    RED = "red"
    AMBER = "amber"
    GREEN = "green"


class Heads:
    """The signal heads of a run, and the vehicles that they have let go.

    `colours` is what each lane's head shows now. A head that should be green while a vehicle still
    crosses its lane's way stays red (or amber) until that vehicle is clear.
    """

    def __init__(self, site: Site) -> None:
        self._rows = site.intersection.movements.rows
        allowed = site.intersection.allowed
        ways = [[way for way in row[1:] if allowed[way]] for row in self._rows]
        # Nested lists: a plain lookup is much faster than one in a small array.
        crossed = np.array([site.conflicts[way].any(axis=0) for way in ways])
        self._crossed = crossed.tolist()  # lane, then movement
        self._exclusive = [[bool(row[way].any()) for way in ways] for row in crossed]  # by lanes
        brakes, dt = [it.deceleration for it in site.types], site.dt
        self._stops: Callable[[Observed], bool] = lambda v: can_stop(v, brakes[v.type])
        self._goes = [Colour.GREEN]
        if isinstance(site.vehicle, CruiseVehicle) and site.vehicle.obeys:
            self._goes += [Colour.AMBER]
            self._stops = lambda _: True  # on the spot, see `obeys`
        elif site.looks_out:  # SUMO's own rule (`MSVehicle::planMoveInternal`)
            self._stops = lambda v: braking_distance(v.speed, brakes[v.type], dt) <= v.distance
        self._at_once = site.looks_out
        self._partners: list[tuple[int, ...]] = [()] * len(ways)  # lanes green with each
        self._let_go: set[int] = set()
        self.sight = stopping_sight(site)  #: how far before the junction it must see vehicles [m]
        self.reach = 0.0  #: and how far past the entry, even behind the junction [m]
        self.marks: tuple[float, ...] = ()  #: where it must see them pass [m]
        self.next_look = math.inf  #: when it must see them again, beside its changes [s]
        self.colours = [Colour.RED] * len(ways)

    @property
    def shown(self) -> list[str]:
        """What each lane's head shows now, as a word."""
        return [colour.value for colour in self.colours]

    def show(self, view: View, wanted: Sequence[Colour]) -> list[Command]:
        """Turn the heads to `wanted` as far as that is safe now; return the commands for it.

        One answer closes lanes before it opens others.
        """
        if wanted == self.colours:
            return []
        commands: list[Command] = []
        self._let_go.intersection_update(v.id for v in view.vehicles)
        for lane, colour in enumerate(wanted):
            if colour is not Colour.GREEN:
                if self.colours[lane] in self._goes and colour not in self._goes:
                    commands += self._close(lane, view)
                elif colour in self._goes and self.colours[lane] is Colour.GREEN:
                    commands.append(Open(lane, amber=True))
                self.colours[lane] = colour
        for lane, colour in enumerate(wanted):
            if colour is not self.colours[lane] and self._may_open(lane, view):
                commands += self._open(lane)
                self.colours[lane] = Colour.GREEN
        return commands

    def rests(self, wanted: Sequence[Colour]) -> bool:
        """Whether vehicles matter no more to it until other colours are wanted."""
        return wanted == self.colours

    def _open(self, lane: int) -> list[Command]:
        return [Open(lane)]

    def _close(self, lane: int, view: View) -> list[Command]:
        going = committed([v for v in view.vehicles if v.lane == lane], self._stops)
        self._let_go.update(v.id for v in going)
        return [Close(lane), *(Go(v.id) for v in going)]

    def _may_open(self, lane: int, view: View) -> bool:
        """Whether no vehicle crosses the lane's way, and no head is green for one that might."""
        with_it = self._partners[lane]
        green = [k for k, colour in enumerate(self.colours) if colour is Colour.GREEN]
        if any(self._exclusive[lane][other] for other in green if other not in with_it):
            return False
        others = (v for v in view.vehicles if v.lane not in with_it)
        crossing = (v for v in others if v.distance < 0.0 or v.id in self._let_go)
        crossed = self._crossed[lane]
        return self._at_once or not any(crossed[self._rows[v.lane][v.manoeuvre]] for v in crossing)


def lane_order() -> Any:
    """The field of a signal that says in which order its lanes get their greens."""

    def check(title: str, value: Any) -> tuple[int, ...]:
        lanes = items(title, value, "lanes such as (c,b,a,d)")
        letters = list(ARM_NAMES)
        return tuple(
            letters.index(choice("lane in order", one, letters))
            if isinstance(one, str)
            else integer("lane in order", one, low=0)
            for one in lanes
        )

    return checked(
        "lanes in the order of their greens, by letter or number (a is 0); none means a, b, c…",
        check, "lanes such as (c,b,a,d)", optional=True, default=None,
    )  # fmt: skip


def full_order(order: tuple[int, ...] | None, intersection: Intersection) -> tuple[int, ...]:
    """The order of the lanes that vehicles come on.

    Raises `InputError` unless it lists each of them once.
    """
    lanes = intersection.approaches
    if order is not None and sorted(order) != list(lanes):
        named = ", ".join(f"{ARM_NAMES[lane]} ({lane})" for lane in lanes)
        raise InputError(f"order must be the lanes {named}, each once, got {order}")
    return lanes if order is None else order


def committed(lane: Iterable[Observed], stops: Callable[[Observed], bool]) -> list[Observed]:
    """The vehicles before the junction that keep their right of way when their lane is closed.

    They, or a vehicle behind them, can no longer stop. `lane` is one lane's, front to back.
    """
    approaching = [v for v in lane if v.distance >= 0.0]
    last = max((i for i, v in enumerate(approaching) if not stops(v)), default=-1)
    return approaching[: last + 1]


def stopping_sight(site: Site) -> float:
    """How far a view must reach on the approach lanes so that what is beyond it can stop [m]."""
    fastest = site.speed_limit * (FASTEST_DRIVER if site.vehicle.speed_deviation else 1.0)
    needed = stopping_distance(fastest, site.vehicle.deceleration)
    return min(needed + COMMIT_MARGIN + SIGHT_MARGIN, site.intersection.approach_length)
