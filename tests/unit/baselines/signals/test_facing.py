"""Which approaches are green together."""

from __future__ import annotations

from dataclasses import replace

import pytest

from baselines.signals.facing import facing, phases_of
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from scenarios.library import four_way, regular


def phases(*bearings: float) -> set[tuple[int, ...]]:
    return set(facing(Intersection(bearings=bearings)).values())


def test_opposite_arms_are_green_together() -> None:
    assert phases(0, 90, 180, 270) == {(0, 2), (1, 3)}


def test_the_stem_of_a_t_is_green_alone() -> None:
    assert phases(0, 90, 180) == {(0, 2), (1,)}
    assert phases(10, 180, 270) == {(0, 1), (2,)}


def test_arms_at_120_degrees_do_not_face_each_other() -> None:
    assert phases(0, 120, 240) == {(0,), (1,), (2,)}
    assert phases(0, 134, 240) == {(0,), (1,), (2,)}
    assert phases(0, 136, 240) == {(0, 1), (2,)}


def test_of_five_arms_one_is_left() -> None:
    assert phases(0, 72, 144, 216, 288) == {(0, 2), (1, 3), (4,)}


def test_the_straightest_pair_is_made_first() -> None:
    assert phases(0, 100, 150, 185) == {(0, 3), (1,), (2,)}


def test_an_arm_without_an_approach_faces_none() -> None:
    road = four_way().intersection
    one_way = replace(road, forbidden=("c1", "c2", "c3"))
    assert set(facing(one_way).values()) == {(0,), (1, 3)}


def test_an_order_of_lanes_is_one_of_phases() -> None:
    road = regular(4).intersection
    assert phases_of((3, 0, 1, 2), road, together=True) == [(1, 3), (0, 2)]
    assert phases_of((3, 0, 1, 2), road, together=False) == [(3,), (0,), (1,), (2,)]
    assert phases_of(None, road, together=True) == [(0, 2), (1, 3)]
    with pytest.raises(InputError, match="order must be the lanes"):
        phases_of((0, 2), road, together=True)
