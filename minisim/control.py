"""What a controller sees and may command: the door between the simulator and the controllers.

Controllers may also import `junction`, `vehicle`, `fleet`, `parameters`, `names`, `errors`,
`files`, `streams`, `inflow`, `laws`, `carfollowing` and `jit` from `minisim`. None of these imports
the engine, the hosts or the results; `make lint` checks this.

A `Controller` is a frozen recipe. For each run the host (minisim, or SUMO) calls
`controller.start(site)` and gets a `Session`: the mutable side, with a `Plan` of what it needs.
The host then advances alone until one of the plan's wake-ups, shows the session a `View`, and
carries out the commands that the session returns. Only a plan with a period wakes it regularly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol, TypeGuard, TypeVar, cast, runtime_checkable

from minisim.channel import Channel
from minisim.errors import InputError, instance, integer, number, printable, told
from minisim.fleet import Fleet
from minisim.inflow import Inflow
from minisim.junction.conflicts import conflicts, entry_room
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools, Movement
from minisim.names import Name
from minisim.parameters import (
    Reals,
    Switch,
    checked,
    declared,
    part,
    real,
    reals,
    switch,
    text,
    whole,
)
from minisim.vehicle import MODELS, VehicleType

#: Lateral acceleration that turning vehicles accept [m/s²]: netconvert's default of
#: `--junctions.limit-turn-speed`, for turn speeds like SUMO's.
LATERAL_ACCELERATION = 5.5

#: A vehicle counts as able to stop only with this distance to spare [m], more than rounding errors.
#: A held vehicle keeps more before its line (`minisim.laws.STOP_MARGIN`), so it always counts as
#: able to stop while it brakes for the junction entry.
COMMIT_MARGIN = 0.1

#: A vehicle no faster than this stands or waits [m/s]: SUMO's `SUMO_const_haltingSpeed`.
HALTING = 0.1


@declared
class Site:
    """What a controller may know before the first vehicle arrives."""

    intersection: Intersection = part("its geometry", Intersection)
    fleet: Fleet = checked("the vehicles' types", lambda _, value: _fleet(value), "a Fleet")
    speed_limit: float = real("of the roads, the highest one", "m/s", above=0, high=100)
    demand: Reals[tuple[float, ...]] = reals(
        "expected inflow of each lane, mean over the run", "veh/h"
    )
    dt: float = real("step of the host", "s", default=0.1, low=0.001, high=0.5)
    seed: int = whole("of the run, for random numbers (`minisim.streams`)", default=0, low=0)
    limits: Reals[tuple[float, ...]] = reals(
        "of each arm's road; by default its own in the intersection, or else `speed_limit`",
        "m/s", default=(),
    )  # fmt: skip
    inflow: Inflow | None = part(
        "expected by time of the run; none if it is always `demand`", Inflow,
        optional=True, default=None,
    )  # fmt: skip
    channel: Channel = part(
        "what messages between vehicles and a controller go through", Channel, default=Channel()
    )

    @property
    def vehicle(self) -> VehicleType:
        """The vehicles' type; of several, one that is in every respect as bad as the worst."""
        return self.fleet.worst

    @property
    def types(self) -> tuple[VehicleType, ...]:
        """The vehicles' types; `Observed.type` is an index into them."""
        return self.fleet.types

    @property
    def looks_out(self) -> bool:
        """Whether vehicles give way to those crossing inside the junction.

        Only on SUMO's own ways, since its table of foes goes with them.
        """
        return self.vehicle.looks_out and self.intersection.ways is not None

    def __post_init__(self) -> None:
        if len(self.demand) != self.intersection.n or min(self.demand) < 0:
            wanted = f"{self.intersection.n} numbers ≥ 0 [veh/h]"
            raise InputError(f"demand must be {wanted}, got {self.demand}")
        if self.inflow is not None and len(self.inflow.rates[0]) != self.intersection.n:
            raise InputError(f"inflow must have {self.intersection.n} lanes, got {self.inflow}")
        self._set_limits()
        if self.intersection.roads is not None and self.vehicle.sumo is not None:
            raise InputError(
                "vehicles that keep to SUMO's rules drive on roads that are all alike; leave out "
                "roads, or take another profile, such as fair"
            )
        self.fleet.check(self.intersection.n)
        room = self.intersection.shortest_approach
        if (needed := self.vehicle.length + self.vehicle.margin) >= room:
            more = f"more than {self.intersection.junction_radius + needed:g}"
            raise InputError(
                f"no vehicle of {self.vehicle.length:g} m can be inserted on an approach lane of "
                f"{room:g} m; {self.intersection.too_short(more)}"
            )
        if entry_room(self.intersection, self.fleet) <= 0.0:
            tight = [it for it in self.types if entry_room(self.intersection, it) <= 0.0]
            it = tight[0] if tight else self.vehicle
            widths = " … ".join(f"{it:g}" for it in sorted(set(self.intersection.lane_widths)))
            raise InputError(
                f"vehicles of {it.length:g} × {it.width:g} m ({it.name}) do not fit lanes of "
                f"{widths} m here: turning into an exit lane, one would "
                "touch another that waits beside it; a larger lane_width or junction_radius helps"
            )

    def limit(self, arm: int) -> float:
        """The limit of an arm's road [m/s], before the junction and after it."""
        return self.limits[arm] if self.limits else self.speed_limit

    def _set_limits(self) -> None:
        roads, n = self.intersection.roads or (), self.intersection.n
        if not self.limits and any(road.speed_limit for road in roads):
            limits = tuple(road.speed_limit or self.speed_limit for road in roads)
            object.__setattr__(self, "limits", limits)
            object.__setattr__(self, "speed_limit", max(limits))
        if self.limits and len(self.limits) != n:
            raise InputError(f"limits must be one per arm, {n} numbers, got {self.limits}")
        for limit in self.limits:
            number("limits [m/s]", limit, above=0, high=self.speed_limit)

    def with_seed(self, seed: int) -> Site:
        """The same site in a run with another seed; only the seed is checked."""
        return self._with("seed", integer("seed", seed, low=0))

    def with_channel(self, channel: Channel) -> Site:
        """The same site with messages through this channel."""
        return self._with("channel", channel)

    def _with(self, name: str, value: object) -> Site:
        twin = copy(self)
        object.__setattr__(twin, name, value)
        return twin

    def expected(self, start: float, end: float) -> tuple[float, ...]:
        """Expected inflow of each lane from `start` to `end` of the run [s], in veh/h."""
        return self.demand if self.inflow is None else self.inflow.mean(start, end)

    def period(self, name: str, seconds: float) -> float:
        """The time between two wake-ups [s]; raises `InputError` if it is below the host's step."""
        return number(f"{name} [s], in steps of the host,", seconds, low=self.dt)

    @cached_property
    def conflicts(self) -> Bools:
        """Whether two movements from different arms must not be driven at once, shape (m, m)."""
        return conflicts(self.intersection, self.fleet) & self.intersection.movements.apart


def _fleet(value: object) -> Fleet:
    """A fleet, or the only type that drives, as a fleet."""
    if isinstance(value, VehicleType):
        return Fleet((value,))
    instance("fleet", value, Fleet)
    return cast(Fleet, value)


class Observed(NamedTuple):
    """One vehicle in a view.

    Draw random traits of a vehicle by its lane and rank: its id depends on other lanes.
    """

    id: int  # the same in every view of a run
    lane: int  # index of its approach lane
    manoeuvre: int  # 1 … n−1
    distance: float  # from its front bumper to the junction entry [m]; negative inside
    speed: float  # [m/s]
    length: float  # [m]
    demand_time: float = 0.0  # when it wanted to enter the road [s]
    rank: int = 0  # its place among the vehicles of its lane, from 0
    speed_factor: float = 1.0  # its driver's factor on the speed limit
    type: int = 0  # index of its type in `Site.types`; all can see whether it is a bus

    @property
    def movement(self) -> Movement:
        """Origin and manoeuvre."""
        return Movement(self.lane, self.manoeuvre)


def stopping_distance(speed: float, deceleration: float) -> float:
    """Distance to standstill at constant braking, v²/2b [m]."""
    return speed * speed / (2.0 * deceleration)


def can_stop(vehicle: Observed, deceleration: float) -> bool:
    """Whether comfortable braking still stops the vehicle before the junction.

    Only position and speed count, so every observer comes to the same answer.
    """
    speed, distance = vehicle.speed, vehicle.distance
    if speed == 0.0:
        return distance >= 0.0
    return speed * speed / (2.0 * deceleration) + COMMIT_MARGIN <= distance


class Report(NamedTuple):
    """The latest message from a vehicle."""

    time: float  # when it was sent [s]
    holds: bool  # whether the vehicle then had the right of way
    follows: bool = True  # whether it then followed all that it has been told, but for promises


#: If no message fails.
NO_REPORTS: Mapping[int, Report] = MappingProxyType({})


class View(NamedTuple):
    """What the session is shown at a wake-up.

    It has every vehicle from `Plan.sight` before the junction until its rear bumper has left it
    and its front is `Plan.reach` past the entry.

    If messages fail (`minisim.link`), it has what they told: a vehicle is where it was when it sent
    the latest, and stays until one says that it has left.
    """

    time: float  # [s]
    vehicles: tuple[Observed, ...]  # by lane, then front to back
    reports: Mapping[int, Report] = NO_REPORTS  # by vehicle; empty if no message fails


@dataclass(frozen=True, slots=True)
class Go:
    """Give one vehicle the right of way: its hold line no longer holds it."""

    vehicle: int


@dataclass(frozen=True, slots=True)
class Reserve(Go):
    """Give one vehicle the right of way from `time` on, as long as it keeps to a passage.

    For sessions whose messages fail (`minisim.link`); a host by itself takes it for a `Go`. It is
    void if it arrives later than `time`, and no `Hold` takes it back. Advice does not count from
    `time` on. The vehicle gives the passage up by itself, and keeps to its last advice again, once
    `keeps(vehicle, time)` is false, if it can still stop.
    """

    time: float  # [s]
    keeps: Callable[[Observed, float], bool]


@dataclass(frozen=True, slots=True)
class Hold:
    """Take away one vehicle's right of way: it stops at its hold line.

    If it is too late for comfortable braking, the vehicle stops before the junction if its brakes
    can; inside the junction, a hold has no effect.
    """

    vehicle: int


@dataclass(frozen=True, slots=True)
class Open:
    """Give a whole lane the right of way (a green signal).

    `amber` says that it is about to end. Only a `CruiseVehicle` that `obeys` heeds it.
    """

    lane: int
    amber: bool = False


@dataclass(frozen=True, slots=True)
class Close:
    """Take a lane's right of way back; vehicles with a `Go` of their own keep theirs."""

    lane: int


@dataclass(frozen=True, slots=True)
class Advise:
    """Cap one vehicle's speed at `speed` [m/s] until advised again; infinity lifts the cap."""

    vehicle: int
    speed: float


@dataclass(frozen=True, slots=True)
class Brake:
    """Make one vehicle brake at `deceleration` [m/s²] or harder until told otherwise; 0 lifts this.

    It acts everywhere, even inside the junction, within what the brakes can do. A standing vehicle
    stays put. It ends when the vehicle leaves the view for good: no session could lift it then.
    """

    vehicle: int
    deceleration: float


@dataclass(frozen=True, slots=True)
class Wake:
    """Wake the session at `time` [s] (once; a later `Wake` replaces an earlier one)."""

    time: float


Command = Go | Hold | Open | Close | Advise | Brake | Wake


@declared
class Marking:
    """A stretch of approach lane, from `start` down to `end` metres before the junction entry."""

    name: str = text(
        'shown in figures ("red", "yellow", "green" are drawn in their colour)',
        label="name of a marking",
    )
    start: float = real("before the junction entry", "m", label="start of a marking")
    end: float = real("before the junction entry", "m", low=0, label="end of a marking")
    speed: float | None = real(
        "limit on it; a vehicle slows for it ahead of `start`", "m/s",
        default=None, above=0, high=100, optional=True, label="speed of a marking",
    )  # fmt: skip

    def __post_init__(self) -> None:
        number(f"start of marking {self.name} [m]", self.start, above=self.end)


def _markings(title: str, value: tuple[Marking, ...]) -> tuple[Marking, ...]:
    instance(title, value, tuple)
    for marking in value:
        instance("marking", marking, Marking)
    return value


@declared(kw_only=True)
class Plan:
    """What a session needs from its host."""

    hold_distance: float = real(
        "of the hold line from the junction entry", "m", default=0.0, low=0, high=1000
    )
    markings: tuple[Marking, ...] = checked("on every lane", _markings, "markings", default=())
    marks: Reals[tuple[float, ...]] = reals(
        "wake when a front bumper passes one of these distances before the junction entry; 0 is "
        "the entry itself, negative is past it",
        "m", default=(), low=-1000,
    )  # fmt: skip
    wake_on_clear: Switch = switch("wake when a rear bumper leaves the junction", default=False)
    wake_when_empty: Switch = switch(
        "marks and vehicles that leave wake only while no vehicle is inside the junction",
        default=False,
    )  # fmt: skip
    period: float | None = real(
        "wake at this interval, at least the step", "s", default=None, above=0, optional=True
    )
    sight: float = real(
        "how far before the junction entry a view reaches, on the road", "m", default=50.0, low=0
    )
    reach: float = real(
        "a view keeps a vehicle until its front is this far past the junction entry, even after "
        "its rear has left the junction",
        "m", default=0.0, low=0,
    )  # fmt: skip
    lanes_open: Switch = switch("lanes start open; otherwise vehicles are held", default=False)


_P = TypeVar("_P")


def keeps(value: object, protocol: Callable[..., _P]) -> TypeGuard[_P]:
    """Whether a value has all that a protocol of this module asks: `isinstance`, but faster."""
    methods, others = _members(protocol)
    return all(getattr(value, name, None) is not None for name in methods) and all(
        hasattr(value, name) for name in others
    )


@cache
def _members(protocol: Any) -> tuple[list[str], list[str]]:
    """The methods of a protocol and its other members, with those of its parents."""
    kinds = [kind for kind in protocol.__mro__ if kind.__module__ == __name__]
    each = {name: it for kind in kinds for name, it in vars(kind).items() if name[0] != "_"}
    methods = [name for name, it in each.items() if callable(it)]
    return methods, [name for name in each if name not in methods]


@runtime_checkable
class Session(Protocol):
    """One run's side of a controller: it may remember things."""

    @property
    def plan(self) -> Plan:
        """What it needs from its host; read once, after `start`."""

    def decide(self, view: View) -> Iterable[Command]:
        """Answer a view with commands; all are collected before any is carried out.

        Called once at time 0, then at every wake-up.
        """


@runtime_checkable
class Counting(Session, Protocol):
    """A session that counts something for the summary of its run."""

    @property
    def counts(self) -> Mapping[str, float]:
        """Name -> count so far, which only grows; no name may clash with a summary's own."""


@runtime_checkable
class Kinds(Session, Protocol):
    """A session whose vehicles are of several kinds, by which summaries group them."""

    def kind(self, lane: int, rank: int) -> str:
        """Kind of a vehicle, such as "human", by its lane and its place there."""


@dataclass(frozen=True)
class Cover:
    """The vehicles for which a controller promises that none collides and each is served."""

    laws: tuple[str, ...] = tuple(name for name in MODELS if name != "cc")  # of car following
    alike: bool = False  # whether their drivers must be alike: a `speed_deviation` of 0

    def __contains__(self, vehicle: VehicleType) -> bool:
        return vehicle.model in self.laws and not (self.alike and vehicle.speed_deviation > 0.0)

    def __str__(self) -> str:
        laws = f"vehicles of the models {', '.join(self.laws)}" if self.laws else "no vehicles"
        return laws + (" whose drivers are alike (speed_deviation 0)" if self.alike else "")

    def check(self, name: str, vehicle: VehicleType) -> None:
        """Raise `InputError` for a vehicle that the controller `name` does not cover."""
        if vehicle not in self:
            given = f"{vehicle.model!r} with a speed_deviation of {vehicle.speed_deviation:g}"
            raise InputError(f"{name} is for {self}, got model {given}")


#: What a controller covers by default, and what one that may collide covers.
ORDINARY, NOTHING = Cover(), Cover(laws=())


def cover_of(controller: object) -> Cover:
    """What a controller, or its class, covers: its attribute `covers`, if it has one."""
    covers: Cover = getattr(controller, "covers", ORDINARY)
    return covers


@declared
class Radio:
    """The messages that vehicles and a controller send each other.

    If none fails, a vehicle sends one for each view that shows it, and a controller one for each
    command to a vehicle. If some fail, `minisim.link` says who sends what.
    """

    # The smaller and more frequent of the two messages by which 3GPP compares radio links between
    # vehicles (TR 36.885, release 14, annex A.1.5, periodic traffic).
    state: int = whole("where a vehicle is and how fast, in bytes", default=190, low=1)
    command: int = whole("what it shall do, in bytes", default=190, low=1)
    # There, too: 10 messages per second, the most for which 3GPP TS 22.185 asks.
    interval: float = real(
        "from a message to the next one, if messages fail", "s", low=0.01, high=10, default=0.1
    )


@runtime_checkable
class Controller(Protocol):
    """A recipe for sessions: hashable, picklable, never changed by a run.

    It promises that no `ORDINARY` vehicles collide and that each is served. A controller that
    promises less or more has an attribute `covers`, a `Cover`. One that vehicles talk to has an
    attribute `radio`, a `Radio`; without it, nothing is sent. One that shows lights, but need not
    open lanes, has an attribute `lights` of True, so that its junction counts as signalised.
    """

    @property
    def name(self) -> str:
        """What rows, figures and messages call it."""

    def start(self, site: Site) -> Session:
        """Begin a run. Raises `InputError` for a site that it cannot serve."""


def as_controller(what: str, value: object) -> Controller:
    """Return `value` if it is a controller; `what` names it in the `InputError` if not."""
    try:
        if keeps(value, Controller) and not isinstance(value, type):
            printable(f"the name of {what}", value.name)
            return value
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # a caller's code may raise anything
        raise InputError(f"{what} has no name: {told(error)}") from error
    lacks = [part for part in ("name", "start") if not hasattr(value, part)]
    why = f"it has no {' and no '.join(lacks)}" if lacks else "it is a class"
    named = isinstance(value, str | Mapping)
    hint = "; make it with scenarios.controllers.controller_named" if named else ""
    raise InputError(f"{what} is not a controller: {why}{hint}")


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
