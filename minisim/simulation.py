"""`Simulation`, the one mutable object of a run, and `simulate`, which makes one and runs it."""

from __future__ import annotations

import math
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from minisim import kernel
from minisim.arrivals import Arrivals
from minisim.collision import Body, Collision, touching
from minisim.control import (
    Advise,
    Close,
    Command,
    Controller,
    Go,
    Hold,
    Observed,
    Open,
    Plan,
    Session,
    Site,
    View,
    Wake,
)
from minisim.errors import (
    CollisionError,
    ControllerError,
    InputError,
    choice,
    instance,
    integer,
    number,
    numbers,
    show,
)
from minisim.recording import TRAJECTORY_COLUMNS
from minisim.state import (
    DRIVING,
    NEVER,
    OBSERVED,
    TRACE,
    Records,
    build_engine,
    build_lanes,
    build_law,
    build_road,
    build_vehicles,
    first_tick,
)
from minisim.trips import Trips, collect_trips, summarise, trip_table
from minisim.version import __version__

if TYPE_CHECKING:
    import pandas as pd

RECORDS = ("junction", "all")
ON_COLLISION = ("stop", "record")

#: How long a replay goes on after the collision [s].
AFTERMATH = 2.0


class ScenarioLike(Protocol):
    """What a run needs of a scenario (`scenarios.Scenario` is one)."""

    @property
    def name(self) -> str:
        """Such as "four-way"."""

    @property
    def profile_name(self) -> str:
        """Such as "paper"."""

    @property
    def density(self) -> float:
        """Mean inflow a lane [veh/h]."""

    @property
    def horizon(self) -> float:
        """Simulated time [s]."""

    @property
    def depart_speed(self) -> float | None:
        """At insertion [m/s]; None is the highest safe one."""

    def site(self, seed: int) -> Site:
        """What the controller may know."""

    def arrivals(self, seed: int) -> Arrivals:
        """The arrival table."""


class Beginning(NamedTuple):
    """A run that is about to begin, whoever hosts it: checked, and the session started."""

    site: Site
    arrivals: Arrivals
    session: Session
    plan: Plan


def begin(scenario: ScenarioLike, controller: Controller, seed: int) -> Beginning:
    """Check what is to be run, draw the arrivals and start the controller's session.

    Raises:
        InputError: no scenario, controller or seed, or a scenario that the controller cannot
            serve.
        ControllerError: the controller gave no session.
    """
    _check_scenario(scenario)
    if not isinstance(controller, Controller) or isinstance(controller, type):
        given = show(controller)
        raise InputError(f"controller must be a Controller such as Dim(), got {given}")
    site = scenario.site(integer("seed", seed, low=0))
    arrivals = scenario.arrivals(seed)
    arrivals.check(site.intersection.n)
    session = controller.start(site)
    return Beginning(site, arrivals, session, _plan_of(session, controller))


def ask(
    session: Session, view: View, tick: int, *, controller: Controller, site: Site, vehicles: int
) -> list[Command]:
    """Show a session its view at `tick` of a run of so many vehicles; returns its commands.

    Raises:
        ControllerError: it answered with something that cannot be carried out.
    """
    commands = list(session.decide(view))
    try:
        for command in commands:
            _check_command(command, tick, site, vehicles)
    except InputError as error:
        raise ControllerError(
            f"controller {controller.name!r} at {view.time:.1f} s: {error}"
        ) from error
    return commands


def _check_command(command: Command, tick: int, site: Site, vehicles: int) -> None:
    if isinstance(command, Go | Hold | Advise):
        integer("vehicle", command.vehicle, low=0, high=vehicles - 1)
        if isinstance(command, Advise) and command.speed != math.inf:
            number("advised speed [m/s]", command.speed, low=0)
    elif isinstance(command, Open | Close):
        integer("lane", command.lane, low=0, high=site.intersection.n - 1)
    elif isinstance(command, Wake):
        if first_tick(number("wake-up time [s]", command.time), site.dt) <= tick:
            raise InputError(
                f"wake-up time {command.time:g} s is not after {round(tick * site.dt, 6):g} s"
            )
    else:
        raise InputError(f"{show(command)} is not a command")


class Simulation:
    """One run: vehicles on their paths, advanced under a controller.

    Args:
        scenario: what to simulate.
        controller: who decides; its session is private to this run.
        seed: of the run's random streams.
        record: None, "junction" (60 m before it to 30 m past it) or "all": keep trajectories.
        record_window: from and to [s].
        on_collision: "stop" raises `CollisionError`; "record" notes each pair once and goes on.

    Raises:
        InputError: a value that is not allowed, or a scenario that the controller cannot serve.
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        controller: Controller,
        *,
        seed: int = 0,
        record: str | None = None,
        record_window: tuple[float, float] = (0.0, math.inf),
        on_collision: str = "stop",
    ) -> None:
        self.site, arrivals, self._session, self.plan = begin(scenario, controller, seed)
        self.scenario = scenario
        self.controller = controller
        self.seed = int(seed)
        if record is not None:
            choice("record", record, RECORDS)
        self.record = record
        self._stop_on_collision = choice("on_collision", on_collision, ON_COLLISION) == "stop"

        self._demand_time = arrivals.time
        self._road = build_road(self.site, self.plan)
        self._law = build_law(
            self.site,
            self.plan,
            depart_speed=scenario.depart_speed,
            record=record,
            record_window=checked_window(record_window),
        )
        self._engine = build_engine(self.site)
        self._vehicles = build_vehicles(self.site, arrivals)
        self._lanes = build_lanes(self.site, self._vehicles, self.plan.lanes_open)
        self._row = np.argsort(self._vehicles["id"]).tolist()
        self._trace = np.zeros(4096 + 2 * len(self._vehicles) if record else 0, TRACE)
        self._traces: list[Records] = []
        self._traced = 0
        self._bodies = np.zeros((16 * self.site.intersection.n, 5))
        self._observed = np.zeros(len(self._vehicles) + 1, OBSERVED)
        self._seen = 0
        self._collisions: dict[tuple[int, int], Collision] = {}
        self._horizon_tick = first_tick(scenario.horizon, self.site.dt)
        self._wake_tick = NEVER
        self._period_tick = 0 if self.plan.period is not None else NEVER
        self._started = False
        self._done = False
        self.tick = 0

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return round(self.tick * self.site.dt, 6)

    @property
    def finished(self) -> bool:
        """Whether the horizon is reached or every vehicle has arrived."""
        return self._done or self.tick >= self._horizon_tick

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """The collisions so far, each pair of vehicles once."""
        return tuple(self._collisions.values())

    def advance(self, until: float) -> None:
        """Advance to time `until` [s], to the horizon, or to the last arrival.

        Raises:
            CollisionError: two bodies touched, unless collisions are only recorded.
            ControllerError: the controller answered with something that is not a command.
        """
        target = min(
            first_tick(number("until [s]", until, low=0), self.site.dt), self._horizon_tick
        )
        if not self._started:
            self._started = True
            self._decide()
        while self.tick < target and not self._done:
            self.tick, reasons, self._traced, self._seen = kernel.advance(
                self._vehicles,
                self._lanes,
                self._road,
                self._law,
                self._engine,
                self._trace,
                self._traced,
                self._bodies,
                self._observed,
                self.tick,
                min(target, self._wake_tick, self._period_tick),
            )
            if reasons & kernel.TRACE_FULL:
                self._keep_trace()
            if reasons & (kernel.TOUCH | kernel.GAP):
                self._check_collisions()
            self._done = bool(reasons & kernel.DONE)
            asked = self.tick >= min(self._wake_tick, self._period_tick)
            if asked or reasons & (kernel.MARK | kernel.CLEAR):
                self._decide()

    def run(self) -> Run:
        """Advance to the end and return the result."""
        self.advance(self._horizon_tick * self.site.dt)
        return self.result()

    def view(self) -> View:
        """What a session would be shown now."""
        return View(self.time, tuple(map(Observed._make, self._observed[: self._seen].tolist())))

    def result(self) -> Run:
        """The result so far."""
        self._keep_trace()
        horizon = self._horizon_tick * self.site.dt
        return Run(
            scenario=self.scenario,
            controller=self.controller,
            seed=self.seed,
            site=self.site,
            plan=self.plan,
            collisions=self.collisions,
            columns=collect_trips(
                self._vehicles,
                self._demand_time,
                self.site.intersection.n,
                self.site.dt,
                horizon if self._done else self.time,
            ),
            record=self.record,
            trace=np.concatenate([*self._traces, self._trace[:0]]),
            rows=self._vehicles[["id", "path"]].copy(),
        )

    def _decide(self) -> None:
        if self.tick >= self._wake_tick:
            self._wake_tick = NEVER
        if self.plan.period is not None and self.tick >= self._period_tick:
            self._period_tick = self.tick + max(1, first_tick(self.plan.period, self.site.dt))
        commands = ask(
            self._session, self.view(), self.tick,
            controller=self.controller, site=self.site, vehicles=len(self._vehicles),
        )  # fmt: skip
        for command in commands:
            self._apply(command)

    def _apply(self, command: Command) -> None:
        match command:
            case Go(vehicle) | Hold(vehicle):
                self._vehicles["go"][self._row[vehicle]] = isinstance(command, Go)
            case Open(lane) | Close(lane):
                self._lanes["open"][lane] = isinstance(command, Open)
            case Advise(vehicle, speed):
                self._vehicles["advice"][self._row[vehicle]] = speed
            case Wake(time):
                self._wake_tick = first_tick(time, self.site.dt)

    def _check_collisions(self) -> None:
        """Ask pymunk which bodies touch; in a lane the gap tells."""
        found = []
        rows, bodies = self._near_bodies()
        for i, j in touching(bodies):
            found.append((rows[i], rows[j]))
        found += self._overlaps_in_lane()
        new = []
        for i, j in found:
            collision = self._describe(i, j)
            if collision.vehicles not in self._collisions:
                self._collisions[collision.vehicles] = collision
                new.append(collision)
        if new and self._stop_on_collision:
            raise collision_error(
                new, self.scenario, self.controller, self.seed, partial(_replay, self)
            )

    def _near_bodies(self) -> tuple[list[int], list[Body]]:
        """Rows and bodies of all vehicles in and near the junction."""
        v, vehicle = self._vehicles, self.site.vehicle
        paths = self.site.intersection.paths
        rows, bodies = [], []
        for i in np.flatnonzero(v["status"] == DRIVING).tolist():
            path, s = paths[v["path"][i]], float(v["s"][i])
            if path.entry - vehicle.length <= s <= path.exit + 2 * vehicle.length:
                centre, heading = path.pose(s, vehicle.length)
                rows.append(i)
                (x, y), (ux, uy) = centre.tolist(), heading.tolist()
                bodies.append(Body(x, y, ux, uy, vehicle.length, vehicle.width))
        return rows, bodies

    def _overlaps_in_lane(self) -> list[tuple[int, int]]:
        """Rows of the vehicles whose front has reached the rear of the one ahead."""
        v, length = self._vehicles, self.site.vehicle.length
        exits, branch = self._road.ends[:, 0], self._road.branch
        found = []
        for i in np.flatnonzero(v["status"] == DRIVING).tolist():
            p = v["path"][i]
            same_lane = np.flatnonzero((v["status"] == DRIVING) & (v["lane"] == v["lane"][i]))
            for j in same_lane[same_lane < i].tolist():
                rear = v["s"][j] - length
                if rear <= v["s"][i] and rear < branch[v["path"][j], p]:
                    found.append((j, i))
            j = int(v["ahead"][i])
            if j >= 0 and v["status"][j] == DRIVING and v["s"][i] >= exits[p]:
                rear = v["s"][j] - length - exits[v["path"][j]]
                if rear <= v["s"][i] - exits[p]:
                    found.append((j, i))
        return found

    def _describe(self, i: int, j: int) -> Collision:
        v = self._vehicles
        i, j = sorted((i, j), key=lambda row: int(v["id"][row]))
        movements = self.site.intersection.movements
        return Collision(
            time=self.time,
            vehicles=(int(v["id"][i]), int(v["id"][j])),
            movements=(str(movements[v["path"][i]]), str(movements[v["path"][j]])),
            positions=(float(v["s"][i]), float(v["s"][j])),
            speeds=(float(v["v"][i]), float(v["v"][j])),
        )

    def _keep_trace(self) -> None:
        self._traces.append(self._trace[: self._traced].copy())
        self._traced = 0


def _replay(stopped: Simulation, seconds: float = 10.0) -> Run:
    """Run again up to a little after the collision; records the last `seconds` before it."""
    again = Simulation(
        stopped.scenario,
        stopped.controller,
        seed=stopped.seed,
        record="all",
        record_window=(max(0.0, stopped.time - seconds), math.inf),
        on_collision="record",
    )
    again.advance(stopped.time + AFTERMATH)
    return again.result()


def collision_error(
    collisions: Sequence[Collision],
    scenario: ScenarioLike,
    controller: Controller,
    seed: int,
    replay: Callable[..., Run],
) -> CollisionError:
    """What stopped a run, with a `replay` that records what led to it."""
    what = "; ".join(str(collision) for collision in collisions)
    where = f"scenario {scenario.name}, controller {controller.name}"
    return CollisionError(f"{what} ({where}, seed {seed})", tuple(collisions), replay)


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a run.

    Attributes:
        scenario, controller, seed: what was run.
        site, plan: what the controller knew and asked for.
        collisions: each pair of vehicles once.
        columns: the trips as arrays.
        record: what was recorded of the trajectories.
        trace, rows: the recording, and each row's vehicle id and path.
        host: what moved the vehicles, for the provenance: `host` and what else to name.
    """

    scenario: ScenarioLike
    controller: Controller
    seed: int
    site: Site
    plan: Plan
    collisions: tuple[Collision, ...]
    columns: Trips
    record: str | None
    trace: Records
    rows: Records
    host: Mapping[str, str] = field(default_factory=lambda: {"host": "minisim"})

    @cached_property
    def trips(self) -> pd.DataFrame:
        """One row a trip in demand order, columns `minisim.trips.TRIP_COLUMNS`."""
        return trip_table(self.columns)

    def summary(self) -> dict[str, Any]:
        """What was run and its means; see `minisim.trips.summarise`."""
        return {
            "controller": self.controller.name,
            "scenario": self.scenario.name,
            "profile": self.scenario.profile_name,
            "density": self.scenario.density,
            "seed": self.seed,
            "horizon_s": self.scenario.horizon,
            "host": self.host["host"],
            **summarise(self.columns, self.site.intersection.n),
            "collisions": len(self.collisions),
        }

    @property
    def provenance(self) -> dict[str, str]:
        """Version, environment and parameters: all that is needed to run it again."""
        return {
            "minisim": __version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "scenario": repr(self.scenario),
            "controller": repr(self.controller),
            "seed": str(self.seed),
            **self.host,
        }

    @cached_property
    def trajectories(self) -> pd.DataFrame:
        """One row a vehicle and step, columns `minisim.recording.TRAJECTORY_COLUMNS`.

        Raises:
            InputError: nothing was recorded.
        """
        import pandas as pd

        if self.record is None:
            raise InputError("no trajectories: simulate with record='junction' or record='all'")
        vehicle = self.rows["id"][self.trace["row"]]
        order = np.lexsort((vehicle, self.trace["tick"]))
        trace, vehicle = self.trace[order], vehicle[order]
        paths, arms = self.site.intersection.paths, self.site.intersection.arms
        path_of = self.rows["path"][trace["row"]]
        front = np.zeros((len(trace), 2))
        heading = np.zeros((len(trace), 2))
        for p in np.unique(path_of).tolist():
            chosen = np.flatnonzero(path_of == p)
            s = trace["s"][chosen]
            front[chosen] = paths[p].position(s)
            heading[chosen] = paths[p].pose(s, self.site.vehicle.length)[1]
        manoeuvres = self.site.intersection.n - 1
        columns = (
            np.round(trace["tick"] * self.site.dt, 6),
            vehicle,
            pd.Categorical.from_codes(path_of // manoeuvres, pd.Index([arm.name for arm in arms])),
            path_of % manoeuvres + 1,
            trace["s"],
            front[:, 0],
            front[:, 1],
            np.degrees(np.arctan2(heading[:, 0], heading[:, 1])) % 360.0,
            trace["v"],
            trace["a"],
            trace["released"] != 0,
        )
        return pd.DataFrame(dict(zip(TRAJECTORY_COLUMNS, columns, strict=True)))


def simulate(
    scenario: ScenarioLike,
    controller: Controller,
    seed: int = 0,
    *,
    record: str | None = None,
    record_window: tuple[float, float] = (0.0, math.inf),
    on_collision: str = "stop",
) -> Run:
    """Run a scenario under a controller; see `Simulation` for the arguments and errors.

    Example:
        >>> import minisim
        >>> from minisim.testing import small_scenario
        >>> from minisim.control import Unregulated
        >>> run = minisim.simulate(small_scenario(density=0), Unregulated())
        >>> run.summary()["trips"]
        0
    """
    return Simulation(
        scenario,
        controller,
        seed=seed,
        record=record,
        record_window=record_window,
        on_collision=on_collision,
    ).run()


def _check_scenario(scenario: object) -> None:
    needed = ("name", "profile_name", "density", "horizon", "depart_speed", "site", "arrivals")
    if isinstance(scenario, type) or not all(hasattr(scenario, name) for name in needed):
        raise InputError(f"scenario must be a Scenario such as four_way(), got {show(scenario)}")


def _plan_of(session: object, controller: Controller) -> Plan:
    plan = getattr(session, "plan", None)
    if not isinstance(plan, Plan) or not isinstance(session, Session):
        raise ControllerError(
            f"controller {controller.name!r}: start() must return a Session with a Plan, "
            f"got {show(session)}"
        )
    return plan


def checked_window(window: Iterable[float]) -> tuple[float, float]:
    """Return a `record_window`, or raise `InputError`."""
    instance("record_window", window, tuple)
    if not isinstance(window, tuple) or len(window) != 2:
        raise InputError(f"record_window must be (from, to) in seconds, got {show(window)}")
    start, end = window
    end = end if end == math.inf else number("end of record_window [s]", end)
    start = number("start of record_window [s]", start, low=0)
    if end < start:
        raise InputError(f"record_window must not end before it starts, got {show(window)}")
    return numbers("record_window", (start,))[0], end
