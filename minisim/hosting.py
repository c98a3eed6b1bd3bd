"""What all hosts share: how a run begins and stops, and how a session is woken and asked."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from minisim.arrivals import Arrivals
from minisim.control import (
    NO_REPORTS,
    Command,
    Controller,
    Counting,
    Kinds,
    Plan,
    Session,
    Site,
    View,
    Wake,
    as_controller,
    check_command,
    keeps,
)
from minisim.engine.collision import Collision
from minisim.errors import (
    CollisionError,
    ControllerError,
    InputError,
    MinisimError,
    choice,
    instance,
    integer,
    number,
    show,
    told,
)
from minisim.names import name_of
from minisim.reasons import Witness
from minisim.results.run import Run, ScenarioLike
from minisim.ticks import NEVER, first_tick, time_of

RECORDS = ("junction", "all")
ON_COLLISION = ("stop", "record")

#: What may happen at a collision if SUMO or its cruise control drives.
REACTIONS = (*ON_COLLISION, "teleport")

#: What a scenario must have.
NEEDED = (
    "name", "profile_name", "density", "horizon", "warmup", "depart_speed", "site", "arrivals",
)  # fmt: skip

#: How long a replay goes on after the collision [s].
AFTERMATH = 2.0


class Alarm:
    """When the clock wakes a session: by the period of its plan, and once whenever it asks."""

    def __init__(self, period: float | None, dt: float) -> None:
        self._dt = dt
        self._every = NEVER if period is None else first_tick(period, dt)
        self._due = NEVER if period is None else 0
        self._asked = NEVER
        #: The first tick at which vehicles wake it again.
        self.heeds = 0

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
        undisturbed = command.undisturbed
        self.heeds = 0 if undisturbed == -math.inf else first_tick(undisturbed, self._dt)


@dataclass(frozen=True, eq=False)
class Hosted:
    """A run in any host: its checked arguments and its started session."""

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
    timed: bool = False  # whether the CPU time of each decision is kept
    before: dict[str, float] = field(default_factory=dict)  # counts at the end of the warm-up
    exchange: Counter[str] = field(default_factory=Counter)  # see `Run.exchange`
    times: list[int] = field(default_factory=list)  # of the decisions [ns]
    witness: Witness | None = None  # what writes down reasons, if the run is to be explained

    @property
    def shared(self) -> tuple[object, ...]:
        """What no run changes, so that forks of it share them."""
        return self.scenario, self.controller, self.arrivals, self.plan, self.site, NO_REPORTS

    def ask(self, view: View, tick: int) -> list[Command]:
        """Show the session its view at `tick` and return its commands.

        Raises `ControllerError` for an error of the session, named with its file and line, or an
        answer that cannot be carried out.
        """
        try:
            began = time.thread_time_ns() if self.timed else 0
            commands = listed(self.session.decide(view))
            if self.timed:
                self.times.append(time.thread_time_ns() - began)
            self.exchange["decisions"] += 1
            self.exchange["shown"] += len(view.vehicles)
            if 0.0 < view.time <= self.scenario.warmup and keeps(self.session, Counting):
                self.before.update(self.session.counts)
            self.take(commands, tick)
            if view.time < self.scenario.warmup:
                self.exchange.clear()
                self.times.clear()
            if self.witness is not None:
                self.witness.look(view)
        except (Exception, SystemExit) as error:  # a caller's code may raise anything
            raise _blame(self.controller, error, self.session, f" at {view.time:.1f} s") from error
        return commands

    def take(self, commands: Sequence[Command], tick: int) -> None:
        """Check commands and count them; raises `InputError` for one that cannot be carried out."""
        for command in commands:
            check_command(command, tick, self.site, len(self.arrivals))
        if time_of(tick, self.site.dt) >= self.scenario.warmup:
            for command in commands:
                self.exchange[type(command).__name__] += 1
        if self.witness is not None:
            self.witness.note(commands)

    def look(self, view: View) -> None:
        """Write down the reasons at the time of a view; `ControllerError` as `ask` raises."""
        try:
            if self.witness is not None:
                self.witness.look(view)
        except (Exception, SystemExit) as error:  # a caller's code may raise anything
            session = self.session
            raise _blame(self.controller, error, session, f" at {view.time:.1f} s") from error

    def collided(self, these: Sequence[Collision], replay: Callable[..., Run]) -> CollisionError:
        """The error that stops the run, with a `replay` that records what led to it."""
        what = "; ".join(map(str, these))
        where = f"scenario {self.scenario.name}, controller {name_of(self.controller)}"
        return CollisionError(f"{what} ({where}, seed {self.seed})", tuple(these), replay)

    def result(self, **measured: Any) -> Run:
        """The result; `measured` are the fields of `Run` that only the host knows."""
        session, lanes, ranks = self.session, self.arrivals.lane, self.arrivals.rank
        try:
            counts = dict(session.counts) if keeps(session, Counting) else {}
            counts |= {name: round(counts[name] - was, 6) for name, was in self.before.items()}
            kinds: tuple[str, ...] = ()
            if keeps(session, Kinds):
                kinds = tuple(map(session.kind, lanes.tolist(), ranks.tolist()))
        except (Exception, SystemExit) as error:  # a caller's code may raise anything
            raise _blame(self.controller, error, session) from error
        return Run(
            scenario=self.scenario,
            controller=self.controller,
            seed=self.seed,
            site=self.site,
            plan=self.plan,
            record=self.record,
            record_window=self.record_window,
            counts=counts,
            kinds=kinds,
            reasons=None if self.witness is None else tuple(self.witness.told),
            heads=None if self.witness is None else tuple(self.witness.shown),
            exchange=dict(self.exchange),
            decision_times=np.array(self.times) / 1e9 if self.timed else None,
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
    timed: bool = False,
    explain: bool = False,
) -> Hosted:
    """Check the arguments, draw the arrivals and start the controller's session.

    Raises what `start` raises, and `InputError` for an argument that is not allowed; `reactions`
    are the possible values of `on_collision`.
    """
    if record is not None:
        choice("record", record, RECORDS)
    choice("on_collision", on_collision, reactions)
    instance("timed", timed, bool)
    instance("explain", explain, bool)
    window = checked_window(record_window)
    if isinstance(scenario, type) or not all(hasattr(scenario, name) for name in NEEDED):
        raise InputError(f"scenario must be a Scenario such as four_way(), got {show(scenario)}")
    as_controller(controller)
    site = scenario.site(integer("seed", seed, low=0))
    arrivals = scenario.arrivals(seed)
    arrivals.check(site.intersection.n, site.intersection.allowed_by_lane)
    session, plan = start(controller, site)
    return Hosted(
        scenario, controller, int(seed), record, window, on_collision, site, arrivals, session,
        plan, timed, witness=Witness(site, session) if explain else None,
    )  # fmt: skip


def start(controller: Controller, site: Site) -> tuple[Session, Plan]:
    """Start a controller's session, and check that its plan fits the site.

    Raises:
        InputError: the controller cannot serve the site.
        ControllerError: it raised another error, returned no session, or its plan has a period
            below the step or a distance beyond the approach lanes.
    """
    try:
        session = controller.start(site)
        plan = getattr(session, "plan", None)
    except InputError as error:
        raise InputError(f"{name_of(controller)}: {error}") from error
    except MinisimError:
        raise
    except (Exception, SystemExit) as error:  # a caller's code may raise anything
        raise _blame(controller, error, controller) from error
    try:
        if not isinstance(plan, Plan) or not keeps(session, Session):
            raise InputError(f"start() must return a Session with a Plan, got {show(session)}")
        if plan.period is not None:
            site.period("period of the plan", plan.period)
        road = site.intersection.approach_length
        room = site.intersection.shortest_approach - site.vehicle.length
        number("hold_distance [m] of the plan, on these roads,", plan.hold_distance, high=room)
        marks = {f"marks[{k}]": mark for k, mark in enumerate(plan.marks)}
        marks |= {f"start of marking {it.name!r}": it.start for it in plan.markings}
        # The road may be shorter than the default sight.
        marks |= {"sight": plan.sight if plan.sight != Plan.sight else 0.0}
        for name, distance in marks.items():
            number(f"{name} [m] of the plan, on these roads,", distance, high=road)
    except InputError as error:
        raise _blame(controller, error, controller) from error
    return session, plan


def _blame(
    controller: Controller, error: BaseException, of: object, when: str = ""
) -> ControllerError:
    """The error that says where a controller's own code failed, and why."""
    if isinstance(error, MinisimError) and not isinstance(error, InputError):
        raise error
    module = sys.modules.get(of.__module__)
    folder = Path(getattr(module, "__file__", None) or "/").parent
    why = error if isinstance(error, InputError) else told(error, folder)
    return ControllerError(f"controller {name_of(controller)!r}{when}: {why}")


def listed(answer: object) -> list[Command]:
    """A session's answer as a list; raises `InputError` if it is none."""
    if isinstance(answer, list):  # as nearly always, and the other test takes longer
        return answer
    if isinstance(answer, Iterable):
        return list(answer)
    wanted = "commands, such as [Go(3)] or []"
    raise InputError(f"decide() must return {wanted}, got {show(answer)}")


def checked_window(window: object) -> tuple[float, float]:
    """Return a `record_window`, or raise `InputError`."""
    if not isinstance(window, tuple) or len(window) != 2:
        raise InputError(f"record_window must be (from, to) in seconds, got {show(window)}")
    start, end = number("start of record_window [s]", window[0], low=0), window[1]
    return start, end if end == math.inf else number("end of record_window [s]", end, low=start)
