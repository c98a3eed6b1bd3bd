"""Whatever value a public constructor is given: an object, or one clear `MinisimError`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import scenarios
from baselines import webster, webster_delay
from dim import HarmonyMatrix, explain
from minisim import simulate
from minisim.arrivals import Arrivals
from minisim.control import Marking, Site, Unregulated
from minisim.demand import Demand
from minisim.errors import MinisimError
from minisim.junction.geometry import Intersection
from minisim.parameters import parameters
from minisim.recorded import read_arrivals
from minisim.streams import stream
from minisim.vehicle import VehicleType
from scenarios.controllers import controller_named
from scenarios.profiles import FAIR, Profile, profile_named
from scenarios.recipe import Recipe
from scenarios.scenario import Scenario
from tests.property.test_declared import declarations

BEARINGS = (0.0, 90.0, 180.0, 270.0)
FOUR = Intersection(BEARINGS, arm_length=60.0)
CAR = VehicleType()
DEMAND = Demand(density=100.0)
EMPTY = Arrivals(np.empty(0), np.empty(0, dtype=int), np.empty(0, dtype=int))
SHORT = Scenario(name="short", intersection=FOUR, demand=DEMAND, profile=FAIR, horizon=5.0)


GEOMETRY = {"side": "left", "lane_width": 3.2, "junction_radius": 8.0, "arm_length": 200.0}
TRAFFIC = {
    "density": 100.0, "split": None, "turns": (1, 1, 1), "model": "shifted", "min_headway": 1.0,
}  # fmt: skip
RUN = {"profile": "fair", "horizon": 60.0, "recorded": None}

#: Functions and classes with arguments that have no default, and arguments that they accept.
CASES: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "Intersection": (Intersection, {"bearings": BEARINGS, **GEOMETRY}),
    "Intersection.parse": (FOUR.parse, {"text": "a1"}),
    "Demand": (Demand, TRAFFIC),
    "Demand.draw": (
        lambda duration, seed: DEMAND.draw(4, duration, seed), {"duration": 60.0, "seed": 1}
    ),
    "Arrivals": (Arrivals, {"time": [0.0, 1.0], "lane": [0, 1], "manoeuvre": [1, 1]}),
    "stream": (stream, {"seed": 1, "name": "arrivals"}),
    "Site": (
        Site,
        {"intersection": FOUR, "fleet": CAR, "speed_limit": 14.0, "demand": (1.0,) * 4,
         "dt": 0.1, "seed": 0},
    ),
    "Marking": (Marking, {"name": "red", "start": 30.0, "end": 8.0, "speed": 5.0}),
    "Profile": (
        Profile,
        {"name": "x", "vehicle": CAR, "speed_limit": 14.0, "depart_speed": None, "dt": 0.1},
    ),
    "Scenario": (
        Scenario,
        {"name": "x", "intersection": FOUR, "demand": DEMAND, "profile": FAIR, "horizon": 60.0,
         "recorded": EMPTY},
    ),
    "three_way": (scenarios.three_way, {**GEOMETRY, **TRAFFIC, **RUN, "turns": (1, 1)}),
    "regular": (scenarios.regular, {"n": 4, **GEOMETRY, **TRAFFIC, **RUN}),
    "from_bearings": (
        scenarios.from_bearings,
        {"bearings": BEARINGS, "name": "x", **GEOMETRY, **TRAFFIC, **RUN},
    ),
    "profile_named": (profile_named, {"name": "fair"}),
    "HarmonyMatrix": (HarmonyMatrix, {"n": 3, "values": np.zeros((6, 6), dtype=int)}),
    "HarmonyMatrix.paper": (HarmonyMatrix.paper, {"n": 4}),
    "HarmonyMatrix.from_geometry": (
        HarmonyMatrix.from_geometry, {"intersection": FOUR, "vehicles": CAR, "clearance": 0.5}
    ),
    "explain": (
        explain,
        {"movements": ("a1", "b2"), "matrix": HarmonyMatrix.paper(4), "order": "lanes",
         "priorities": (3, 2, 1, 0)},
    ),
    "webster": (
        webster,
        {"rates": (100.0,) * 4, "saturation_flow": 1500.0, "lost_time_per_phase": 2.0,
         "equal_greens": True, "min_green": 3.0, "max_cycle": 180.0},
    ),
    "webster_delay": (
        webster_delay, {"rate": 100.0, "green": 10.0, "cycle": 60.0, "saturation_flow": 1500.0}
    ),
    "controller_named": (controller_named, {"spec": "dim", "profile": "fair"}),
    "Recipe": (Recipe, {"scenario": SHORT, "controller": Unregulated(), "seed": 1}),
    "simulate": (
        simulate,
        {"scenario": SHORT, "controller": Unregulated(), "seed": 1, "record": None,
         "record_window": (0.0, 5.0), "on_collision": "record"},
    ),
}  # fmt: skip

#: Every declared class whose parameters all have a default.
for kind in dict.fromkeys(kind for kind, _ in declarations().values()):
    defaults = {it.name: it.default for it in parameters(kind)}
    if MISSING not in defaults.values():
        CASES.setdefault(kind.__name__, (kind, defaults))


def numbers() -> st.SearchStrategy[Any]:
    """Numbers of every type, mostly at the edges."""
    edges = [
        0, -1, 1, 0.5, 3, math.nan, math.inf, -math.inf, -0.0, 5e-324, 1e-300, 1e308, 10**30,
        10**400, -(10**400), True, False, 1j, np.float64("nan"), np.float32(2.5),
        np.int8(3), np.uint64(2**63), np.bool_(True), Fraction(1, 3), Fraction(10**400),
        Decimal("1.5"), Decimal("sNaN"),
    ]  # fmt: skip
    return st.sampled_from(edges) | st.floats() | st.integers() | st.fractions()


def junk() -> st.SearchStrategy[Any]:
    """Values of any kind, nested."""
    words = ["", "a1", "four-way", "left", "poisson", "1e3", "nan", "4:3:2:1", "\0", "\ud800", b"a"]
    things = [None, object(), int, len, ..., CAR, FOUR, DEMAND, EMPTY, SHORT, Unregulated()]
    texts = st.text(max_size=5) | st.sampled_from(words)
    leaves = st.one_of(numbers(), texts, st.sampled_from(things))
    arrays = st.sampled_from(
        [np.array(1.0), np.zeros(4), np.zeros((2, 2)), np.array(["a"]), np.array([None]),
         np.array([2.5 + 1j]), np.empty(0), np.arange(4, dtype=np.uint8)]
    )  # fmt: skip
    nested = st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.lists(inner, max_size=5),
            st.lists(inner, max_size=5).map(tuple),
            st.dictionaries(st.text(max_size=2) | st.integers(), inner, max_size=3),
        ),
        max_leaves=6,
    )
    return nested | arrays | st.lists(numbers(), min_size=3, max_size=5).map(tuple)


@pytest.mark.parametrize("name", CASES)
def test_the_valid_arguments_are_valid(name: str) -> None:
    """Otherwise the property below would only ever see errors."""
    make, valid = CASES[name]
    make(**valid)


#: Built once: making a strategy costs more than drawing from it.
JUNK = junk()


def try_to_make(name: str, arguments: dict[str, Any]) -> None:
    message = "made"
    try:
        CASES[name][0](**arguments)
    except MinisimError as error:
        message = str(error)
    assert 0 < len(message) < 2000


@pytest.mark.parametrize("name", CASES)
@given(data=st.data())
def test_any_argument_gives_an_object_or_a_minisim_error(name: str, data: st.DataObject) -> None:
    valid = CASES[name][1]
    broken = data.draw(st.lists(st.sampled_from(sorted(valid)), min_size=1, max_size=2))
    try_to_make(name, {**valid, **{field: data.draw(JUNK, label=field) for field in broken}})


@pytest.mark.parametrize(
    ("name", "field"), [(name, field) for name, (_, valid) in CASES.items() for field in valid]
)
def test_values_that_are_awkward_to_print_or_compare_are_no_exception(
    name: str, field: str
) -> None:
    """`repr` of an integer of more than 4300 digits is a ValueError, a format of a fraction a
    TypeError, and whether an array equals anything is an array.
    """
    huge, shares = 10**5000, (Fraction(1), Fraction(1, 3))
    for value in (huge, [huge], {"x": huge}, *shares, list(shares), np.zeros(4), [np.zeros(4)]):
        try_to_make(name, {**CASES[name][1], field: value})


@pytest.mark.parametrize("read", [read_arrivals, HarmonyMatrix.from_csv])
@given(path=JUNK)
def test_no_file_is_a_minisim_error(read: Callable[[Any], Any], path: Any) -> None:
    with pytest.raises(MinisimError):
        read(path)
