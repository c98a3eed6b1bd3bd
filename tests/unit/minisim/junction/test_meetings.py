"""Where ways meet, against SUMO's own figures and the formula of the sagitta."""

from __future__ import annotations

import math

import numpy as np
import pytest

from minisim.junction.geometry import Intersection
from minisim.junction.meetings import Meeting, meetings, sagittas
from scenarios import four_way


def test_ways_meet_where_sumo_says() -> None:
    site = four_way(profile="as_run").site()
    junction = site.intersection
    table = meetings(junction)
    at = {str(m): k for k, m in enumerate(junction.movements)}
    assert table[at["b3"], at["d1"]].tolist() == [Meeting.JOIN, pytest.approx(5.05, abs=0.01)]
    # a vehicle that crosses a way is never followed on it
    assert table[at["a2"], at["b2"], 0] == Meeting.NOWHERE
    assert table[at["a1"], at["a3"], 0] == Meeting.PART
    assert table[at["a1"], at["c1"], 0] == Meeting.NOWHERE
    assert table[at["a2"], at["a2"], 0] == Meeting.NOWHERE


def test_arcs_meet_like_given_ways() -> None:
    given = meetings(four_way(profile="as_run").intersection)
    arcs = meetings(Intersection((0.0, 90.0, 180.0, 270.0)))
    assert (given[..., 0] == arcs[..., 0]).all()
    assert np.abs(given - arcs).max() < 2.5


def test_only_far_turns_have_a_sagitta() -> None:
    heights = sagittas(four_way(profile="as_run").intersection, 4.0)
    radius = 14.2 / (math.pi / 2)
    assert heights[2] == pytest.approx(radius - math.sqrt(radius**2 - 9.0), abs=1e-3)
    assert heights[[0, 1]].tolist() == [0.0, 0.0]
    right = Intersection((0.0, 90.0, 180.0, 270.0), side="right")
    assert (sagittas(right, 4.0)[:3] > 0).tolist() == [True, False, False]
