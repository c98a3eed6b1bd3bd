"""Ready-made scenarios: the paper's three junctions, regular ones, and any bearings.

All take the demand as keywords of `minisim.arrivals.Demand` (density, split, turns, model) and
the profile by name.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Sequence
from typing import Any, Literal

from minisim.arrivals import Arrivals, Demand
from minisim.errors import InputError, instance, integer, numbers, show
from minisim.junction.geometry import Intersection
from minisim.junction.paths import Way
from scenarios.published import PUBLISHED_ARMS, published_ways
from scenarios.scenario import PUBLISHED_PROFILES, Profile, Scenario, profile_named

Side = Literal["left", "right"]

#: Distance of the entries from the centre in the authors' networks, by number of arms [m]: their
#: approach lanes are 495.84, 492.8 and 491.6 m long. The first two follow from the default kerb
#: radius, but netconvert rounds to centimetres; 3 mm shift who passes the edge of a zone when.
PUBLISHED_RADII = {3: 4.16, 4: 7.2, 5: 8.4}


def three_way(density: float = 350.0, **options: Any) -> Scenario:
    """The paper's Y junction: arms at 0°, 120° and 240°."""
    return _regular("three-way", 3, density, options)


def four_way(density: float = 350.0, **options: Any) -> Scenario:
    """The paper's 4-arm junction: a north, b east, c south, d west."""
    return _regular("four-way", 4, density, options)


def five_way(density: float = 350.0, **options: Any) -> Scenario:
    """The paper's 5-arm junction, with the junction radius of the authors' network."""
    return _regular("five-way", 5, density, {"junction_radius": PUBLISHED_RADII[5], **options})


#: Arms -> the paper's junction.
MAKERS: dict[int, Callable[..., Scenario]] = {3: three_way, 4: four_way, 5: five_way}


def regular(n: int, density: float = 350.0, **options: Any) -> Scenario:
    """A junction of n arms at equal angles (3 ≤ n ≤ 12)."""
    count = integer("number of arms", n, low=3, high=12)
    return _regular(f"{count}-way", count, density, options)


def from_bearings(
    bearings: Sequence[float],
    density: float = 350.0,
    *,
    name: str = "custom",
    side: Side = "left",
    lane_width: float = 3.2,
    junction_radius: float = math.nan,
    arm_length: float = 500.0,
    ways: tuple[Way, ...] | None = None,
    split: Sequence[float] | None = None,
    turns: Sequence[float] | None = None,
    model: str = "poisson",
    min_headway: float = 1.5,
    profile: str | Profile = "paper",
    horizon: float = 3600.0,
    recorded: Arrivals | None = None,
) -> Scenario:
    """A junction with arms at these bearings [degrees clockwise from north].

    Every other scenario of this module is this one with given bearings, and takes the same
    keywords.

    Raises:
        InputError: arms closer than 30°, an unknown profile, impossible demand, horizon ≤ 0.
    """
    return Scenario(
        name=name,
        intersection=Intersection(
            bearings=numbers("bearings", bearings),
            side=side,
            lane_width=lane_width,
            junction_radius=junction_radius,
            arm_length=arm_length,
            ways=ways,
        ),
        demand=Demand(
            density=density,
            split=None if split is None else numbers("split", split),
            turns=None if turns is None else numbers("turns", turns),
            model=model,
            min_headway=min_headway,
        ),
        profile=profile_named(profile),
        horizon=horizon,
        recorded=recorded,
    )


def scenario_named(name: str, bearings: Sequence[float] | None = None, **options: Any) -> Scenario:
    """The scenario of a command-line name: three-way, four-way, five-way, N-way or custom.

    Raises:
        InputError: unknown name (with the nearest one), or bearings without `custom` or
            `custom` without bearings.
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
    count = name.removesuffix("-way")
    if name.endswith("-way") and count.isascii() and count.isdigit() and len(count) <= 3:
        return regular(int(count), **options)
    counts = [n for n in re.findall("[0-9]+", name) if len(n) <= 2 and 3 <= int(n) <= 12]
    near = [f"{int(n)}-way" for n in counts] or difflib.get_close_matches(
        name, [*makers, "custom"], n=1, cutoff=0.5
    )
    raise InputError(
        f"unknown scenario {show(name)}; allowed: {', '.join(makers)}, N-way (such as 6-way), "
        f"custom{f'; did you mean {near[0]!r}?' if near else ''}"
    )


def _regular(name: str, n: int, density: float, options: dict[str, Any]) -> Scenario:
    bearings = [360.0 * i / n for i in range(n)]
    profile = profile_named(options.get("profile", "paper"))
    if profile in PUBLISHED_PROFILES and _is_published(n, options):
        published = {"ways": published_ways(n), "junction_radius": PUBLISHED_RADII[n]}
        options = {**published, **options}
    return from_bearings(bearings, density, **{"name": name, **options})


def _is_published(n: int, options: dict[str, Any]) -> bool:
    """Whether this is a junction of the paper: its arms, side and measures."""
    radius = options.get("junction_radius")
    return (
        n in PUBLISHED_ARMS
        and options.get("side", "left") == "left"
        and not {"lane_width", "arm_length"} & set(options)
        and radius == (PUBLISHED_RADII[5] if n == 5 else None)
    )
