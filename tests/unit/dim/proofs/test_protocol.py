"""The protocol's events one by one, by hand, on the paper's three arms.

There a1 is in harmony with b1, b2, c1; b1 with c1, c2 too; a2 with c1 only. Movements are bits in
the order a1 a2 b1 b2 c1 c2.
"""

from __future__ import annotations

import pytest

from dim import HarmonyMatrix
from dim.proofs.protocol import (
    COMMITTED,
    LOOK,
    ROLLING,
    TURN,
    WAITING,
    Event,
    Front,
    Protocol,
    State,
)  # fmt: skip

A1, A2, B1, B2, C1, C2 = (1 << k for k in range(6))


def protocol(**rules: str) -> Protocol:
    return Protocol(HarmonyMatrix.paper(3), **rules)  # type: ignore[arg-type]


def front(movement: str, phase: int = WAITING, goes: bool = False) -> tuple[int, Front]:
    return "abc".index(movement[0]), Front(int(movement[1]), phase, goes)


def state(*fronts: tuple[int, Front], inside: int = 0, came: tuple[int, ...] = ()) -> State:
    there = dict(fronts)
    return State(tuple(there.get(lane) for lane in range(3)), inside, came=came)


def goes(rules: Protocol, before: State) -> str:
    """The lanes that go after a look."""
    after = rules.look(before)
    return "".join("abc"[k] for k, f in enumerate(after.fronts) if f is not None and f.goes)


def happens(rules: Protocol, before: State) -> dict[str, State]:
    return {str(event): after for event, after in rules.successors(before)}


def acts(rules: Protocol, before: State) -> dict[str, State]:
    return {word: s for word, s in happens(rules, before).items() if not word.startswith("arrive")}


def test_events_in_words() -> None:
    assert [str(e) for e in (LOOK, TURN, Event("enter", 1, 2))] == ["look", "turn", "enter b2"]
    assert (Event("look").lane, Event("look").manoeuvre) == (-1, 0)


def test_on_an_empty_junction_any_vehicle_may_arrive_and_nothing_else_happens() -> None:
    steps = happens(protocol(), protocol().start)
    assert list(steps) == [f"arrive {lane}{j}" for lane in "abc" for j in (1, 2)]
    assert steps["arrive b2"] == state(front("b2"))
    assert not any(after.came for after in steps.values())


def test_no_vehicle_arrives_before_a_front_vehicle() -> None:
    steps = happens(protocol(), state(front("a1", COMMITTED, True), front("c2", COMMITTED, True)))
    assert [word for word in steps if word.startswith("arrive")] == ["arrive b1", "arrive b2"]


def test_a_vehicle_crosses_step_by_step() -> None:
    rules = protocol()
    here = state(front("a1"), front("b1", COMMITTED, True), front("c2"))
    assert set(happens(rules, here)) == {"enter b1", "slow b1"}  # the others keep still
    seen, committed = state(front("b1", WAITING, True)), state(front("b1", COMMITTED, True))
    assert acts(rules, state(front("b1"))) == {"look": seen}
    assert acts(rules, seen) == {"commit b1": committed}
    assert acts(rules, committed) == {"enter b1": state(inside=B1), "slow b1": seen}
    assert acts(rules, state(inside=B1)) == {"leave b1": rules.start}


def test_by_the_papers_rule_it_rolls_first_and_never_slows_down() -> None:
    rules = protocol(commit="paper")
    rolling = state(front("c2", ROLLING, True))
    assert acts(rules, state(front("c2", WAITING, True))) == {"roll c2": rolling}
    for right_of_way in (True, False):
        rolling = state(front("c2", ROLLING, right_of_way), inside=B2)
        steps = happens(rules, rolling)
        assert steps["commit c2"] == state(front("c2", COMMITTED, right_of_way), inside=B2)
    assert list(acts(rules, state(front("c2", COMMITTED, True)))) == ["enter c2"]


def test_any_vehicle_inside_may_leave_first() -> None:
    before = state(inside=A1 | B2 | C2)
    steps = {w: after for w, after in happens(protocol(), before).items() if "leave" in w}
    assert {w: after.inside for w, after in steps.items()} == {
        "leave a1": B2 | C2, "leave b2": A1 | C2, "leave c2": A1 | B2,
    }  # fmt: skip


def test_a_vehicle_that_enters_leaves_the_others_as_they_are() -> None:
    before = state(front("a1"), front("b1", COMMITTED, True), inside=C1, came=(1, 0))
    after = happens(protocol(priorities="waiting"), before)["enter b1"]
    assert after == state(front("a1"), inside=C1 | B1, came=(0,))


@pytest.mark.parametrize(
    ("inside", "pair"),
    [
        (0, None),
        (C2, None),
        (A1 | A2, None),  # one lane
        (A1 | B1 | C1, None),
        (B1 | C2, None),
        (A2 | B1, "a2 b1"),
        (A1 | C2, "a1 c2"),
        (A2 | B2 | C1, "b2 c1"),
        (B2 | C2, "b2 c2"),
    ],
)
def test_conflicts_inside(inside: int, pair: str | None) -> None:
    conflict = protocol().conflict(State((None,) * 3, inside))
    assert (conflict and " ".join(map(str, conflict))) == pair


def test_a_turn_ends_after_a_decision_or_when_no_vehicle_is_there() -> None:
    rules = protocol(priorities="rotating")
    steps = happens(rules, rules.start)
    assert steps["turn"] == rules.start._replace(turn=1)
    assert happens(rules, rules.start._replace(turn=2))["turn"].turn == 0
    waiting = state(front("a2"), front("b2"))
    assert "turn" not in happens(rules, waiting)
    decided = rules.look(waiting)
    assert (decided.decided, goes(rules, waiting)) == (True, "a")
    after = happens(rules, decided)["turn"]
    assert (after.turn, after.decided) == (1, False)
    assert goes(rules, after) == "b"  # a2 and b2 are in conflict, and it is b's turn
    assert rules.look(state(front("a1"))).decided
    frozen = state(front("a2"), inside=B2)  # no decision: b2 crosses
    assert not rules.look(frozen).decided
    assert not rules.look(state(inside=B2)).decided
    assert rules.look(rules.start) == rules.start
    assert rules.look(decided._replace(inside=B2)).decided  # it stays made
    assert not protocol().look(waiting).decided  # of no importance elsewhere
    assert "turn" not in happens(protocol(), protocol().start)


def test_after_its_turn_a_lane_comes_last_and_the_others_clockwise() -> None:
    rules = protocol(priorities="rotating")
    others = state(front("a2"), front("b2"), front("c2"))  # all in conflict
    assert [goes(rules, others._replace(turn=k)) for k in range(3)] == ["a", "b", "c"]
    assert goes(rules, state(front("a2"), front("b2"))._replace(turn=2)) == "a"


def test_the_first_to_come_goes_first() -> None:
    rules = protocol(priorities="waiting")
    steps = happens(rules, state(front("c2"), came=(2,)))
    after = steps["arrive a2"]
    assert after == state(front("c2"), front("a2"), came=(2, 0))
    assert goes(rules, after) == "c"
    assert goes(rules, after._replace(came=(0, 2))) == "a"
    assert goes(rules, state(front("b2"), front("c2"))) == "b"  # no lane came first: by name
