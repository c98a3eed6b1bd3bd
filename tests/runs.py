"""Helpers for tests that look into whole runs."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import signal
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from minisim.arrivals import Arrivals
from minisim.control import Command, Plan, Session, Site, Unregulated, View
from minisim.run import Run
from minisim.testing import SmallScenario
from scenarios import Scenario
from scenarios.scenario import AS_RUN


def replayed(scenario: Scenario, *trips: tuple[float, int, int], horizon: float) -> Scenario:
    """The scenario with exactly these (demand time, lane, manoeuvre) and this horizon [s]."""
    time, lane, manoeuvre = (list(column) for column in zip(*trips, strict=True))
    recorded = Arrivals(np.array(time, float), np.array(lane, int), np.array(manoeuvre, int))
    return dataclasses.replace(scenario, recorded=recorded, horizon=horizon)


def drained(scenario: Scenario, seed: int, horizon: float) -> Scenario:
    """The scenario's own arrivals of one seed, with time until `horizon` to serve them all."""
    arrivals = scenario.arrivals(seed)
    return dataclasses.replace(scenario, recorded=arrivals, horizon=horizon)


def digest(run: Run) -> str:
    """A hash of every byte of a run's trips and recording."""
    state = hashlib.sha256()
    for column in run.columns:
        state.update(np.ascontiguousarray(column).tobytes())
    state.update(run.trace.tobytes())
    state.update(repr(run.collisions).encode())
    return state.hexdigest()


@dataclass(frozen=True)
class Fixed:
    """A controller that carries out the same plan and commands in every run.

    Attributes:
        plan: of its session.
        first: its commands at time 0; none later.
    """

    plan: Plan = field(default_factory=Plan)
    first: tuple[Command, ...] = ()
    name: str = "fixed"

    def start(self, site: Site) -> Session:
        return _FixedSession(self.plan, self.first)


class _FixedSession:
    def __init__(self, plan: Plan, first: tuple[Command, ...]) -> None:
        self.plan = plan
        self.first = first

    def decide(self, view: View) -> Iterable[Command]:
        commands, self.first = self.first, ()
        return commands


@dataclass(frozen=True)
class Deadly:
    """A controller that kills its process, as a bug in compiled code or a lack of memory would.

    Attributes:
        once: a file: where it is, the controller does nothing; it is made before the kill.
            Empty kills every time.
    """

    once: str = ""
    name: str = "deadly"

    def start(self, site: Site) -> Session:
        """Kill, or begin a run in which everyone may go (of a scenario without vehicles)."""
        if not self.once or not Path(self.once).exists():
            if self.once:
                Path(self.once).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return Unregulated().start(site)


def as_run(scenario: SmallScenario) -> SmallScenario:
    """The same with the vehicle of the published runs, inserted at rest, and steps of 0.02 s."""
    return dataclasses.replace(scenario, vehicle=AS_RUN.vehicle, dt=0.02, depart_speed=0.0)


def killing(once: str) -> int:
    """A task that kills its process as `Deadly` does: "always", never (""), or where no file is."""
    if once and not Path(once).exists():
        if once != "always":
            Path(once).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 7
