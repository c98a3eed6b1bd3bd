"""Where ways meet, against SUMO's own figures and the formula of the sagitta."""

from __future__ import annotations

import math

import numpy as np
import pytest

from minisim.junction.geometry import Intersection
from minisim.junction.meetings import Meeting, meetings, right_of_way, sagittas
from scenarios import four_way
from scenarios.library import MAKERS

JUNCTION = four_way(profile="as_run").intersection
TABLE = meetings(JUNCTION)
AT = {name: k for k, name in enumerate(JUNCTION.movements.names)}


def test_ways_meet_where_sumo_says() -> None:
    def of(one: str, part: int, other: str, its: int) -> list[float]:
        kind, behind, _, width = TABLE[AT[one], part, AT[other], its].tolist()
        return [kind, pytest.approx(behind, abs=0.01), pytest.approx(width, abs=0.01)]

    assert of("b3", 1, "d1", 1) == [Meeting.JOIN, 5.05, 0.0]
    assert of("a2", 1, "b2", 1) == [Meeting.CROSS, 7.2, 3.2]  # half a lane before the centre
    assert of("a1", 1, "a3", 0) == [Meeting.PART, 4.97, 0.0]
    assert of("a1", 1, "a3", 1)[0] == Meeting.NOWHERE  # behind its waiting position
    assert of("a1", 1, "c1", 1)[0] == Meeting.NOWHERE
    assert of("a2", 1, "a2", 1)[0] == Meeting.NOWHERE


def test_only_those_that_must_yield_mind_one_before_its_waiting_position() -> None:
    minding = {name for name, k in AT.items() if TABLE[k, 1, AT["a3"], 0, 0] == Meeting.WAIT}
    # b2 leaves by the same exit; b3, d2 and d3 must yield, too, but cross a3 behind that position.
    assert minding == {"b2"}


def test_one_that_waits_inside_stops_at_its_position_for_what_it_crosses_behind() -> None:
    kind, behind, stopping, _ = TABLE[AT["a3"], 1, AT["c2"], 1]
    assert kind == Meeting.CROSS
    assert behind < stopping == pytest.approx(14.2 - 4.07)


def test_rights_of_way_are_those_of_the_networks() -> None:
    for arms, major in ((3, "b1 c1 c2"), (4, "a1 a2 c1 c2"), (5, "a3 d1 d2")):
        junction = MAKERS[arms](profile="as_run").intersection
        rights = right_of_way(junction)
        assert np.array(junction.movements.names)[rights.major].tolist() == major.split()
        assert (rights.foes == rights.foes.T).all()
        assert not (rights.yields & ~rights.foes).any()


def test_on_arcs_nothing_must_yield_and_the_same_ways_meet() -> None:
    rights = right_of_way(Intersection((0.0, 90.0, 180.0, 270.0)))
    assert not rights.yields.any()
    assert not rights.major.any()
    given = right_of_way(JUNCTION).foes
    # netconvert's default draws opposite far turns through each other
    assert int((rights.foes != given).sum()) == 4


def test_only_far_turns_have_a_sagitta() -> None:
    heights = sagittas(JUNCTION, 4.0)
    radius = 14.2 / (math.pi / 2)
    assert heights[2] == pytest.approx(radius - math.sqrt(radius**2 - 9.0), abs=1e-3)
    assert heights[[0, 1]].tolist() == [0.0, 0.0]
    right = Intersection((0.0, 90.0, 180.0, 270.0), side="right")
    assert (sagittas(right, 4.0)[:3] > 0).tolist() == [True, False, False]
