"""What the caller's process and the one that runs libsumo tell each other."""

from __future__ import annotations

from typing import NamedTuple

from minisim.collision import Collision
from minisim.control import Observed, Plan
from minisim.geometry import Movement
from minisim.state import Law, Records, Road
from minisim.sumo.network import Network


class Job(NamedTuple):
    """All that the process needs.

    Attributes:
        command: that starts SUMO.
        folder: to start it in.
        model: car-following model, "IDM" or "Krauss".
        plan: of the session.
        road, law: of the run, with its limits, marks and lines.
        network: lengths in SUMO.
        vehicles: as `minisim.state.build_vehicles` has them.
        lanes: how many.
        names: of the movements.
        horizon: tick at which to stop.
        stop_on_collision: whether the first collision ends the run.
    """

    command: tuple[str, ...]
    folder: str
    model: str
    plan: Plan
    road: Road
    law: Law
    network: Network
    vehicles: Records
    lanes: int
    movements: tuple[Movement, ...]
    horizon: int
    stop_on_collision: bool


class Started(NamedTuple):
    """SUMO runs; `version` is its own."""

    version: str


class Asked(NamedTuple):
    """A wake-up: what the session is to be shown. The answer is a list of commands."""

    tick: int
    vehicles: tuple[Observed, ...]


class Ended(NamedTuple):
    """The run is over.

    Attributes:
        tick: reached.
        done: whether everybody has arrived.
        collisions: each pair of vehicles once.
        positions: `s` of the vehicles still on the road [m], by id.
        trace: what was recorded.
    """

    tick: int
    done: bool
    collisions: tuple[Collision, ...]
    positions: dict[int, float]
    trace: Records


class Failed(NamedTuple):
    """SUMO refused, with its own words."""

    reason: str
