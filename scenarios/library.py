"""Ready-made scenarios: the paper's three junctions, regular ones, and any bearings.

All take the same keywords, `Options`, and call `from_bearings`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Literal, TypedDict, TypeVar, Unpack

from minisim.arrivals import Arrivals, Demand
from minisim.errors import InputError, choice, instance, integer, nearest, numbers, show
from minisim.fleet import PCU, Fleet, fleet_named, mean_pcu
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES
from minisim.junction.paths import Way
from minisim.junction.roads import Road
from minisim.vehicle import VehicleType
from scenarios.profiles import PUBLISHED_PROFILES, Profile, profile_named
from scenarios.published import PUBLISHED_ARMS, published_ways
from scenarios.scenario import Scenario

Side = Literal["left", "right"]

#: Number of arms -> distance of the entries from the centre in the authors' networks [m]. The first
#: two are our own, but rounded by netconvert, and 3 mm change when a vehicle enters a zone.
PUBLISHED_RADII = {3: 4.16, 4: 7.2, 5: 8.4}


class Options(TypedDict, total=False):
    """Keywords of every scenario, as `Intersection`, `Demand` and `Scenario` take them.

    A profile may be a name, a fleet as for `minisim.fleet.fleet_named`, and shares (`split`,
    `turns`) numbers or a text such as "4:3:2:1". `unit` is that of the density: "veh", or passenger
    car units (`minisim.fleet.PCU`).
    """

    name: str
    side: Side
    lane_width: float
    junction_radius: float
    arm_length: float
    ways: tuple[Way, ...] | None
    roads: Sequence[Road] | Mapping[str, Any] | None
    forbidden: Sequence[str]
    split: str | Sequence[float] | None
    turns: str | Sequence[float] | None
    model: str
    min_headway: float
    profile: str | Profile
    unit: str
    fleet: Fleet | VehicleType | Mapping[str, float | Sequence[float]] | str | None
    horizon: float
    warmup: float
    recorded: Arrivals | None


#: Mean inflow per lane by default [veh/h].
DENSITY = 350.0

#: The unit of a density that counts vehicles.
VEHICLES = "veh"

#: Keywords that recorded arrivals replace.
DRAWN = ("density", "split", "turns", "model", "min_headway", "unit")

_PARTS = (Intersection, Demand, Scenario)

_Maker = TypeVar("_Maker", bound=Callable[..., Scenario])


def _shown(make: _Maker) -> _Maker:
    """Give `make` a signature in which help and completion see `Options` and their defaults."""
    defaults = {f.name: f.default for kind in _PARTS for f in fields(kind)}
    defaults |= {"name": None, "unit": VEHICLES}
    *own, _ = inspect.signature(make).parameters.values()  # the last is `options`
    options = [
        inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=defaults[key])
        for key in Options.__annotations__
    ]
    # mypy does not know that functions take this attribute, which `inspect.signature` reads.
    make.__signature__ = inspect.Signature([*own, *options])  # type: ignore[attr-defined]
    return make


@_shown
def three_way(density: float | None = None, **options: Unpack[Options]) -> Scenario:
    """The paper's Y junction: arms at 0°, 120° and 240°."""
    return _regular("three-way", 3, density, options)


@_shown
def four_way(density: float | None = None, **options: Unpack[Options]) -> Scenario:
    """The paper's 4-arm junction: a north, b east, c south, d west."""
    return _regular("four-way", 4, density, options)


@_shown
def five_way(density: float | None = None, **options: Unpack[Options]) -> Scenario:
    """The paper's 5-arm junction, with the junction radius of the authors' network."""
    return _regular("five-way", 5, density, {"junction_radius": PUBLISHED_RADII[5], **options})


#: Arms -> the paper's junction.
MAKERS: dict[int, Callable[..., Scenario]] = {3: three_way, 4: four_way, 5: five_way}


@_shown
def regular(n: int, density: float | None = None, **options: Unpack[Options]) -> Scenario:
    """A junction of n arms at equal angles (3 ≤ n ≤ 12)."""
    count = integer("number of arms", n, low=3, high=12)
    return _regular(f"{count}-way", count, density, options)


@_shown
def from_bearings(
    bearings: Sequence[float], density: float | None = None, **options: Unpack[Options]
) -> Scenario:
    """A junction with arms at these bearings [degrees clockwise from north].

    `InputError` for an unknown keyword (with the nearest one), arms closer than 30°, an unknown
    profile, impossible demand, a demand beside recorded arrivals, or a horizon ≤ 0. `roads` may be
    a mapping of arms to roads, such as `{"b": Road(traffic="in")}`; the others are as usual.
    """
    given: dict[str, Any] = {"name": "custom", **options}
    for key in given:
        choice("keyword of a scenario", key, ("density", *Options.__annotations__))
    if density is not None:
        given["density"] = density
    clash = [key for key in DRAWN if key in given]
    if given.get("recorded") is not None and clash:
        raise InputError(f"recorded replaces {', '.join(clash)}; give one or the other")
    if "min_headway" in given and given.get("model") != "shifted":
        raise InputError("min_headway needs the model 'shifted'")
    profile = given["profile"] = profile_named(given.get("profile", "paper"))
    if given.get("fleet") is not None:
        given["fleet"] = fleet_named(given["fleet"], profile.vehicle)
    unit = choice("unit", given.pop("unit", VEHICLES), (VEHICLES, *PCU))
    bearings = numbers("bearings", bearings)
    if isinstance(given.get("roads"), Mapping):
        given["roads"] = _roads(given["roads"], len(bearings))
    geometry, demand, rest = (
        {field.name: given[field.name] for field in fields(kind) if field.name in given}
        for kind in _PARTS
    )
    made = Scenario(
        intersection=Intersection(bearings=bearings, **geometry),
        demand=Demand(**{"density": DENSITY, **demand}),
        **rest,
    )
    return made if unit == VEHICLES else _in_vehicles(made, unit)


def _in_vehicles(scenario: Scenario, unit: str) -> Scenario:
    """The same scenario, with an inflow that was given in passenger car units as vehicles."""
    if scenario.fleet is None:
        raise InputError(f"unit {unit!r} needs a fleet, such as car:0.8,bus:0.2")
    n = scenario.intersection.n
    means = mean_pcu(scenario.fleet, unit, n)
    rates = [rate / mean for rate, mean in zip(scenario.demand.rates(n), means, strict=True)]
    split = scenario.demand.split if len(set(means)) == 1 else tuple(rates)
    return replace(scenario, demand=replace(scenario.demand, density=sum(rates) / n, split=split))


def scenario_named(name: str, bearings: Sequence[float] | None = None, **options: Any) -> Scenario:
    """The scenario of a command-line name: three-way, four-way, five-way, N-way or custom.

    `InputError` for an unknown name (with the nearest one), or only one of `custom` and bearings.
    """
    instance("scenario", name, str)
    if name == "custom":
        if bearings is None:
            raise InputError("scenario 'custom' needs bearings, such as 0,80,190,260")
        return from_bearings(bearings, **options)
    if bearings is not None:
        raise InputError(f"bearings go with the scenario 'custom', not with {name!r}")
    makers = {"three-way": three_way, "four-way": four_way, "five-way": five_way}
    if name in makers:
        return makers[name](**options)
    if count := re.fullmatch("([0-9]{1,3})-way", name):
        return regular(int(count[1]), **options)
    counts = [f"{n}-way" for n in range(3, 13) if str(n) in re.findall("[0-9]+", name)]
    near = nearest(counts[0] if counts else name, [*counts, *makers, "custom"])
    raise InputError(
        f"unknown scenario {show(name)}; allowed: {', '.join(makers)}, N-way (such as 6-way), "
        f"custom{near}"
    )


def _roads(given: Mapping[str, Any], n: int) -> tuple[Any, ...]:
    for arm in given:
        choice("arm in roads", arm, ARM_NAMES[:n])
    return tuple(given.get(arm, Road()) for arm in ARM_NAMES[:n])


def _regular(name: str, n: int, density: float | None, options: Mapping[str, Any]) -> Scenario:
    profile = profile_named(options.get("profile", "paper"))
    if profile in PUBLISHED_PROFILES and _is_published(n, options):
        options = {"ways": published_ways(n), "junction_radius": PUBLISHED_RADII[n], **options}
    bearings = [360.0 * i / n for i in range(n)]
    return from_bearings(bearings, density, **{"name": name, **options})


def _is_published(n: int, options: Mapping[str, Any]) -> bool:
    """Whether the junction has the arms, side and measures of one of the paper's."""
    radius = options.get("junction_radius")
    return (
        n in PUBLISHED_ARMS
        and options.get("side", "left") == "left"
        and not {"lane_width", "arm_length", "roads", "forbidden"} & set(options)
        and radius == (PUBLISHED_RADII[5] if n == 5 else None)
    )
