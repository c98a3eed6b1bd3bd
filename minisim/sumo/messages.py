"""The messages between the caller's process and the one that runs libsumo."""

from __future__ import annotations

import pickle
from typing import IO, Any, NamedTuple

from minisim.control import Observed, Plan
from minisim.engine.collision import Collision
from minisim.engine.cruise.law import Cruise
from minisim.engine.state import Layout, Records
from minisim.junction.movements import Movements
from minisim.laws import Law
from minisim.sumo.network import Network


class Job(NamedTuple):
    """All that the process needs."""

    command: tuple[str, ...]  #: starts SUMO
    folder: str  #: where to run it
    temporary: bool  #: whether the process removes the folder if its caller is gone
    model: str  #: car-following model, one of `minisim.sumo.MODELS`
    plan: Plan  #: the session's
    layout: Layout
    law: Law
    cruise: Cruise | None  #: see `minisim.engine.cruise.law.build_cruise`
    top_speed: float  #: no vehicle exceeds it [m/s]
    network: Network
    vehicles: Records  #: see `minisim.engine.state.build_vehicles`
    movements: Movements
    horizon: int  #: tick at which to stop
    stop_on_collision: bool  #: whether the first collision ends the run
    teleport: bool  #: whether SUMO takes vehicles off the road, as it does by default


class Channel:
    """The pipes to the other process."""

    def __init__(self, source: IO[bytes], target: IO[bytes]) -> None:
        self._source, self._target = source, target

    def receive(self) -> Any:
        """The next object; `EOFError` if the other process is gone."""
        return pickle.load(self._source)

    def send(self, message: object) -> None:
        """Send an object."""
        pickle.dump(message, self._target)
        self._target.flush()


class Started(NamedTuple):
    """SUMO is running; this is its version."""

    version: str


class Asked(NamedTuple):
    """A wake-up, with what to show the session. The answer is a list of commands."""

    tick: int
    vehicles: tuple[Observed, ...]


class Ended(NamedTuple):
    """The run is over."""

    tick: int  #: the last one reached
    done: bool  #: whether all vehicles have arrived
    collisions: tuple[Collision, ...]  #: each pair of vehicles once
    time_loss: dict[int, float]  #: of every vehicle by id [s]
    trace: Records  #: what was recorded


class Failed(NamedTuple):
    """SUMO refused; the reason is in its own words."""

    reason: str
