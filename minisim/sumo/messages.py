"""The messages between the caller's process and the one that runs libsumo."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from contextlib import suppress
from typing import IO, Any, NamedTuple

from minisim.control import Command, Observed, Plan
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
        self.source, self.target = source, target

    def receive(self) -> Any:
        """The next object; `EOFError` if the other process is gone."""
        return pickle.load(self.source)

    def send(self, message: object) -> None:
        """Send an object."""
        pickle.dump(message, self.target)
        self.target.flush()

    def close(self) -> None:
        """Close both pipes, whether or not anyone listens."""
        for pipe in (self.source, self.target):
            with suppress(OSError):
                pipe.close()


class Started(NamedTuple):
    """SUMO is running; this is its version."""

    version: str


class Asked(NamedTuple):
    """A stop, with what a view shows then.

    The answer is a `Proceed`, `None` to end the run here, or a `Fork`, answered by its process id.
    """

    tick: int
    woken: bool  #: whether the session is to be asked
    vehicles: tuple[Observed, ...]
    collisions: tuple[Collision, ...]  #: since the last stop


class Proceed(NamedTuple):
    """Carry out these commands and go on to the next wake-up or collision, or to this tick."""

    commands: Sequence[Command]
    until: int


class Fork(NamedTuple):
    """Become two processes; the new one talks through pipes in its own folder."""

    folder: str


class Ended(NamedTuple):
    """The run is over."""

    tick: int  #: the last one reached
    done: bool  #: whether all vehicles have arrived
    vehicles: tuple[Observed, ...]  #: in the last view
    collisions: tuple[Collision, ...]  #: each pair of vehicles once
    time_loss: dict[int, float]  #: of every vehicle by id [s]
    trace: Records  #: what was recorded


class Failed(NamedTuple):
    """SUMO refused; the reason is in its own words."""

    reason: str
