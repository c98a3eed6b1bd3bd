"""Mixed fleets: vehicles of any types, sizes and shares never collide, and each is served."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from dim import Dim, HarmonyMatrix, Mixed, Monitor, NoisyPerception, Zones
from dim.agent import GATES
from dim.controller import BODIES
from minisim.control import COMMIT_MARGIN, Controller, cover_of
from minisim.fleet import TYPES, Fleet
from minisim.junction.conflicts import corridor
from minisim.results.run import Run
from scenarios import Scenario, four_way
from scenarios.controllers import controller_named, safe
from scenarios.profiles import FAIR, PAPER
from scenarios.strategies import demands, fleets, floats, intersections
from tests.builders import digest, drained, share

seeds = st.integers(0, 2**32 - 1)


@st.composite
def mixed(draw: st.DrawFn) -> Scenario:
    """A random junction with a random fleet."""
    intersection = replace(draw(intersections()), arm_length=150.0)
    return Scenario(
        name="mixed", intersection=intersection, demand=draw(demands(intersection.n)),
        profile=draw(st.sampled_from([PAPER, FAIR])), fleet=draw(fleets(intersection)),
        horizon=120.0,
    )  # fmt: skip


def served(scenario: Scenario, controller: Controller | str, seed: int) -> Run:
    """Run to the last arrival; a collision raises."""
    if isinstance(controller, str):
        controller = controller_named(controller, scenario.profile)
    run = minisim.simulate(drained(scenario, seed, 3000.0), controller, seed, record="all")
    assert run.columns.arrived.all(), "a vehicle was never served"
    return run


#: Harmony by the bodies that take part, alone, with wrong perception and among human drivers.
OWN = (
    Dim(bodies="own"),
    Dim(bodies="own", gate="harmonious"),
    Dim(
        bodies="own", gate="harmonious", monitor=Monitor(),
        perception=NoisyPerception(intent_error=0.15, kind="symmetric", confidence=0.8),
    ),
    Mixed(Dim(bodies="own", gate="harmonious"), 0.4),
)  # fmt: skip


@share(0.03)
@given(mixed(), st.sampled_from(OWN), seeds)
def test_nor_do_they_where_harmony_is_by_the_bodies_that_take_part(
    scenario: Scenario, controller: Controller, seed: int
) -> None:
    served(scenario, controller, seed)


@share(0.03)
@given(mixed(), st.sampled_from(GATES), st.sampled_from(BODIES), st.data(), seeds)
def test_nor_do_they_where_the_zones_are_shorter_than_the_vehicles(
    scenario: Scenario, gate: str, bodies: str, data: st.DataObject, seed: int
) -> None:
    longest = scenario.site().vehicle.length
    green = data.draw(floats(COMMIT_MARGIN, longest / 2.0))
    zones = Zones(
        green=green, yellow=data.draw(floats(0.5, 0.99 * longest - green)),
        red=data.draw(floats(0.0, longest)),
    )  # fmt: skip
    assert zones.yellow_start < longest, "it takes part while its rear is far behind the zones"
    served(scenario, Dim(gate=gate, bodies=bodies, zones=zones), seed)


@share(0.1)
@given(mixed(), st.sampled_from(safe()), seeds)
def test_no_vehicles_collide_and_each_is_served(scenario: Scenario, name: str, seed: int) -> None:
    run = served(scenario, name, seed)
    most = [it.max_deceleration for it in run.site.types]
    braking = -run.trace["a"]
    for k, limit in enumerate(most):
        mine = braking[run.rows["type"][run.trace["row"]] == k]
        assert mine.max(initial=0.0) <= limit + 1e-9


def test_the_matrix_for_cars_lets_buses_collide() -> None:
    """So the property above can fail."""
    mix = {"car": 0.5, "sumo-bus": 0.5}
    scenario = four_way(300, fleet=mix, lane_width=4.0, profile="fair", horizon=900.0)
    wrong = Dim(matrix=HarmonyMatrix.from_geometry(scenario.intersection, TYPES["car"]))
    right = minisim.simulate(scenario, Dim(), on_collision="record")
    assert not right.collisions
    assert minisim.simulate(scenario, wrong, on_collision="record").collisions


@share(0.1)
@given(intersections(), st.data())
def test_the_corridor_of_a_fleet_holds_those_of_its_types(
    intersection: minisim.Intersection, data: st.DataObject
) -> None:
    fleet: Fleet = data.draw(fleets(intersection))
    path = data.draw(st.sampled_from(intersection.paths))
    whole = corridor(path, fleet).buffer(1e-6)
    assert all(whole.covers(corridor(path, it)) for it in fleet.types)


@pytest.mark.parametrize("name", safe())
def test_every_safe_controller_covers_mixed_fleets(name: str) -> None:
    mix = "motorcycle:0.5,auto-rickshaw:0.2,car:0.2,lcv:0.04,bus:0.03,truck:0.03"
    scenario = four_way(300, fleet=mix, lane_width=3.5, profile="fair", horizon=600.0)
    assert scenario.site().vehicle in cover_of(controller_named(name))
    run = served(scenario, name, 1)
    assert set(run.trips["type"]) == set(scenario.vehicles.names)


@pytest.mark.parametrize("gate", GATES)
def test_with_exact_perception_a_monitor_never_brakes_for_harmony_by_type(gate: str) -> None:
    """It knows one matrix for all, but looks where the two bodies really come close."""
    scenario = four_way(300, fleet="india", lane_width=3.5, profile="fair", horizon=600.0)
    dim = Dim(gate=gate, bodies="own")
    watched = minisim.simulate(scenario, replace(dim, monitor=Monitor()), seed=1, record="all")
    assert digest(watched) == digest(minisim.simulate(scenario, dim, seed=1, record="all"))
