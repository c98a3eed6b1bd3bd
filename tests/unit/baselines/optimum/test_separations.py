import math

from baselines.optimum.separations import edges, necessary
from scenarios.library import four_way
from scenarios.profiles import FAIR
from scenarios.scenario import Scenario

SCENARIO = four_way(profile=FAIR, density=100.0)


def between(scenario: Scenario, first: str, second: str) -> float:
    index = scenario.intersection.index
    return float(necessary(scenario.site()).rules.between[index(first), index(second)])


def test_crossing_at_right_angles_takes_a_body_and_its_width_each() -> None:
    """In both orders together, each covers the other's way once, at 14 m/s, but for the grid."""
    both = between(SCENARIO, "a2", "b2") + between(SCENARIO, "b2", "a2")
    assert 2.0 * (5.0 + 1.8) / 14.0 - 0.06 < both <= 2.0 * (5.0 + 1.8) / 14.0


def test_the_edge_is_where_the_bodies_part() -> None:
    it, junction = SCENARIO.site().vehicle, SCENARIO.intersection
    edge = edges(junction, junction.index("a2"), it, junction.index("b2"), it)
    assert edge.other.max() - edge.own.min() > 5.0
    assert len(edges(junction, junction.index("a2"), it, junction.index("c2"), it).own) == 0


def test_in_a_lane_a_vehicle_keeps_about_its_headway() -> None:
    straight = between(SCENARIO, "a2", "a2")
    assert 1.2 < straight <= 1.0 + (5.0 + 2.5) / 14.0
    assert between(SCENARIO, "a1", "a1") > straight  # slower, in a turn


def test_harmonious_movements_have_no_separation() -> None:
    assert between(SCENARIO, "a2", "c2") == -math.inf


def test_a_seed_or_demand_changes_nothing() -> None:
    busy = four_way(profile=FAIR, density=300.0)
    assert necessary(busy.site(3)) is necessary(SCENARIO.site(0))
