"""What all flows of connected vehicles share: separations, the plan, and how it is driven."""

from __future__ import annotations

import math

import numpy as np
import pytest

import minisim
from baselines import Slots
from baselines.flows import Flow, Waiting, plan, separations
from baselines.slots import Batch
from minisim.errors import InputError
from minisim.junction.conflicts import conflict_zones
from minisim.testing import small_scenario
from minisim.vehicle import VehicleType
from scenarios import four_way
from tests.builders import replayed

FOUR = four_way(100, profile="fair")
SITE = FOUR.site(1)
#: Straight on from the arms a and b.
A2, B2 = SITE.intersection.movements.rows[0][2], SITE.intersection.movements.rows[1][2]


def test_in_a_lane_vehicles_keep_the_gap_and_the_headway_of_car_following() -> None:
    it, v = SITE.vehicle, SITE.speed_limit
    wanted = (it.length + it.min_gap) / v + it.headway
    assert separations(SITE, 0.5)[A2, A2] == pytest.approx(wanted, rel=1e-3)


def test_between_lanes_the_first_leaves_its_zone_before_the_second_comes_to_its_own() -> None:
    """At the limit, straight on."""
    zones, v = conflict_zones(SITE.intersection, SITE.vehicle), SITE.speed_limit
    wanted = (zones[A2, B2, 1] - zones[B2, A2, 0]) / v + 0.5
    assert separations(SITE, 0.5)[A2, B2] == pytest.approx(wanted, rel=1e-2)
    apart = SITE.conflicts & SITE.intersection.movements.apart
    assert np.allclose(separations(SITE, 2.0)[apart] - separations(SITE, 0.5)[apart], 1.5)


def test_movements_in_harmony_do_not_wait_for_each_other() -> None:
    free = separations(SITE, 0.5) == -math.inf
    assert (free == ~SITE.conflicts & SITE.intersection.movements.apart).all()


def test_a_plan_keeps_the_order_of_each_lane_and_all_separations() -> None:
    between = separations(SITE, 1.0)
    random = np.random.default_rng(1)
    came = np.sort(random.uniform(0.0, 60.0, 40)).tolist()
    kind = random.integers(len(between), size=40).tolist()
    waiting = [Waiting(i, k, i, t, t) for i, (k, t) in enumerate(zip(kind, came, strict=True))]
    lines = [[it for it in waiting if it.kind // 3 == lane] for lane in range(4)]
    free = np.full(len(between), -math.inf)
    served = list(plan(lines, Batch(5), between, free, -math.inf))
    for lane, line in enumerate(lines):
        assert [it.vehicle for it in served if it.vehicle.kind // 3 == lane] == line
    for i, second in enumerate(served):
        assert second.time >= second.vehicle.came
        for first in served[:i]:
            least = between[first.vehicle.kind, second.vehicle.kind]
            assert second.time - first.time >= least - 1e-9


def test_by_default_the_second_could_stop_until_the_first_is_gone() -> None:
    """Two vehicles in conflict that come at once: v/2b, where AIM keeps 0.5 s."""
    scenario = replayed(FOUR, (0.0, 0, 2), (0.0, 1, 2), horizon=200.0)
    gaps = []
    for slots in (Slots(buffer=0.5), Slots(), Slots(buffer=3.0)):
        first, second = np.sort(minisim.simulate(scenario, slots).columns.arrival)
        gaps.append(second - first)
    stops = SITE.speed_limit / (2.0 * SITE.vehicle.deceleration)
    assert gaps[1] - gaps[0] == pytest.approx(stops - 0.5, abs=0.3)
    assert gaps[2] - gaps[1] == pytest.approx(3.0 - stops, abs=0.3)


def test_vehicles_that_cannot_be_predicted_are_refused() -> None:
    unlike = VehicleType(speed_deviation=0.1)
    with pytest.raises(InputError, match=r"^slots is for .* alike .*speed_deviation of 0.1"):
        Slots().start(small_scenario(vehicle=unlike).site(1))


def test_a_flow_without_a_rule_cannot_be_made() -> None:
    with pytest.raises(TypeError, match="abstract"):
        Flow()  # type: ignore[abstract]
