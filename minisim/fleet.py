"""Fleets: vehicle types with their shares, and ready types."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, choice, instance, number, plural, show
from minisim.junction.movements import ARM_NAMES
from minisim.parameters import Takes, checked, declared
from minisim.streams import Draws
from minisim.vehicle import CruiseVehicle, VehicleType

Ints = npt.NDArray[np.int64]

#: Shares may miss 1 by this much, through rounding.
ROUNDING = 1e-6

#: Sizes of vehicles on Indian roads (Chandra, Kumar 2003, Journal of Transportation Engineering
#: 129:155, table 1). What they can do is SUMO's default for the class (page "Vehicle Type Parameter
#: Defaults"), with two exceptions. SUMO's motorcycle could never brake as hard as the IDM asks of
#: a vehicle whose comfortable braking is 10 m/s², so it drives like a car. There is no class for
#: auto-rickshaws: their acceleration is the least of the measured 1.88 … 2.08 m/s² (University of
#: Moratuwa, handle 123/19055), their brakes are those of heavy vehicles.
_INDIAN = (
    VehicleType(name="motorcycle", length=1.87, width=0.64),
    VehicleType(
        name="auto-rickshaw", length=3.2, width=1.4,
        acceleration=1.88, deceleration=4.0, max_deceleration=7.0,
    ),
    VehicleType(name="car", length=3.72, width=1.44),
    VehicleType(name="lcv", length=6.1, width=2.1),
    VehicleType(
        name="bus", length=10.1, width=2.43,
        acceleration=1.2, deceleration=4.0, max_deceleration=7.0,
    ),
    VehicleType(
        name="truck", length=7.5, width=2.35,
        acceleration=1.3, deceleration=4.0, max_deceleration=7.0,
    ),
)  # fmt: skip

#: SUMO's defaults for its vehicle classes, read from SUMO 1.28 itself. Its motorcycle, moped and
#: bicycle are missing: the IDM asks for more than their brakes can do, or they share lanes.
_SUMO = (
    VehicleType(name="sumo-passenger"),
    VehicleType(name="sumo-delivery", length=6.5, width=2.16),
    VehicleType(
        name="sumo-bus", length=12.0, width=2.5,
        acceleration=1.2, deceleration=4.0, max_deceleration=7.0,
    ),
    VehicleType(
        name="sumo-coach", length=14.0, width=2.6,
        acceleration=2.0, deceleration=4.0, max_deceleration=7.0,
    ),
    VehicleType(
        name="sumo-truck", length=7.1, width=2.4,
        acceleration=1.3, deceleration=4.0, max_deceleration=7.0,
    ),
    VehicleType(
        name="sumo-trailer", length=16.5, width=2.55,
        acceleration=1.1, deceleration=4.0, max_deceleration=7.0,
    ),
)  # fmt: skip

#: SUMO's classes count as the types that they stand for.
_ALIKE = {
    "sumo-passenger": "car", "sumo-delivery": "lcv", "sumo-bus": "bus", "sumo-coach": "bus",
    "sumo-truck": "truck", "sumo-trailer": "truck",
}  # fmt: skip

#: Where the rear axle is, as a share of the length from the front bumper: (front overhang +
#: wheelbase) / length of the design vehicles P, SU and CITY-BUS, in feet (AASHTO, A Policy on
#: Geometric Design of Highways and Streets, 2004, exhibit 2-1). Motorcycles and auto-rickshaws are
#: too short to leave their path by a decimetre, and a trailer has a joint.
_REAR_AXLES = {
    "car": (3 + 11) / 19, "lcv": (3 + 11) / 19, "truck": (4 + 20) / 30, "bus": (7 + 25) / 40,
}  # fmt: skip

#: Ends the names of types and mixes whose bodies drag their rear axles.
OFFTRACKING = "-offtracking"


def kind_of(name: str) -> str:
    """What a ready type counts as, such as "bus" for "sumo-coach"; other names stay."""
    plain = name.removesuffix(OFFTRACKING)
    return _ALIKE.get(plain, plain)


def _offtracking(it: VehicleType) -> VehicleType:
    axle = _REAR_AXLES[kind_of(it.name)] * it.length
    return replace(it, name=it.name + OFFTRACKING, rear_axle=round(axle, 2))


_RIGID = tuple(
    it for it in (*_INDIAN, *_SUMO)
    if kind_of(it.name) in _REAR_AXLES and it.name != "sumo-trailer"
)  # fmt: skip

#: The ready types by name.
TYPES: Mapping[str, VehicleType] = {
    it.name: it for it in (*_INDIAN, *_SUMO, *map(_offtracking, _RIGID))
}

_INDIA = {
    "motorcycle": 0.72, "auto-rickshaw": 0.079, "car": 0.133, "truck": 0.055, "bus": 0.013,
}  # fmt: skip

#: Fleets by name. `india` has the shares of the vehicles registered in India on 31 March 2009: 72 %
#: two-wheelers, 13.3 % cars, jeeps and taxis, 5.5 % goods vehicles, 1.3 % buses (Ministry of Road
#: Transport, Road Transport Year Book 2007–09). Goods vehicles are trucks here, and the 7.9 % of
#: other vehicles are auto-rickshaws.
MIXES: Mapping[str, Mapping[str, float]] = {
    "india": _INDIA,
    "india" + OFFTRACKING: {
        name + OFFTRACKING * (name in _REAR_AXLES): share for name, share in _INDIA.items()
    },
}


def _types(title: str, value: Any) -> tuple[VehicleType, ...]:
    types = tuple(value) if isinstance(value, list | tuple) else (value,)
    for it in types:
        instance(title, it, VehicleType)
    if not types:
        raise InputError(f"{title}: a fleet needs at least one type")
    names = [it.name for it in types]
    if again := [name for name in names if names.count(name) > 1]:
        raise InputError(f"{title}: the name {show(again[0])} stands for two types")
    if len(types) > 1 and any(isinstance(it, CruiseVehicle) or it.sumo for it in types):
        raise InputError(f"{title}: vehicles that drive like SUMO's (sumo=…) cannot be mixed")
    if len({it.model for it in types}) > 1:
        raise InputError(f"{title}: all need the same car-following model")
    return types


def _shares(_: str, value: Any) -> tuple[tuple[float, ...], ...]:
    rows = value if isinstance(value, list | tuple) else (value,)
    return tuple(
        tuple(
            number("share of a type", share, low=0, high=1)
            for share in (row if isinstance(row, list | tuple) else (row,))
        )
        for row in rows
    )


@declared
class Fleet:
    """Which types of vehicles drive, and how many of each.

    The type of a vehicle depends only on the seed, its lane and its rank there.
    """

    types: Takes[tuple[VehicleType, ...], VehicleType | Sequence[VehicleType]] = checked(
        "of vehicles", _types, "VehicleTypes of one model"
    )
    shares: Takes[
        tuple[tuple[float, ...], ...], float | Sequence[float | Sequence[float]]
    ] = checked(
        "of each type: a number, or one per lane; they sum to 1", _shares, "numbers 0 … 1",
        default=((1.0,),),
    )  # fmt: skip

    def __post_init__(self) -> None:
        if len(self.shares) != len(self.types):
            raise InputError(
                f"a fleet needs a share per type: it has {plural(len(self.types), 'type')}, got "
                f"{self.shares}"
            )
        counts = {len(row) for row in self.shares}
        if len(counts - {1}) > 1:
            raise InputError(f"shares by lane need a number per lane, got {self.shares}")
        for lane in range(max(counts)):
            row = self.of_lane(lane)
            if abs(sum(row) - 1.0) > ROUNDING:
                where = f" on lane {ARM_NAMES[lane]}" if max(counts) > 1 else ""
                given = ", ".join(
                    f"{it.name}: {x:g}" for it, x in zip(self.types, row, strict=True)
                )
                raise InputError(f"shares{where} must sum to 1, got {sum(row):g} ({given})")

    def of_lane(self, lane: int) -> tuple[float, ...]:
        """The shares of the types on a lane."""
        return tuple(row[min(lane, len(row) - 1)] for row in self.shares)

    def check(self, n: int) -> None:
        """Raise `InputError` for shares by lane unless there are `n` lanes."""
        for row in self.shares:
            if len(row) not in (1, n):
                raise InputError(f"the fleet has shares for {len(row)} lanes, the junction has {n}")

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the types."""
        return tuple(it.name for it in self.types)

    def __str__(self) -> str:
        """As `fleet_named` reads it, such as "car:0.8,bus:0.2"; the name of an only type."""
        if len(self.types) == 1:
            return self.types[0].name
        shares = ("/".join(f"{share:g}" for share in row) for row in self.shares)
        return ",".join(f"{name}:{share}" for name, share in zip(self.names, shares, strict=True))

    @cached_property
    def worst(self) -> VehicleType:
        """A vehicle as bad as the worst of the types in every respect: length, brakes and so on.

        A fleet of one type has that type.
        """
        first, *others = self.types
        if not others:
            return first
        least = ("acceleration", "deceleration", "max_deceleration")
        most = ("length", "width", "headway", "min_gap", "speed_deviation")
        bound = {key: min(getattr(it, key) for it in self.types) for key in least}
        bound |= {key: max(getattr(it, key) for it in self.types) for key in most}
        bound["rear_axle"] = max(it.rear_axle or 0.0 for it in self.types) or None
        return replace(first, name="the worst of the fleet", **bound)

    def drawn(self, lane: Ints, rank: Ints, seed: int) -> Ints:
        """Index of the type of each vehicle, shape (k,), by its lane and its rank there."""
        if len(self.types) == 1:
            return np.zeros(len(lane), int)
        draws, types = Draws(seed, "types"), np.zeros(len(lane), int)
        drawn = np.array(
            [draws.uniform(*of) for of in zip(lane.tolist(), rank.tolist(), strict=True)]
        )
        for i in range(lane.max(initial=0) + 1):
            bounds = np.cumsum(self.of_lane(i))[:-1]  # without the last, which rounding may miss
            types[lane == i] = bounds.searchsorted(drawn[lane == i], side="right")
        return types

    def indices(self, names: npt.NDArray[np.str_]) -> Ints:
        """The indices of named types; `InputError` for a name that is not in the fleet."""
        known = {name: k for k, name in enumerate(self.names)}
        return np.array([known[choice("vehicle type", str(it), known)] for it in names], int)


#: What has `types`: a fleet, or the one type that drives.
Vehicles = Fleet | VehicleType
#: What `fleet_named` reads.
FleetLike = Vehicles | Mapping[str, float | Sequence[float]] | str


def driven_like(fleet: Fleet, base: VehicleType) -> Fleet:
    """The same fleet, whose vehicles follow others by the law of `base`.

    Raises `InputError` if `base` is under cruise control or has SUMO's rules.
    """
    if base.sumo is not None:
        raise InputError(
            "a fleet, given or brought by a demand, needs the profile paper or fair, not one with "
            "SUMO's vehicles"
        )
    return replace(fleet, types=tuple(replace(it, model=base.model) for it in fleet.types))


def fleet_named(value: FleetLike, base: VehicleType) -> Fleet:
    """The fleet that a value means; its vehicles follow others by the law of `base`.

    Args:
        value: a Fleet or VehicleType, kept unchanged; or the shares of `TYPES`, as a table such as
            `{"car": 0.8, "bus": [0.2, 0.2, 0.2, 0.2]}` (one share, or one per lane) or as a text
            such as "car:0.8,bus:0.2", with shares by lane written 0.2/0.1/0.2/0.1; or the name of
            a mix (`MIXES`) or of a type.
        base: its law drives the vehicles of a table or text.

    Raises:
        InputError: an unknown type (with the nearest), shares that do not sum to 1, or a `base`
            under cruise control or with SUMO's rules.
    """
    if isinstance(value, Fleet):
        return value
    if isinstance(value, VehicleType):
        return Fleet((value,))
    wanted = "shares of vehicle types such as car:0.8,bus:0.2"
    if isinstance(value, str) and ":" not in value and not re.fullmatch(r"[\w-]+", value):
        raise InputError(f"fleet must be a mix or type by name, or {wanted}, got {show(value)}")
    if isinstance(value, str) and ":" not in value:
        known = {**MIXES, **{name: {name: 1.0} for name in TYPES}}
        value = known[choice("fleet", value, known)]
    elif isinstance(value, str):
        pairs = [part.rpartition(":") for part in value.split(",")]
        try:
            value = {
                name.strip(): [float(share) for share in row.split("/")] for name, _, row in pairs
            }
        except ValueError:
            raise InputError(f"fleet must be {wanted}, got {show(value)}") from None
        if len(value) < len(pairs):
            raise InputError(f"fleet names a vehicle type twice: {', '.join(p[0] for p in pairs)}")
    if not isinstance(value, Mapping) or not value:
        raise InputError(f"fleet must be {wanted}, got {show(value)}")
    types = tuple(TYPES[choice("vehicle type", name, TYPES)] for name in value)
    return driven_like(Fleet(types, tuple(value.values())), base)
