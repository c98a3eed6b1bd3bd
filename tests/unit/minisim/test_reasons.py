"""Reasons: their sentences, and what is told of commands."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from minisim.control import (
    Accelerate,
    Advise,
    Close,
    Go,
    Hold,
    Observed,
    Open,
    Plan,
    Unregulated,
    View,
)
from minisim.reasons import KINDS, Reason, Shown, Witness
from scenarios import four_way
from tests.builders import ROOT, car, view


def witness(session: object = None) -> Witness:
    site = four_way(100).site(0)
    return Witness(site, session or Unregulated().start(site))  # type: ignore[arg-type]


class Held:
    """A session that opens no lane."""

    plan = Plan(lanes_open=False)

    def decide(self, view: View) -> list[object]:
        return []


def kinds(it: Witness) -> list[tuple[int, str, tuple[int, ...]]]:
    return [(told.reason.vehicle, told.reason.kind, told.reason.vehicles) for told in it.told]


def example(kind: str) -> Reason:
    """Of vehicle 7, as `docs/howto/reasons.md` shows it."""
    return Reason(kind, 7, (3, 5), ("a1", "c1"), 12.0, 20.0, "…")


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_makes_a_sentence(kind: str) -> None:
    for others in ((), (3,), (3, 4, 5)):
        said = Reason(kind, 7, others, ("a1", "c1"), 1.0, 2.5, "It is so.").sentence
        assert re.search(r"vehicle 7\b", said, re.IGNORECASE)
        assert said.endswith(".")
        assert "{" not in said
        assert "None" not in said


@pytest.mark.parametrize(
    ("others", "words"),
    [
        ((3,), "vehicle 3 is still inside."),
        ((3, 4), "vehicles 3 and 4 are still inside."),
        ((3, 4, 5), "vehicles 3, 4 and 5 are still inside."),
    ],
)
def test_a_sentence_agrees_with_how_many_there_are(others: tuple[int, ...], words: str) -> None:
    assert Reason("not clear", 7, others).sentence.endswith(words)


def test_a_signal_says_since_when_and_until_when_if_that_is_known() -> None:
    known = Reason("red", 1, since=10.0, until=20.5).sentence
    assert (
        known == "Vehicle 1 waits: its signal has been red since 10.0 s; it turns green at 20.5 s."
    )
    assert (
        Reason("red", 1, since=10.0).sentence
        == "Vehicle 1 waits: its signal has been red since 10.0 s."
    )


def test_as_a_dictionary_it_has_only_what_is_known() -> None:
    said = Reason("behind", 1, (2,)).as_dict()
    assert said == {
        "kind": "behind", "vehicle": 1, "vehicles": (2,),
        "sentence": "Vehicle 1 is behind vehicle 2 in its lane.",
    }  # fmt: skip


def test_commands_tell_which_vehicles_hold_the_right_of_way() -> None:
    it = witness(Held())
    a, b, behind = car(0, "a2", 5.0), car(1, "b2", 5.0), car(2, "b2", 12.0)
    it.look(view(a, b, behind))
    assert kinds(it) == [(0, "held", ()), (1, "held", ()), (2, "behind", (1,))]
    it.told.clear()
    it.note([Go(0)])
    it.look(view(a, b, behind, time=1.0))
    assert kinds(it) == [(0, "goes", ()), (1, "held for", (0,))]
    it.told.clear()
    it.note([Hold(0), Open(1)])
    it.look(view(a, b, behind, time=2.0))
    assert kinds(it) == [(0, "held for", (1, 2)), (1, "goes", ()), (2, "goes", ())]
    it.told.clear()
    it.note([Close(1), Go(1), Advise(1, 3.0)])
    inside = car(0, "a2", -3.0)
    it.look(view(inside, b, behind, time=3.0))
    assert kinds(it) == [(0, "crossing", ()), (1, "advised", ()), (2, "behind", (1,))]
    it.told.clear()
    it.note([Advise(1, math.inf), Accelerate(1, -1.0)])
    it.look(view(inside, b, behind, time=3.5))
    assert kinds(it) == [(1, "told", ())]
    assert it.told[0].reason.sentence == "Vehicle 1 is told to accelerate at -1.0 m/s²."
    it.told.clear()
    it.look(view(behind, time=4.0))
    assert kinds(it) == [(2, "held", ()), (0, "left", ()), (1, "left", ())]


def test_a_reason_is_written_down_only_when_it_changes() -> None:
    it = witness(Held())
    for step in range(5):
        it.look(view(car(0, "a2", 9.0 - step), time=float(step)))
    assert [told.time for told in it.told] == [0.0]


class Signals(Held):
    """A session whose heads are red but for one."""

    heads = ("red", "green", "red", "red")

    def green_from(self, lane: int, time: float) -> float | None:
        return time + 10.0 if lane == 0 else None


def test_heads_are_written_down_when_they_change_and_tell_since_when() -> None:
    session = Signals()
    it = witness(session)
    waiting: Observed = car(0, "a2", 2.0)
    it.look(view(waiting, time=5.0))
    session.heads = ("red", "amber", "red", "red")
    it.look(view(waiting, time=8.0))
    assert it.shown[4:] == [Shown(8.0, 1, "amber")]
    assert [(s.lane, s.state) for s in it.shown[:4]] == list(
        enumerate(("red", "green", "red", "red"))
    )
    assert it.told[0].reason == Reason("red", 0, since=5.0, until=15.0)


def test_the_page_has_all_kinds() -> None:
    page = Path(ROOT / "docs" / "howto" / "reasons.md").read_text()
    rows = re.findall(r"^\| ([a-z ]+) \| (.+) \|$", page, re.MULTILINE)
    table = {kind: said for kind, said in rows if kind != "kind"}
    assert table == {kind: example(kind).sentence for kind in KINDS}
