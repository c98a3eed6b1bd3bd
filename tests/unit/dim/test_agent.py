"""Algorithm 1 for one vehicle, rule by rule, on hand-made percepts."""

from __future__ import annotations

import pytest

from dim import DecisionTable, HarmonyMatrix
from dim.agent import GATES, Agent, Rules
from dim.perception import Percept

MATRIX = HarmonyMatrix.paper(4)
TABLE = DecisionTable(MATRIX)


def percept(participants: str = "", crossing: str = "") -> Percept:
    """Participants and crossing vehicles by movement; an id is the lane's, plus 10 if crossing."""
    taking_part, over_there = participants.split(), crossing.split()
    return Percept(
        tuple("abcd".index(m[0]) for m in taking_part),
        tuple(10 + "abcd".index(m[0]) for m in over_there),
        TABLE.case(taking_part),
        sum(1 << MATRIX.index(m) for m in over_there),
    )


def agent(lane: str, *, goes: bool = False, crossing: bool = False, **rules: str) -> Agent:
    index = "abcd".index(lane)
    result = Agent(index + 10 * crossing, index, Rules(TABLE, **rules))
    result.right_of_way = goes
    return result


def test_the_clique_goes_and_the_others_wait() -> None:
    scene = percept("a1 b2 c2 d2")
    assert [agent(lane).decide(scene) for lane in "abcd"] == [True, True, False, False]


def test_a_new_decision_revokes() -> None:
    c = agent("c")
    assert c.decide(percept("c2")) is True
    assert c.decide(percept("b2 c2 d2")) is False  # b2 d2 are two, c2 is alone
    assert c.right_of_way is False
    assert c.decide(percept("c2")) is True


@pytest.mark.parametrize("goes", [False, True])
def test_clear_gate_decisions_stand_while_any_vehicle_crosses(goes: bool) -> None:
    harmonious_or_not = [percept("a1", "c1"), percept("a1", "b3"), percept("a1 b2 d2", "a1")]
    for scene in harmonious_or_not:
        assert agent("a", goes=goes).decide(scene) is goes


@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("goes", [False, True])
def test_crossing_it_does_what_it_did(gate: str, goes: bool) -> None:
    ego = agent("a", goes=goes, crossing=True, gate=gate)
    assert ego.decide(percept("b1", "a2 c2")) is goes


@pytest.mark.parametrize("gate", GATES)
def test_past_half_of_the_green_zone_others_grant_it_the_right_of_way(gate: str) -> None:
    ego = agent("a", crossing=True, gate=gate, commit="paper")
    assert ego.decide(percept("b1", "a2")) is True


@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("goes", [False, True])
def test_behind_its_lanes_front_vehicle_it_does_what_it_did(goes: bool, gate: str) -> None:
    """Also when that one is committed: then no vehicle of lane a takes part."""
    for scene in (percept("a1 b1"), percept("b1", "a1"), percept("", "a1")):
        follower = Agent(7, 0, Rules(TABLE, gate))
        follower.right_of_way = goes
        assert follower.decide(scene) is goes


@pytest.mark.parametrize(
    ("participants", "crossing", "lanes"),
    [
        ("a1", "c1", "a"),  # in harmony with the only one that crosses
        ("a2", "b1", ""),
        ("a1", "b2 c2", "a"),  # in harmony with both
        ("d2", "b2 c2", ""),  # with b2 only
        ("b1 c2", "a1", "bc"),  # both admitted, and in harmony
        ("b2 c2", "a1", "b"),  # both admitted, in conflict: b comes first
        ("a1", "a2 a3", "a"),  # behind vehicles of its own lane it just follows
        ("b2", "a1 b1", "b"),  # in harmony with the one of another lane
        ("a3", "a1 c1", ""),  # in conflict with it
        ("a2 c2 d2", "a1", "ac"),  # d2 is kept out by a1; a2 and c2 are in harmony
    ],
)
@pytest.mark.parametrize("before", [False, True])
def test_harmonious_gate(participants: str, crossing: str, lanes: str, before: bool) -> None:
    scene = percept(participants, crossing)
    agents = {lane: agent(lane, goes=before, gate="harmonious") for lane in participants[::3]}
    assert "".join(lane for lane, ego in agents.items() if ego.decide(scene)) == lanes
