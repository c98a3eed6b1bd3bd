"""What wrong perception does is counted, and counting changes nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dim import Dim, Mixed, Monitor, NoisyPerception, Perception
from dim.controller import DimSession
from minisim import simulate
from minisim.control import Observed, Session, View
from minisim.testing import small_scenario
from tests.builders import Reading, said, seen

SITE = small_scenario(4).site(0)
NONE = {"crossings": 0, "false_grants": 0, "disagreement_s": 0.0, "deadlock_s": 0.0}


def told(readings: dict[tuple[int, int], int] | None = None) -> Reading:
    """Observers read another's manoeuvre as told: (observer, vehicle) -> read."""
    wrong = readings or {}
    return Reading(lambda _, ego, v: wrong.get((ego.id, v.id), v.manoeuvre))


def session(perception: Perception, **rules: Any) -> DimSession:
    return Dim(perception=perception, **rules).start(SITE)


def show(session: Session, time: float, *vehicles: Observed) -> str:
    return ", ".join(said(session.decide(View(time, vehicles))))


def test_exact_perception_counts_nothing() -> None:
    assert Dim(perception=NoisyPerception()).start(SITE).counts == {}
    assert simulate(small_scenario(4, demand_time=60.0), Dim(), 1).counts == {}


def test_counting_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = small_scenario(4, demand_time=200.0)
    dim = Dim(perception=NoisyPerception(0.2, "symmetric", shared=False))
    counted = simulate(scenario, dim, 1, on_collision="record")
    monkeypatch.setattr("dim.senses.tally.Tally.count", lambda *_: None)
    assert simulate(scenario, dim, 1, on_collision="record").trips.equals(counted.trips)
    assert counted.counts["crossings"] > 0


@pytest.mark.parametrize(
    "dim", [Dim(), Dim(gate="harmonious"), Dim(order="lanes"), Dim(priorities="waiting"),
            Dim(monitor=Monitor()), Mixed(), Mixed(share=1.0)]
)  # fmt: skip
def test_right_readings_have_nothing_to_count(dim: Dim | Mixed) -> None:
    """But the crossings: all vehicles, human drivers too, have crossed at the end."""
    if isinstance(dim, Mixed):
        dim = replace(dim, dim=replace(dim.dim, perception=told()))
    else:
        dim = replace(dim, perception=told())
    run = simulate(small_scenario(4, drain=300.0), dim, 1)
    assert run.counts == {**NONE, "crossings": len(run.columns.lane)}
    assert np.all(run.columns.arrived)


def test_wrong_readings_are_counted_among_human_drivers() -> None:
    scenario = small_scenario(4, density=250.0, demand_time=600.0)
    dim = Dim(perception=NoisyPerception(0.25, "symmetric"))
    none, few = (
        simulate(scenario, Mixed(dim, share), 1, on_collision="record").counts
        for share in (0.0, 0.3)
    )
    assert none == simulate(scenario, dim, 1, on_collision="record").counts
    assert 0 < few["false_grants"] < few["crossings"]
    assert few["disagreement_s"] > 0.0


def test_a_right_of_way_that_the_truth_does_not_give_is_false() -> None:
    """a2 and b2 conflict, a goes; b takes a for a left turn, which is in harmony with b2."""
    tally = session(told({(2, 1): 1}))
    waiting = seen(1, 0, 2, 2.1), seen(2, 1, 2, 2.1)
    assert show(tally, 0.0, *waiting) == "Go 1, Go 2"
    assert tally.counts == {**NONE, "false_grants": 1}
    show(tally, 0.1, *waiting)  # the same one
    assert tally.counts["false_grants"] == 1
    assert tally.counts["disagreement_s"] == 0.1


def test_a_right_of_way_that_is_not_given_back_is_false() -> None:
    """b2 and d2 outvote a1, but a reads b2 as b1, with which it goes."""
    tally = session(told({(1, 2): 1, (1, 4): 1}))
    assert show(tally, 0.0, seen(1, 0, 2, 2.1)) == "Go 1"
    assert tally.counts["false_grants"] == 0
    three = seen(1, 0, 2, 2.1), seen(2, 1, 2, 2.1), seen(4, 3, 2, 2.1)
    assert "Hold 1" not in show(tally, 0.1, *three)
    assert tally.counts["false_grants"] == 1


def test_one_wrong_reading_can_stop_all_vehicles() -> None:
    """a2, b2 and d3 all conflict, so a goes; but a reads d as d2, which goes with b2."""
    trio = seen(1, 0, 2, 2.1), seen(2, 1, 2, 2.1), seen(4, 3, 3, 2.1)
    assert show(session(told()), 0.0, *trio) == "Go 1"
    tally = session(told({(1, 4): 2}))
    assert show(tally, 0.0, *trio) == ""
    assert show(tally, 2.5, *trio) == ""
    assert tally.counts == {**NONE, "deadlock_s": 2.5, "disagreement_s": 2.5}


def test_times_are_rounded_to_a_microsecond() -> None:
    """0.1 + 0.2 is 0.3; in floating point, a bit more."""
    tally = session(told({(1, 4): 2}))
    for time in (0.0, 0.1, 0.1 + 0.2):
        show(tally, time, seen(1, 0, 2, 2.1), seen(2, 1, 2, 2.1), seen(4, 3, 3, 2.1))
    assert tally.counts == {**NONE, "deadlock_s": 0.3, "disagreement_s": 0.3}
    show(tally, 1.3000001, seen(1, 0, 2, 2.1), seen(2, 1, 2, 2.1), seen(4, 3, 3, 2.1))
    assert tally.counts == {**NONE, "deadlock_s": 1.3, "disagreement_s": 1.3}


def test_crossings_are_counted_however_rarely_one_looks() -> None:
    tally = session(told())
    show(tally, 0.0, seen(1, 0, 2, 2.1), seen(2, 1, 2, 2.1))
    show(tally, 1.0, seen(1, 0, 2, -3.0), seen(2, 1, 2, 2.1))
    assert tally.counts["crossings"] == 1
    show(tally, 9.0)  # both have left
    assert tally.counts["crossings"] == 2


def test_a_vehicle_at_the_entry_has_not_crossed_it() -> None:
    tally = session(told())
    for time, distance, crossings in ((0.0, 2.1, 0), (1.0, 0.5, 0), (2.0, 0.0, 0), (3.0, -0.1, 1)):
        show(tally, time, seen(1, 0, 2, distance))
        assert tally.counts["crossings"] == crossings


def test_counting_begins_with_the_first_view_and_at_the_yellow_zone() -> None:
    for distance, crossings in ((8.0, 1), (8.001, 0)):  # that leaves between two looks
        tally = session(told())
        show(tally, 5.0, seen(1, 0, 2, distance, 5.0))
        show(tally, 9.0)
        assert tally.counts == {**NONE, "crossings": crossings}


@pytest.mark.parametrize(("gate", "lasts"), [("clear", 0.0), ("harmonious", 2.5)])
def test_a_vehicle_that_must_wait_anyway_does_not_disagree(gate: str, lasts: float) -> None:
    """While c1 crosses, no other enters by the paper's gate; a reads d1 as d3."""
    views = [
        (time, seen(1, 0, 1, 2.1), seen(2, 1, 1, 2.1), seen(3, 2, 1, -3.0, 5.0),
         seen(4, 3, 1, 2.1))
        for time in (0.0, 2.5)
    ]  # fmt: skip
    tally = session(told({(1, 4): 3}), gate=gate)
    for view in views:
        show(tally, *view)
    assert tally.counts["disagreement_s"] == lasts


@pytest.mark.parametrize("confidence", [None, 0.9])
def test_lanes_first_never_blocks_on_wrong_intents(confidence: float | None) -> None:
    """The first lane that takes part is in the clique of every case: it always goes."""
    scenario = small_scenario(4, density=250.0, demand_time=600.0)
    wrong = NoisyPerception(0.25, "symmetric", shared=False, confidence=confidence)
    size, lanes = (
        simulate(scenario, Dim(order=order, perception=wrong), 1, on_collision="record")
        for order in ("size", "lanes")
    )
    assert size.counts["deadlock_s"] > 100.0
    assert lanes.counts["deadlock_s"] == 0.0
