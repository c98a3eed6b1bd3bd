"""Ready-made scenarios: the paper's three junctions, regular ones, any bearings, and files.

All take the same keywords, `Options`; those from files leave out the geometry's.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any, Literal, TypedDict, TypeVar, Unpack

from minisim.arrivals import Arrivals
from minisim.demand import Demand, DemandProfile
from minisim.errors import InputError, choice, instance, integer, nearest, numbers, show
from minisim.files import AnyPath
from minisim.fleet import Fleet, fleet_named
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES
from minisim.junction.paths import Way
from minisim.junction.roads import Road
from minisim.pcu import UNITS, mean_pcu
from minisim.recorded import read_arrivals
from minisim.shares import Turns
from minisim.vehicle import VehicleType
from scenarios.junctions import is_junction_file, junction_from
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
    car units (`minisim.pcu.UNITS`). A `demand` by time of day replaces all that says how many
    vehicles come; a run of it lasts until its end, unless there is a `horizon`.
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
    turns: Turns
    model: str
    min_headway: float
    profile: str | Profile
    unit: str
    fleet: Fleet | VehicleType | Mapping[str, float | Sequence[float]] | str | None
    horizon: float
    demand_time: float | None
    warmup: float
    recorded: Arrivals | None
    demand: DemandProfile


#: Mean inflow per lane by default [veh/h].
DENSITY = 350.0

#: The unit of a density that counts vehicles.
VEHICLES = "veh"

#: Keywords that recorded arrivals replace, and a demand by time of day.
DRAWN = ("density", "split", "turns", "model", "min_headway", "unit")

_PARTS = (Intersection, Demand, Scenario)

#: Keywords of the geometry.
GEOMETRY = tuple(it.name for it in fields(Intersection) if it.name in Options.__annotations__)

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
    geometry = {key: given.pop(key) for key in GEOMETRY if key in given}
    places = numbers("bearings", bearings)
    if isinstance(geometry.get("roads"), Mapping):
        geometry["roads"] = _roads(geometry["roads"], len(places))
    return _scenario(partial(Intersection, places, **geometry), density, given)


@_shown
def from_file(
    path: AnyPath, density: float | None = None, node: str | None = None,
    **options: Unpack[Options],
) -> Scenario:  # fmt: skip
    """A junction from a file: a node of a town's network, or a table in TOML.

    `InputError` as `from_bearings`, or for a keyword of the geometry, which the file gives (only an
    extract of OpenStreetMap needs a side); and what `junction_from` raises.
    """
    given: dict[str, Any] = dict(options)
    side = given.pop("side", None)
    for key in GEOMETRY:
        if key in given:
            raise InputError(f"{key} needs bearings; {path} has the whole junction")
    name, intersection = junction_from(path, node, side)
    return _scenario(lambda: intersection, density, {"name": name, **given})


def _scenario(
    junction: Callable[[], Intersection], density: float | None, given: dict[str, Any]
) -> Scenario:
    """A scenario from keywords that are not the geometry's."""
    for key in given:
        choice("keyword of a scenario", key, ("density", *Options.__annotations__))
    if density is not None:
        given["density"] = density
    for whole in ("recorded", "demand"):
        if given.get(whole) is not None:
            refuse_beside(whole, (key for key in ("demand", *DRAWN) if key in given))
    day = given.pop("demand", None)
    model = given.get("model", "")
    if "min_headway" in given and isinstance(model, str) and model != "shifted":
        raise InputError("min_headway needs the model 'shifted'")
    profile = given["profile"] = profile_named(given.get("profile", "paper"))
    if given.get("fleet") is not None:
        given["fleet"] = fleet_named(given["fleet"], profile.vehicle)
    unit = choice("unit", given.pop("unit", VEHICLES), (VEHICLES, *UNITS))
    demand, rest = (
        {field.name: given[field.name] for field in fields(kind) if field.name in given}
        for kind in (Demand, Scenario)
    )
    if day is not None:
        instance("demand", day, DemandProfile)
        rest = {"horizon": day.duration, **rest}
    made = Scenario(
        intersection=junction(),
        demand=day or Demand(**{"density": DENSITY, **demand}),
        **rest,
    )
    return made if unit == VEHICLES else _in_vehicles(made, unit)


def _in_vehicles(scenario: Scenario, unit: str) -> Scenario:
    """The same scenario, with an inflow that was given in passenger car units as vehicles."""
    demand = scenario.demand
    if scenario.fleet is None:
        raise InputError(f"unit {unit!r} needs a fleet, such as car:0.8,bus:0.2")
    assert isinstance(demand, Demand)  # a demand by time of day replaces the unit
    means = mean_pcu(scenario.fleet, unit, scenario.intersection.n)
    rates = [rate / mean for rate, mean in zip(scenario.rates, means, strict=True)]
    split = demand.split if len(set(means)) == 1 else tuple(rates)
    density = sum(rates) / len(scenario.intersection.approaches)
    return replace(scenario, demand=replace(demand, density=density, split=split))


def replayed(scenario: Scenario, path: AnyPath, start: float | str | None = None) -> Scenario:
    """The scenario, with the arrivals of a file in place of its demand.

    `start` is as in `minisim.recorded.read_arrivals`. Raises what that raises, and `InputError` for
    arrivals that the scenario cannot replay; every message names the file.
    """
    arrivals = read_arrivals(path, scenario.intersection.n, start or 0.0)
    try:
        return replace(scenario, recorded=arrivals)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def refuse_beside(whole: str, others: Iterable[str]) -> None:
    """Raise `InputError` for other options beside one that replaces them."""
    if clash := [other for other in others if other != whole]:
        raise InputError(f"{whole} replaces {', '.join(clash)}; give one or the other")


def scenario_named(
    name: str, bearings: Sequence[float] | None = None, node: str | None = None, **options: Any
) -> Scenario:
    """The scenario of a command-line name: three-way, four-way, five-way, N-way, custom or a file.

    `InputError` for an unknown name (with the nearest one), only one of `custom` and bearings, or a
    node without a file; and what `from_file` raises.
    """
    instance("scenario", name, str)
    if is_junction_file(name):
        if bearings is not None:
            raise InputError(f"bearings need the scenario 'custom', not the file {name}")
        return from_file(name, node=node, **options)
    if node is not None:
        raise InputError(f"node needs a town's network, such as town.net.xml, not {name!r}")
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
        f"custom, or a file such as junction.toml{near}"
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
