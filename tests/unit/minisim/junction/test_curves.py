"""Curves between lanes against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from minisim.junction.curves import join

EAST, NORTH = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def test_lanes_that_mirror_each_other_are_joined_by_one_arc() -> None:
    curve = join(np.zeros(2), EAST, np.array([7.0, 7.0]), NORTH, 33)
    assert curve.radius == pytest.approx(7.0)
    assert curve.length == pytest.approx(7.0 * math.pi / 2.0, rel=1e-5)
    apart = np.linalg.norm(curve.points - np.array([0.0, 7.0]), axis=1)
    assert apart == pytest.approx(7.0, abs=1e-3)


def test_unequal_tangents_add_a_straight_piece_to_the_arc() -> None:
    """The lines meet 9 m past the start and 7 m before the end: 2 m straight, then radius 7 m."""
    curve = join(np.zeros(2), EAST, np.array([9.0, 7.0]), NORTH, 33)
    assert curve.radius == pytest.approx(7.0)
    assert curve.length == pytest.approx(2.0 + 7.0 * math.pi / 2.0, rel=1e-5)
    straight = curve.points[curve.points[:, 0] <= 2.0]
    assert len(straight) > 3
    assert straight[:, 1] == pytest.approx(0.0, abs=1e-9)


def test_parallel_lanes_are_joined_by_an_s_of_the_closed_forms_radius() -> None:
    """With handles of a third, y = d(3u² − 2u³) over x = Lu: the least radius is L²/6d."""
    curve = join(np.zeros(2), EAST, np.array([15.0, 1.0]), EAST, 33)
    assert curve.radius == pytest.approx(15.0**2 / 6.0, rel=0.02)
    u = curve.points[:, 0] / 15.0
    assert curve.points[:, 1] == pytest.approx(3 * u**2 - 2 * u**3, abs=0.01)


@pytest.mark.parametrize("end", [(12.0, 5.0), (8.0, 9.0), (14.0, -2.0)])
@pytest.mark.parametrize("degrees", [-80.0, -20.0, 0.0, 35.0, 100.0])
def test_curves_are_tangent_to_both_lanes(end: tuple[float, float], degrees: float) -> None:
    out = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    curve = join(np.zeros(2), EAST, np.array(end), out, 2001)
    assert curve.points[[0, -1]] == pytest.approx(np.array([(0.0, 0.0), end]))
    steps = np.diff(curve.points, axis=0)
    step = curve.length / 2000
    for first, heading in ((steps[0], EAST), (steps[-1], out)):
        bend = step / curve.radius  # at most this within a step
        assert float(first @ heading) / step == pytest.approx(1.0, abs=bend**2 + 1e-4)
