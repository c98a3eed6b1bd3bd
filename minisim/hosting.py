"""What all hosts share: how a run begins and stops, and how a session is woken and asked."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from minisim.arrivals import Arrivals
from minisim.control import (
    Advise,
    Brake,
    Close,
    Command,
    Controller,
    Counting,
    Go,
    Hold,
    Kinds,
    Open,
    Plan,
    Session,
    Site,
    View,
    Wake,
    as_controller,
)
from minisim.engine.collision import Collision
from minisim.engine.state import NEVER, first_tick, time_of
from minisim.errors import (
    CollisionError,
    ControllerError,
    InputError,
    choice,
    integer,
    number,
    show,
)
from minisim.names import name_of
from minisim.results.run import Run, ScenarioLike

RECORDS = ("junction", "all")
ON_COLLISION = ("stop", "record")

#: What may happen at a collision where SUMO or its cruise control drives.
REACTIONS = (*ON_COLLISION, "teleport")

#: What a scenario must have.
NEEDED = (
    "name", "profile_name", "density", "horizon", "warmup", "depart_speed", "site", "arrivals",
)  # fmt: skip

#: Commands grouped by what they address. Building a union of types at each check would be slow.
TO_VEHICLES, TO_LANES = (Go, Hold, Advise, Brake), (Open, Close)

#: How long a replay goes on after the collision [s].
AFTERMATH = 2.0


class Alarm:
    """When the clock wakes a session: periodically, as its plan says, and once whenever it asks."""

    def __init__(self, period: float | None, dt: float) -> None:
        self._dt = dt
        self._every = NEVER if period is None else max(1, first_tick(period, dt))
        self._due = NEVER if period is None else 0
        self._asked = NEVER

    @property
    def tick(self) -> int:
        """The next tick at which the alarm rings."""
        return min(self._asked, self._due)

    def reset(self, tick: int) -> None:
        """The session is awake at `tick`: everything due by then has been served."""
        if tick >= self._asked:
            self._asked = NEVER
        if tick >= self._due:
            self._due = tick + self._every

    def set(self, command: Wake) -> None:
        """Ring once at the command's time; this replaces any earlier request."""
        self._asked = first_tick(command.time, self._dt)


@dataclass(frozen=True, eq=False)
class Hosted:
    """A run in any host, with its arguments checked and its session started."""

    scenario: ScenarioLike
    controller: Controller
    seed: int
    record: str | None
    record_window: tuple[float, float]
    on_collision: str
    site: Site
    arrivals: Arrivals
    session: Session
    plan: Plan
    #: What the session had counted when the warm-up ended.
    before: dict[str, float] = field(default_factory=dict)

    def ask(self, view: View, tick: int) -> list[Command]:
        """Show the session its view at `tick` and return its commands.

        Raises:
            ControllerError: the session answered with something that cannot be carried out.
        """
        commands = list(self.session.decide(view))
        if 0.0 < view.time <= self.scenario.warmup and isinstance(self.session, Counting):
            self.before.update(self.session.counts)
        try:
            for command in commands:
                _check_command(command, tick, self.site, len(self.arrivals))
        except InputError as error:
            raise ControllerError(
                f"controller {name_of(self.controller)!r} at {view.time:.1f} s: {error}"
            ) from error
        return commands

    def collided(
        self, collisions: Sequence[Collision], replay: Callable[..., Run]
    ) -> CollisionError:
        """The error that stops the run, with a `replay` that records what led to it."""
        what = "; ".join(map(str, collisions))
        where = f"scenario {self.scenario.name}, controller {name_of(self.controller)}"
        return CollisionError(f"{what} ({where}, seed {self.seed})", tuple(collisions), replay)

    def result(self, **measured: Any) -> Run:
        """The result; `measured` are the fields of `Run` that only the host knows."""
        session, lanes, ranks = self.session, self.arrivals.lane, self.arrivals.rank
        counts = dict(session.counts) if isinstance(session, Counting) else {}
        counts |= {name: round(counts[name] - was, 6) for name, was in self.before.items()}
        kinds = (
            map(session.kind, lanes.tolist(), ranks.tolist()) if isinstance(session, Kinds) else ()
        )
        return Run(
            scenario=self.scenario,
            controller=self.controller,
            seed=self.seed,
            site=self.site,
            plan=self.plan,
            record=self.record,
            counts=counts,
            kinds=tuple(kinds),
            **measured,
        )


def begin(
    scenario: ScenarioLike,
    controller: Controller,
    seed: int,
    *,
    record: str | None,
    record_window: tuple[float, float],
    on_collision: str,
    reactions: Sequence[str] = ON_COLLISION,
) -> Hosted:
    """Check the arguments, draw the arrivals and start the controller's session.

    Raises:
        InputError: an argument is not allowed (`reactions` are those to a collision), or the
            controller cannot serve the scenario.
        ControllerError: the controller returned no session.
    """
    if record is not None:
        choice("record", record, RECORDS)
    choice("on_collision", on_collision, reactions)
    window = checked_window(record_window)
    if isinstance(scenario, type) or not all(hasattr(scenario, name) for name in NEEDED):
        raise InputError(f"scenario must be a Scenario such as four_way(), got {show(scenario)}")
    as_controller(show(controller), controller)
    site = scenario.site(integer("seed", seed, low=0))
    arrivals = scenario.arrivals(seed)
    arrivals.check(site.intersection.n)
    try:
        session = controller.start(site)
    except InputError as error:
        raise InputError(f"{name_of(controller)}: {error}") from error
    plan = getattr(session, "plan", None)
    if not isinstance(plan, Plan) or not isinstance(session, Session):
        raise ControllerError(
            f"controller {name_of(controller)!r}: start() must return a Session with a Plan, "
            f"got {show(session)}"
        )
    return Hosted(
        scenario, controller, int(seed), record, window, on_collision, site, arrivals, session, plan
    )


def checked_window(window: object) -> tuple[float, float]:
    """Return a `record_window`, or raise `InputError`."""
    if not isinstance(window, tuple) or len(window) != 2:
        raise InputError(f"record_window must be (from, to) in seconds, got {show(window)}")
    start = number("start of record_window [s]", window[0], low=0)
    if window[1] == math.inf:
        return start, math.inf
    return start, number("end of record_window [s]", window[1], low=start)


def _check_command(command: Command, tick: int, site: Site, vehicles: int) -> None:
    if isinstance(command, TO_VEHICLES):
        integer("vehicle", command.vehicle, low=0, high=vehicles - 1)
        if isinstance(command, Advise) and command.speed != math.inf:
            number("advised speed [m/s]", command.speed, low=0)
        if isinstance(command, Brake):
            number("deceleration to brake at [m/s²]", command.deceleration, low=0)
    elif isinstance(command, TO_LANES):
        integer("lane", command.lane, low=0, high=site.intersection.n - 1)
    elif isinstance(command, Wake):
        if first_tick(number("wake-up time [s]", command.time), site.dt) <= tick:
            now = time_of(tick, site.dt)
            raise InputError(f"wake-up time {command.time:g} s is not after {now:g} s")
    else:
        raise InputError(f"{show(command)} is not a command")
