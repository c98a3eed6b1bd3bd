"""What vehicles and a controller say to each other."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from minisim.control import Observed


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
    acceleration: float = inf  # [m/s²]


class Confirmed(NamedTuple):
    """A message to a vehicle: the controller knows that it has left."""

    vehicle: int
