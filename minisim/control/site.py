"""What a controller may know before the first vehicle arrives."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import cast

from minisim.channel import Channel
from minisim.errors import InputError, instance, integer, number
from minisim.fleet import Fleet
from minisim.inflow import Inflow
from minisim.junction.conflicts import conflicts, entry_room
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Bools
from minisim.parameters import Reals, checked, declared, part, real, reals, whole
from minisim.vehicle import VehicleType

#: Lateral acceleration that turning vehicles accept [m/s²]: netconvert's default of
#: `--junctions.limit-turn-speed`, for turn speeds like SUMO's.
LATERAL_ACCELERATION = 5.5


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
