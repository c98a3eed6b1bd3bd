"""What is simulated: a junction, its demand and a profile."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

from minisim.arrivals import Arrivals
from minisim.clock import clock
from minisim.control import Site
from minisim.demand import Demand, DemandProfile
from minisim.errors import InputError, choice, number
from minisim.fleet import TYPES, Fleet, driven_like
from minisim.junction.geometry import Intersection
from minisim.parameters import declared, part, real, text
from scenarios.profiles import PAPER, Profile


@declared(kw_only=True)
class Scenario:
    """A junction, its demand and a profile: everything in a run except its controller and seed."""

    name: str = text('such as "four-way"', label="scenario name")
    intersection: Intersection = part("the geometry", Intersection)
    demand: Demand | DemandProfile = part("what to draw arrivals from", (Demand, DemandProfile))
    profile: Profile = part("vehicle, speeds and step", Profile, default=PAPER)
    fleet: Fleet | None = part(
        "the vehicles' types; none is those of the demand, or else the profile's vehicle",
        Fleet,
        optional=True,
        default=None,
    )
    horizon: float = real("simulated time", "s", above=0, high=1e7, default=3600.0)
    demand_time: float | None = real(
        "vehicles come until then; none means until the horizon", "s",
        above=0, optional=True, default=None,
    )  # fmt: skip
    warmup: float = real(
        "trips demanded, close calls and counts before it are left out; only "
        "collisions always count", "s", low=0, default=0.0,
    )  # fmt: skip
    recorded: Arrivals | None = part(
        "an arrival table to replay instead of drawing one", Arrivals, optional=True, default=None
    )

    def __post_init__(self) -> None:
        number("warmup [s]", self.warmup, below=self.horizon)
        if self.demand_time is not None:
            number("demand_time [s]", self.demand_time, high=self.horizon)
        n = self.intersection.n
        allowed = self.intersection.allowed_by_lane
        self.demand.check(n, self.until, allowed)
        self.vehicles.check(n)
        if self.recorded is not None:
            self.recorded.check(n, allowed)
            if self.recorded.type is not None:
                self._check_types(self.recorded.type)
            if len(self.recorded) and (first := self.recorded.time[0]) >= self.until:
                told = f"the {'horizon' if self.demand_time is None else 'demand time'} of "
                told += f"{self.until:g} s"
                if origin := self.recorded.origin:
                    told += f" from {clock(origin)} on"
                raise InputError(
                    f"no vehicle comes within {told}: the first recorded arrival is at "
                    f"{clock(origin + first)}; `start` says where in the table a run begins"
                )

    def _check_types(self, types: Iterable[str]) -> None:
        """Raise `InputError` for recorded types that are not in the fleet."""
        for name in sorted(set(map(str, types)) - set(self.vehicles.names)):
            if self.fleet is None:
                known = choice("vehicle type of the arrivals:", name, TYPES)
                raise InputError(
                    f"the arrivals have the vehicle type {known!r}, but the profile "
                    f"{self.profile.name} drives {self.vehicles.names[0]} alone; a fleet with all "
                    f"their types is needed, such as car:0.9,{known}:0.1"
                )
            choice("vehicle type of the arrivals:", name, self.vehicles.names)

    @property
    def vehicles(self) -> Fleet:
        """The fleet, or else the demand's, or else the profile's vehicle as one."""
        if self.fleet is not None:
            return self.fleet
        if self.recorded is None and isinstance(self.demand, DemandProfile) and self.demand.fleet:
            return driven_like(self.demand.fleet, self.profile.vehicle)
        return Fleet((self.profile.vehicle,))

    @property
    def replaced(self) -> str:
        """A sentence if the fleet replaces the one that the demand brings, or else empty."""
        theirs = getattr(self.demand, "fleet", None)
        if self.fleet is None or theirs is None:
            return ""
        return f"the fleet {self.fleet} replaces that of the demand {self.demand.words[0]!r}"

    @property
    def until(self) -> float:
        """Vehicles come until then [s]."""
        return self.horizon if self.demand_time is None else self.demand_time

    @property
    def profile_name(self) -> str:
        """The name of its profile."""
        return self.profile.name

    @property
    def depart_speed(self) -> float | None:
        """Highest speed at insertion [m/s]; None means the highest safe one."""
        return self.profile.depart_speed

    @property
    def density(self) -> float:
        """Mean inflow per lane [veh/h], as demanded or as recorded."""
        if self.recorded is None and isinstance(self.demand, Demand):
            return self.demand.density
        return sum(self.rates) / len(self.intersection.approaches)

    @property
    def rates(self) -> tuple[float, ...]:
        """Mean inflow of each lane [veh/h]."""
        n = self.intersection.n
        if self.recorded is not None:
            return self.recorded.rates(n, self.until)
        return self.demand.inflow(n, self.intersection.allowed_by_lane).mean(0.0, self.until)

    def site(self, seed: int = 0) -> Site:
        """What a controller may know about the scenario."""
        return self._site.with_seed(seed)

    @cached_property
    def _site(self) -> Site:
        junction = self.intersection
        varies = self.recorded is None and isinstance(self.demand, DemandProfile)
        return Site(
            intersection=self.intersection,
            fleet=self.vehicles,
            speed_limit=self.profile.speed_limit,
            demand=self.rates,
            dt=self.profile.dt,
            inflow=self.demand.inflow(junction.n, junction.allowed_by_lane) if varies else None,
        )

    def arrivals(self, seed: int) -> Arrivals:
        """The arrival table for one seed, the same for every controller."""
        if self.recorded is not None:
            return self.recorded.between(0.0, self.until)
        junction = self.intersection
        return self.demand.draw(junction.n, self.until, seed, junction.allowed_by_lane)
