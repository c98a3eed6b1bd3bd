"""The messages between the caller's process and the one that runs libsumo."""

from __future__ import annotations

import pickle
from typing import IO, Any, NamedTuple

from minisim.control import Observed, Plan
from minisim.engine.collision import Collision
from minisim.engine.cruise.law import Cruise
from minisim.engine.state import Law, Records, Road
from minisim.junction.movements import Movements
from minisim.sumo.network import Network


class Job(NamedTuple):
    """All that the process needs.

    Attributes:
        command, folder: the command that starts SUMO, and the folder to run it in.
        temporary: whether the process removes the folder if its caller is gone.
        model: car-following model, one of `minisim.sumo.MODELS`.
        plan: the session's plan.
        road, law: the run's road and law, with its limits, marks and lines.
        cruise: as returned by `minisim.engine.cruise.law.build_cruise`.
        top_speed: speed that no vehicle exceeds [m/s].
        network: the lanes' lengths in SUMO.
        vehicles: as returned by `minisim.engine.state.build_vehicles`.
        horizon: tick at which to stop.
        stop_on_collision: whether the first collision ends the run.
        teleport: whether SUMO takes vehicles off the road, as it does by default.
    """

    command: tuple[str, ...]
    folder: str
    temporary: bool
    model: str
    plan: Plan
    road: Road
    law: Law
    cruise: Cruise | None
    top_speed: float
    network: Network
    vehicles: Records
    lanes: int
    movements: Movements
    horizon: int
    stop_on_collision: bool
    teleport: bool


class Channel:
    """The pipes to the other process."""

    def __init__(self, source: IO[bytes], target: IO[bytes]) -> None:
        self._source, self._target = source, target

    def receive(self) -> Any:
        """The next object; raises `EOFError` if the other process is gone."""
        return pickle.load(self._source)

    def send(self, message: object) -> None:
        """Send one object."""
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
    """The run is over.

    Attributes:
        tick: last tick reached.
        done: whether all vehicles have arrived.
        collisions: each pair of vehicles once.
        time_loss: time loss of every vehicle [s], by id.
        trace: what was recorded.
    """

    tick: int
    done: bool
    collisions: tuple[Collision, ...]
    time_loss: dict[int, float]
    trace: Records


class Failed(NamedTuple):
    """SUMO refused; the reason is in its own words."""

    reason: str
