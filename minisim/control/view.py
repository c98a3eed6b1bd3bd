"""What a session is shown at a wake-up, and what follows from one vehicle of it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from minisim.junction.movements import Movement

#: A vehicle counts as able to stop only with this distance to spare [m], more than rounding errors.
#: A held vehicle keeps more before its line (`minisim.laws.STOP_MARGIN`), so it always counts as
#: able to stop while it brakes for the junction entry.
COMMIT_MARGIN = 0.1

#: A vehicle no faster than this stands or waits [m/s]: SUMO's `SUMO_const_haltingSpeed`.
HALTING = 0.1

#: A vehicle that stands for want of a right of way has its front at most this far before its hold
#: line [m], one that drives by SUMO's own rules at most `SUMO_AT_LINE`: it stops 1.001 m off.
AT_LINE, SUMO_AT_LINE = 1.0, 1.01


class Observed(NamedTuple):
    """One vehicle in a view.

    Draw random traits of a vehicle by its lane and rank: its id depends on other lanes.
    """

    id: int  # the same in every view of a run
    lane: int  # index of its approach lane
    manoeuvre: int  # 1 … n−1
    distance: float  # from its front bumper to the junction entry [m]; negative inside
    speed: float  # [m/s]
    length: float  # [m]
    demand_time: float = 0.0  # when it wanted to enter the road [s]
    rank: int = 0  # its place among the vehicles of its lane, from 0
    speed_factor: float = 1.0  # its driver's factor on the speed limit
    type: int = 0  # index of its type in `Site.types`; all can see whether it is a bus

    @property
    def movement(self) -> Movement:
        """Origin and manoeuvre."""
        return Movement(self.lane, self.manoeuvre)


def stopping_distance(speed: float, deceleration: float) -> float:
    """Distance to standstill at constant braking, v²/2b [m]."""
    return speed * speed / (2.0 * deceleration)


def can_stop(vehicle: Observed, deceleration: float) -> bool:
    """Whether comfortable braking still stops the vehicle before the junction.

    Only position and speed count, so every observer comes to the same answer.
    """
    speed, distance = vehicle.speed, vehicle.distance
    if speed == 0.0:
        return distance >= 0.0
    return speed * speed / (2.0 * deceleration) + COMMIT_MARGIN <= distance


class Report(NamedTuple):
    """The latest message from a vehicle."""

    time: float  # when it was sent [s]
    holds: bool  # whether the vehicle then had the right of way
    follows: bool = True  # whether it then followed all that it has been told, but for promises


#: If no message fails.
NO_REPORTS: Mapping[int, Report] = MappingProxyType({})


class View(NamedTuple):
    """What the session is shown at a wake-up.

    It has every vehicle from `Plan.sight` before the junction until its rear bumper has left it
    and its front is `Plan.reach` past the entry.

    If messages fail (`minisim.link`), it has what they told: a vehicle is where it was when it sent
    the latest, and stays until one says that it has left.
    """

    time: float  # [s]
    vehicles: tuple[Observed, ...]  # by lane, then front to back
    reports: Mapping[int, Report] = NO_REPORTS  # by vehicle; empty if no message fails
