"""Kinds of turns, by angle and by order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from minisim.junction.geometry import Intersection
from minisim.junction.turns import Turn, indicator, lane_turns, straightest, turns
from scenarios import four_way, three_way
from scenarios.strategies import bearings

NEAR, THROUGH, FAR = Turn


def test_the_kind_of_every_turn() -> None:
    for intersection in (four_way().intersection, four_way(side="right").intersection):
        kinds = (NEAR, THROUGH, FAR) if intersection.side == "left" else (FAR, THROUGH, NEAR)
        assert turns(intersection) == kinds * 4
        assert lane_turns(intersection, 2) == kinds
        assert [indicator(path) for path in intersection.paths] == [-1, 0, 1] * 4


def test_on_three_arms_no_angle_is_straight_on_but_every_lane_has_a_straightest_way() -> None:
    three = three_way().intersection
    assert turns(three) == (NEAR, FAR) * 3
    assert [path.turn for path in three.paths[:2]] == pytest.approx([math.pi / 3, -math.pi / 3])
    assert lane_turns(three, 0) == (THROUGH, FAR)
    assert lane_turns(three_way(side="right").intersection, 0) == (THROUGH, NEAR)


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ((0, 90, 180, 270), (2, 2, 2, 2)),
        ((0, 90, 270), (1, 1, 2)),  # a T: both ways from its stem are turns
        ((0, 120, 240), (1, 1, 1)),  # equally straight: the left one
        ((0, 72, 144, 216, 288), (2, 2, 2, 2, 2)),
    ],
)
def test_the_straightest_manoeuvre(angles: tuple[float, ...], expected: object) -> None:
    manoeuvres = tuple(straightest(Intersection(angles), k) for k in range(len(angles)))
    assert manoeuvres == expected


@given(bearings())
def test_nothing_is_straighter_than_straight(angles: tuple[float, ...]) -> None:
    junction = Intersection(angles)
    for arm in range(junction.n):
        others = np.delete(np.roll(angles, -arm), 0)
        bends = np.abs((others - angles[arm]) % 360.0 - 180.0)
        assert bends[straightest(junction, arm) - 1] <= bends.min() + 1e-5
