"""Hypothesis strategies for geometries, vehicles, demands, whole scenarios and controllers.

    from hypothesis import given
    from minisim import simulate
    from scenarios.strategies import controllers, scenarios


    @given(scenarios(), controllers())
    def test_nothing_collides(scenario, controller):
        simulate(scenario, controller)  # a collision raises

minisim's own tests use them, and yours can too: `pip install 'minisim-traffic[testing]'`.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from minisim.control import Controller
from minisim.demand import MODELS, Demand, DemandProfile, Period
from minisim.errors import InputError, MissingExtraError, extra
from minisim.fleet import TYPES, Fleet
from minisim.junction.conflicts import entry_room
from minisim.junction.geometry import MIN_ANGLE, Intersection
from minisim.junction.movements import movements_of
from minisim.junction.roads import Road
from minisim.vehicle import VehicleType
from scenarios.controllers import controller_named, safe
from scenarios.profiles import FAIR, PAPER
from scenarios.scenario import Scenario

try:
    from hypothesis import assume, reject
    from hypothesis import strategies as st
except ImportError as error:
    raise MissingExtraError(f"strategies need hypothesis: {extra('testing')}") from error

SIDES: tuple[Literal["left", "right"], ...] = ("left", "right")


def floats(low: float, high: float) -> st.SearchStrategy[float]:
    """Finite floats in [low, high]."""
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


@st.composite
def bearings(draw: st.DrawFn, min_arms: int = 3, max_arms: int = 6) -> tuple[float, ...]:
    """Bearings of 3 … 6 arms, at least `MIN_ANGLE` apart; every such set is possible."""
    n = draw(st.integers(min_arms, max_arms))
    spare = 360.0 - MIN_ANGLE * n
    cuts = sorted(draw(st.lists(floats(0.0, spare), min_size=n - 1, max_size=n - 1)))
    gaps = [MIN_ANGLE + b - a for a, b in itertools.pairwise([0.0, *cuts])]
    last = 360.0 - sum(gaps)
    start = draw(floats(0.0, 0.999)) * last
    return tuple(itertools.accumulate(gaps, initial=start))


@st.composite
def intersections(draw: st.DrawFn, min_arms: int = 3, max_arms: int = 6) -> Intersection:
    """Junctions of any shape: both sides, lanes of 2.8 … 4 m, at least the default radius."""
    lane_width = draw(st.sampled_from([3.2, 2.8, 3.5, 4.0]))
    widened = draw(st.sampled_from([1.0, 1.25, 2.0]))
    angles = draw(bearings(min_arms, max_arms))
    made = Intersection(angles, side=draw(st.sampled_from(SIDES)), lane_width=lane_width)
    return replace(made, junction_radius=made.junction_radius * widened)


@st.composite
def roads(draw: st.DrawFn, n: int) -> tuple[Road, ...]:
    """Roads of n arms: own lengths, limits and widths, some of them one-way."""
    maybe = {
        "length": st.sampled_from([None, 90.0, 250.0]),
        "speed_limit": st.sampled_from([None, 3.0, 8.0, 20.0]),
        "lane_width": st.sampled_from([None, 2.8, 4.0]),
        "traffic": st.sampled_from(["both", "both", "in", "out"]),
    }
    made = st.builds(Road, **maybe)
    return tuple(draw(st.lists(made, min_size=n, max_size=n)))


@st.composite
def uneven(draw: st.DrawFn, max_density: float = 250.0) -> Scenario:
    """Short scenarios on junctions whose roads differ, and where some turns are forbidden."""
    angles = draw(bearings(max_arms=5))
    own = draw(roads(len(angles)))
    names = movements_of(len(angles)).names
    try:
        intersection = Intersection(
            angles, side=draw(st.sampled_from(SIDES)), arm_length=150.0, roads=own,
            forbidden=tuple(draw(st.sets(st.sampled_from(names), max_size=3))),
        )  # fmt: skip
        density = draw(floats(20.0, max_density))
        made = Scenario(
            name="uneven", intersection=intersection, demand=Demand(density=density),
            profile=draw(st.sampled_from([PAPER, FAIR])), horizon=120.0,
        )  # fmt: skip
        made.site()
    except InputError:  # nothing may enter or leave, or a path is too tight
        reject()
    return made


@st.composite
def vehicles(draw: st.DrawFn) -> VehicleType:
    """Passenger cars: 3 … 6 m long, 1.5 … 2 m wide, driven in any ordinary way."""
    made = VehicleType(
        acceleration=draw(floats(0.8, 4.0)),
        deceleration=draw(floats(1.5, 5.0)),
        length=draw(floats(3.0, 6.0)),
        width=draw(floats(1.5, 2.0)),
        headway=draw(floats(0.8, 2.0)),
        min_gap=draw(floats(1.0, 4.0)),
        max_deceleration=100.0,
        model=draw(st.sampled_from(["idm", "iidm"])),
    )
    return replace(made, max_deceleration=draw(floats(max(6.0, made.needed_braking), 12.0)))


@st.composite
def fleets(draw: st.DrawFn, intersection: Intersection) -> Fleet:
    """One to five of the ready types and of random ones that fit a junction, with any shares."""
    others = [draw(vehicles()) for _ in range(draw(st.integers(0, 2)))]
    axles = st.none() | floats(0.5, 1.0)  # as shares of the length
    own = [
        replace(it, name=f"own {k}", model="idm", rear_axle=share and share * it.length)
        for k, it in enumerate(others)
        for share in [draw(axles)]
    ]
    fitting = [it for it in (*TYPES.values(), *own) if entry_room(intersection, it) > 0.0]
    some = st.lists(st.sampled_from(fitting), min_size=1, max_size=5, unique_by=lambda it: it.name)
    types = draw(some)
    weights = draw(st.lists(st.integers(1, 9), min_size=len(types), max_size=len(types)))
    model = draw(st.sampled_from(["idm", "iidm", "krauss"]))
    fleet = Fleet(
        tuple(replace(it, model=model) for it in types),
        tuple((weight / sum(weights),) for weight in weights),
    )
    assume(entry_room(intersection, fleet) > 0.0)
    return fleet


@st.composite
def demands(draw: st.DrawFn, n: int, max_density: float = 350.0) -> Demand:
    """Balanced or split demand on n lanes, uniform or uneven turns, every arrival model."""

    return Demand(
        density=draw(floats(20.0, max_density)),
        split=draw(shares(n)),
        turns=draw(turns(n)),
        model=draw(st.sampled_from(MODELS)),
    )


@st.composite
def mixes(draw: st.DrawFn, n: int) -> dict[str, list[float]]:
    """Shares of one to three ready types of vehicles, the same on every lane or by lane."""
    types = draw(st.lists(st.sampled_from([*TYPES]), min_size=1, max_size=3, unique=True))
    shape = (len(types), draw(st.sampled_from([1, n])))
    size = math.prod(shape)
    weights = np.reshape(draw(st.lists(st.integers(1, 9), min_size=size, max_size=size)), shape)
    return dict(zip(types, (weights / weights.sum(axis=0)).tolist(), strict=True))


@st.composite
def demand_profiles(draw: st.DrawFn, n: int, max_density: float = 350.0) -> DemandProfile:
    """Demand on n lanes over up to 5 periods in 20 minutes, begun in any, perhaps with a fleet."""
    edges = sorted(draw(st.sets(st.integers(0, 1200), min_size=2, max_size=6)))
    rates = st.tuples(*[st.just(0.0) | floats(1.0, max_density)] * n)
    return DemandProfile(
        periods=tuple(
            Period(start=start, end=end, rates=draw(rates), turns=draw(turns(n)))
            for start, end in itertools.pairwise(edges)
        ),
        fleet=draw(st.none() | mixes(n)),
        start=draw(st.integers(edges[0], edges[-1] - 1)),
        model=draw(st.sampled_from(MODELS)),
    )


def turns(n: int) -> st.SearchStrategy[tuple[Any, ...] | None]:
    """Shares of the manoeuvres of n arms: the same on every lane, or by lane."""
    return shares(n - 1) | st.lists(shares(n - 1), min_size=n, max_size=n).map(tuple)


def shares(count: int) -> st.SearchStrategy[tuple[float, ...] | None]:
    """Shares, not all zero; None is equal ones."""
    some = st.lists(st.integers(0, 4), min_size=count, max_size=count).filter(any)
    return st.none() | some.map(tuple)


@st.composite
def scenarios(
    draw: st.DrawFn,
    min_arms: int = 3,
    max_arms: int = 6,
    max_density: float = 350.0,
    horizon: float = 120.0,
    arm_length: float = 150.0,
) -> Scenario:
    """Short scenarios on random junctions; roads of length `arm_length` keep a run quick."""
    angles = draw(bearings(min_arms, max_arms))
    intersection = Intersection(angles, side=draw(st.sampled_from(SIDES)), arm_length=arm_length)
    return Scenario(
        name="random",
        intersection=intersection,
        demand=draw(demands(intersection.n, max_density)),
        profile=draw(st.sampled_from([PAPER, FAIR])),
        horizon=horizon,
    )


def controllers() -> st.SearchStrategy[Controller]:
    """Every controller that never collides, and its variants, for the profile `paper`."""
    return st.sampled_from(safe()).map(controller_named)
