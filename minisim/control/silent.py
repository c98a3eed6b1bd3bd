"""Controllers that decide nothing."""

from __future__ import annotations

from dataclasses import dataclass

from minisim.control.commands import Command
from minisim.control.cover import NOTHING
from minisim.control.plan import Plan
from minisim.control.protocols import Session
from minisim.control.site import Site
from minisim.control.view import View
from minisim.errors import instance
from minisim.names import Name


@dataclass(frozen=True)
class Unregulated:
    """All vehicles go at once, for tests of the host and for teaching: cross traffic collides."""

    name = Name("unregulated")
    covers = NOTHING

    def start(self, site: Site) -> Session:  # noqa: ARG002  (Controller's argument)
        """Open every lane, for good."""
        return _Silent(Plan(lanes_open=True))


@dataclass(frozen=True)
class External:
    """Decides nothing itself: all commands come from outside (`Simulation.command`).

    `plan` says when `Simulation.run_until("wake")` returns and what `Simulation.view` shows.
    """

    plan: Plan = Plan()  # noqa: RUF009  (frozen)

    name = Name("external")
    covers = NOTHING

    def __post_init__(self) -> None:
        instance("plan", self.plan, Plan)

    def start(self, site: Site) -> Session:  # noqa: ARG002  (Controller's argument)
        """Begin a run in which every vehicle is held until a command lets it go."""
        return _Silent(self.plan)


@dataclass(frozen=True)
class _Silent:
    plan: Plan

    def decide(self, view: View) -> tuple[Command, ...]:  # noqa: ARG002  (Session's argument)
        return ()
