"""The contract of every controller, as a function to call in its tests: `check_controller`."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

from minisim.arrivals import Arrivals
from minisim.control import (
    TO_VEHICLES,
    Command,
    Controller,
    Plan,
    Session,
    Site,
    View,
    as_controller,
    check_command,
)
from minisim.demand import Demand
from minisim.errors import (
    ControllerError,
    InputError,
    MinisimError,
    choice,
    instance,
    integer,
    number,
)
from minisim.fleet import Fleet
from minisim.inflow import MAX_DENSITY
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES
from minisim.parameters import Reals, declared, part, real, reals, text, word
from minisim.results.run import Run
from minisim.simulation import simulate
from minisim.ticks import first_tick
from minisim.vehicle import VehicleType

#: Time allowed per vehicle after the demand has ended, and to drive the roads [s]. An all-way stop,
#: the slowest sensible rule, needs about 2.5 s per vehicle.
SECONDS_PER_VEHICLE, SECONDS_PER_ROAD = 10.0, 600.0

#: A host's `simulate`, and a session's `decide`.
Simulate = Callable[..., Run]
Decide = Callable[[View], Iterable[Command]]

HOSTS = ("minisim", "sumo")


class ContractError(MinisimError, AssertionError):
    """A controller broke its contract, which test runners count as a failed assertion."""


@declared(kw_only=True)
class SmallScenario:
    """A scenario for tests: SUMO's passenger car at 14 m/s, and roads that empty at the end."""

    bearings: Reals[tuple[float, ...]] = reals(
        "of the arms, clockwise from north", "deg", default=(0.0, 90.0, 180.0, 270.0)
    )
    side: Literal["left", "right"] = word("of the road", ("left", "right"), default="left")
    density: float = real("mean inflow", "veh/h/lane", default=350.0, low=0, high=MAX_DENSITY)
    demand_time: float = real("vehicles come until then", "s", default=300.0, above=0, high=1e6)
    drain: float = real("how much longer the run goes on", "s", default=0.0, low=0, high=1e6)
    warmup: float = real("nothing before it is measured", "s", default=0.0, low=0)
    vehicle: VehicleType = part("type of the vehicles", VehicleType, default_factory=VehicleType)
    speed_limit: float = real("of the roads", "m/s", default=14.0, above=0, high=100)
    arm_length: float = real("of a road, from the centre", "m", default=500.0)
    dt: float = real("step of the host", "s", default=0.1, low=0.001, high=0.5)
    name: str = text("of the scenario", default="small")
    profile_name: str = text("of its profile", default="test")
    depart_speed: float | None = real(
        "highest at insertion; none means the highest safe", "m/s", default=None, optional=True
    )

    def __post_init__(self) -> None:
        number("warmup [s]", self.warmup, below=self.horizon)
        self.site(0)

    @property
    def horizon(self) -> float:
        """Simulated time [s]."""
        return self.demand_time + self.drain

    @cached_property
    def intersection(self) -> Intersection:
        """Its geometry."""
        return Intersection(self.bearings, side=self.side, arm_length=self.arm_length)

    def site(self, seed: int) -> Site:
        """What a controller may know about it."""
        (demand,) = Demand(density=self.density).inflow(self.intersection.n).rates
        return Site(
            self.intersection, Fleet((self.vehicle,)), self.speed_limit, demand, self.dt, seed
        )

    def arrivals(self, seed: int) -> Arrivals:
        """Arrivals in the first `demand_time` seconds."""
        return Demand(density=self.density).draw(self.intersection.n, self.demand_time, seed)


def small_scenario(arms: int = 4, *, density: float = 350.0, **options: Any) -> SmallScenario:
    """A regular junction with this many arms; `options` are the attributes of `SmallScenario`."""
    integer("arms", arms, low=3, high=len(ARM_NAMES))
    bearings = tuple(360.0 * i / arms for i in range(arms))
    return SmallScenario(bearings=bearings, density=density, **options)


def drained(
    arms: int = 4, *, density: float = 350.0, demand_time: float = 300.0, **options: Any
) -> SmallScenario:
    """A small scenario that gives any working controller the time to serve every vehicle."""
    demand_time = number("demand_time [s]", demand_time, above=0, high=1e6)
    vehicles = arms * density * demand_time / 3600.0
    drain = SECONDS_PER_ROAD + SECONDS_PER_VEHICLE * vehicles
    return small_scenario(arms, density=density, demand_time=demand_time, drain=drain, **options)


def check_controller(
    controller: Controller,
    *,
    arms: Iterable[int] = (3, 4, 5),
    density: float = 350.0,
    horizon: float = 300.0,
    collision_free: bool = True,
    host: str | Simulate = "minisim",
) -> None:
    """Run a controller through its contract (`minisim.control`).

    A controller is a recipe: it compares, hashes, prints and pickles like a value, and runs
    leave no trace in it. Its sessions answer views with valid commands. The same seed gives the
    same trips, even from a pickled copy or after other runs. None collides, and all are served.

    Args:
        controller: to check.
        arms: junctions to check it on.
        density: mean inflow per lane [veh/h].
        horizon: how long the demand lasts [s].
        collision_free: whether collisions break the contract.
        host: "minisim", "sumo" (extra `sumo`), or a function called like `minisim.simulate`.

    Raises:
        ContractError: the contract is broken; the message says how in one sentence.
        MissingExtraError: the host is not installed.
    """
    instance("arms", arms, Iterable)
    run = _simulate_in(host)
    try:
        as_controller(controller)
    except InputError as error:
        raise ContractError(str(error)) from None
    copy = _check_value(controller)
    before = repr(controller), hash(controller)
    for n in arms:
        scenario = drained(n, density=density, demand_time=horizon)
        try:
            first = run(scenario, _watched(controller), 1, on_collision="record")
        except ControllerError as error:
            raise ContractError(str(error)) from error
        _check_arrivals(controller, first)
        if collision_free:
            touched = "; ".join(map(str, first.collisions[:1]))
            _require(not touched, controller, f"vehicles collided: {touched}")
        _check_served(controller, first)
        again = _disturbed(controller, scenario, run)
        for other, problem in (
            (again, "a second run with the same seed gave other trips; a run left traces"),
            (_watched(copy), "a pickled copy gave other trips"),
        ):
            trips = run(scenario, other, 1, on_collision="record").trips
            _require(first.trips.equals(trips), controller, problem)
    same = (repr(controller), hash(controller)) == before and controller == copy
    changed = "it is not the same after its runs: a run must not change its controller"
    _require(same, controller, changed)


def check_commands(commands: Iterable[Command], view: View, site: Site) -> None:
    """Check a session's answer to a view.

    Raises:
        ContractError: an item is not a command, a vehicle is not in the view, a lane does not
            exist, a speed or deceleration is below 0, or a wake-up is not in the future.
    """
    ids = {vehicle.id for vehicle in view.vehicles}
    for command in commands:
        try:
            check_command(command, first_tick(view.time, site.dt), site)
            if isinstance(command, TO_VEHICLES) and command.vehicle not in ids:
                raise InputError("this vehicle is not in the view")
        except InputError as error:
            raise ContractError(f"at {view.time:.1f} s: {command!r}: {error}") from None


@dataclass(frozen=True)
class _Wrapped:
    """A controller with something wrapped around its sessions' `decide`."""

    controller: Controller
    name: str
    wrap: Callable[[Session, Site], Decide]

    def start(self, site: Site) -> Session:
        session = self.controller.start(site)
        if not isinstance(session, Session) or not isinstance(session.plan, Plan):
            return session  # which the host refuses
        return _WrappedSession(session.plan, self.wrap(session, site))


class _WrappedSession(NamedTuple):
    plan: Plan
    decide: Decide


def _watched(controller: Controller) -> _Wrapped:
    """The controller, with its sessions' answers checked on the way to the host."""

    def wrap(session: Session, site: Site) -> Decide:
        def decide(view: View) -> Iterable[Command]:
            answer = session.decide(view)
            if not isinstance(answer, Iterable):
                return answer  # which the host refuses
            commands = tuple(answer)
            try:
                check_commands(commands, view, site)
            except ContractError as error:
                raise ContractError(f"controller {controller.name!r} {error}") from None
            return commands

        return decide

    return _Wrapped(controller, controller.name, wrap)


def _disturbed(controller: Controller, scenario: SmallScenario, run: Simulate) -> _Wrapped:
    """The controller, with another seed's run in the middle of each of its runs."""

    def wrap(session: Session, site: Site) -> Decide:  # noqa: ARG001
        due = [scenario.demand_time / 2.0]

        def decide(view: View) -> Iterable[Command]:
            if due and view.time >= due[0]:
                due.clear()
                run(scenario, controller, 2, on_collision="record")
            return session.decide(view)

        return decide

    return _Wrapped(controller, controller.name, wrap)


def _check_value(controller: Controller) -> Controller:
    """Check that the controller behaves like a value, and return a pickled copy."""
    try:
        hash(controller)
    except TypeError as error:
        raise _broken(controller, f"it is not hashable: {error}") from error
    try:
        copy: Controller = pickle.loads(pickle.dumps(controller))
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        raise _broken(controller, f"it is not picklable: {error}") from error
    _require(copy == controller, controller, "a pickled copy of it is not equal to it")
    _require(hash(copy) == hash(controller), controller, "a pickled copy of it has another hash")
    other = "a pickled copy of it prints as something else"
    _require(repr(copy) == repr(controller), controller, other)
    return copy


def _simulate_in(host: str | Simulate) -> Simulate:
    if callable(host):
        return host
    if choice("host", host, HOSTS) == "minisim":
        return simulate
    from minisim.sumo import simulate as simulate_in_sumo

    return simulate_in_sumo


def _check_arrivals(controller: Controller, run: Run) -> None:
    drawn = run.scenario.arrivals(run.seed)
    met = Arrivals(run.columns.demand_time, run.columns.lane, run.columns.manoeuvre)
    columns = ("time", "lane", "manoeuvre")
    same = all(getattr(met, of).tolist() == getattr(drawn, of).tolist() for of in columns)
    _require(same, controller, "the run did not use the arrivals of its scenario and seed")


def _check_served(controller: Controller, run: Run) -> None:
    waiting = run.columns.lane[~run.columns.arrived].tolist()
    lanes = ", ".join(sorted({ARM_NAMES[lane] for lane in waiting}))
    unserved = f"{len(waiting)} of {len(run.columns.lane)} vehicles were never served"
    where = f"on {run.site.intersection.n} arms (lanes {lanes})"
    after = f"within {run.scenario.horizon:.0f} s"
    _require(not waiting, controller, f"{unserved} {where}, {after}")


def _require(condition: bool, controller: Controller, problem: str) -> None:
    if not condition:
        raise _broken(controller, problem)


def _broken(controller: Controller, problem: str) -> ContractError:
    return ContractError(f"controller {controller.name!r}: {problem}")
