"""Forbidden regions against the bodies themselves."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely

from dim import HarmonyMatrix
from minisim.control import Site
from minisim.junction.conflicts import CLEARANCE
from minisim.junction.coordination import CLOSE, STEP, Region, passes, region
from scenarios import four_way, three_way

SITES = [three_way().site(0), four_way(profile="fair").site(0)]
SITE = SITES[1]
PLACE = SITE.intersection, SITE.vehicle


def pairs(site: Site) -> list[tuple[int, int]]:
    """Movements of different lanes."""
    return list(map(tuple, np.argwhere(site.intersection.movements.apart).tolist()))


@pytest.mark.parametrize("site", SITES, ids=["3", "4"])
def test_movements_in_harmony_have_no_forbidden_region_and_all_others_have(site: Site) -> None:
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    for p, q in pairs(site):
        assert (region(site.intersection, site.vehicle, p, q) is None) == matrix.values[p, q]


def test_outside_its_region_bodies_keep_their_distance() -> None:
    """The grid promises it for every position, not only for its points."""
    random = np.random.default_rng(1)
    paths, vehicle = SITE.intersection.paths, SITE.vehicle
    tested = 0
    for p, q in pairs(SITE)[::5]:
        shared = region(*PLACE, p, q)
        if shared is None:
            continue
        x = random.uniform(0.0, (shared.close.shape[0] - 1) * STEP, 300)
        y = random.uniform(0.0, (shared.close.shape[1] - 1) * STEP, 300)
        one = shapely.polygons(paths[p].bodies(paths[p].entry + x, vehicle))
        other = shapely.polygons(paths[q].bodies(paths[q].entry + y, vehicle))
        distance = shapely.distance(one, other)
        for first, second, apart in zip(x, y, distance, strict=True):
            assert apart > CLOSE or shared.way(first, second) == 0.0
            if shared.room(first, second) > 0.0:
                assert apart > CLEARANCE
                tested += 1
    assert tested > 500


def test_a_region_is_all_within_a_step_of_where_bodies_come_near() -> None:
    """And `ever` is so at this or a later position of the second."""
    p, q = 1, 4  # a2, b2
    shared = region(*PLACE, p, q)
    assert shared is not None
    bodies = []
    for way, count in zip((p, q), shared.close.shape, strict=True):
        path = SITE.intersection.paths[way]
        s = path.entry + STEP * np.arange(count)
        assert s[-2] < path.exit + SITE.vehicle.length <= s[-1]
        bodies.append(shapely.polygons(path.bodies(s, SITE.vehicle)))
    distance = shapely.distance(bodies[0][:, None], bodies[1][None, :])
    for x, y in itertools.product(*map(range, distance.shape)):
        rows = slice(max(x - 1, 0), x + 2)
        assert shared.close[x, y] == (distance[rows, max(y - 1, 0) : y + 2] <= CLOSE).any()
        assert shared.ever[x, y] == (distance[rows, max(y - 1, 0) :] <= CLEARANCE).any()


def test_a_vehicle_that_has_stopped_in_time_is_in_no_others_way() -> None:
    """However far the other goes; and a region is that of the other, mirrored."""
    for p, q in pairs(SITE)[::3]:
        shared, mirrored = region(*PLACE, p, q), region(*PLACE, q, p)
        if shared is None or mirrored is None:
            continue
        assert (shared.close == mirrored.close.T).all()
        for x in np.arange(0.0, shared.close.shape[0] * STEP, STEP):
            for y in np.arange(0.0, shared.close.shape[1] * STEP, 4 * STEP):
                if shared.room(x, y) > 0.0:
                    assert mirrored.way(y, x) == math.inf


#: Five positions of the first vehicle, three of the second.
BY_HAND = Region(
    close=np.array([[0, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0]], dtype=bool),
    ever=np.array([[0, 0, 0], [1, 1, 0], [1, 1, 0], [0, 0, 0], [1, 0, 0]], dtype=bool),
)


@pytest.mark.parametrize(
    ("first", "second", "room", "way"),
    [
        (-3.0, -9.0, 3.0 + STEP, 3.0 + 4 * STEP),
        (0.0, 0.0, STEP, 4 * STEP),
        (0.1, 1.5 * STEP, STEP - 0.1, STEP - 0.1),
        (1.5 * STEP, STEP, 0.0, 0.0),  # in it
        (2.0 * STEP, 1.9 * STEP, 0.0, 0.0),
        (3.0 * STEP, STEP, math.inf, math.inf),  # past it
        (3.0 * STEP, 0.0, STEP, STEP),
        (0.0, 2.0 * STEP, math.inf, math.inf),  # the other is past it
        (5.0 * STEP, 0.0, math.inf, math.inf),  # off the grid
        (0.0, 3.0 * STEP, math.inf, math.inf),
    ],
)
def test_how_far_a_region_is_by_hand(first: float, second: float, room: float, way: float) -> None:
    assert BY_HAND.room(first, second) == pytest.approx(room)
    assert BY_HAND.way(first, second) == pytest.approx(way)


def test_where_a_region_ends_by_hand() -> None:
    ends = [BY_HAND.ends(second * STEP) for second in (-9.0, 0.0, 0.9, 1.0, 2.0, 3.0)]
    assert ends == [5 * STEP, 5 * STEP, 5 * STEP, 3 * STEP, 0.0, 0.0]


def test_when_bodies_touch_by_hand() -> None:
    """Before the entry is the entry; beyond the grid there is nothing to touch."""
    for first, second, touching in (
        (4.5, -2.0, True), (4.0, 0.9, True), (4.0, 1.0, False), (1.0, 1.0, True), (0.9, 1.0, False),
        (2.9, 1.9, True), (-1.0, 1.0, False), (5.0, 0.0, False), (1.0, 3.0, False),
    ):  # fmt: skip
        at = np.array([first]) * STEP, np.array([second]) * STEP
        assert BY_HAND.touches(*at) is touching, (first, second)
    there, then = np.array([0.0, 1.0, 2.0]) * STEP, np.array([1.0, 2.0, 1.0]) * STEP
    assert BY_HAND.touches(there, then)
    assert not BY_HAND.touches(there[:2], then[:2])


def test_a_vehicle_with_a_decimetre_gets_past_one_without_does_not() -> None:
    """Two once stood in each other's way for ever: 13 cm for one, a touch for the other."""
    a2, b3 = map(SITE.intersection.index, ("a2", "b3"))
    assert passes(*PLACE, b3, 4.94, a2, 3.56)
    assert not passes(*PLACE, a2, 3.56, b3, 4.94)
    shared = region(*PLACE, b3, a2)
    assert shared is not None
    assert shared.way(4.94, 3.56) < math.inf, "the grid alone does not show it"
