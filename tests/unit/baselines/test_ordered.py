"""Vehicles in an order: which one goes, and how fast the others come."""

from __future__ import annotations

import math

import pytest

import minisim
from baselines import Slots
from minisim.control import Advise, Command, Go, Observed, Unregulated, View, Wake
from scenarios import four_way
from tests.builders import car, replayed

FOUR = four_way(100, profile="fair")
SITE = FOUR.site(1)


def decide(*vehicles: Observed) -> set[Command]:
    """What is said to them by slots in the order in which they come, besides when to look again."""
    commands = Slots(batch=1).start(SITE).decide(View(0.0, vehicles))
    return {it for it in commands if not isinstance(it, Wake)}


def test_a_vehicle_that_has_to_wait_is_slowed_down_and_does_not_stop() -> None:
    scenario = replayed(FOUR, (0.0, 0, 2), (0.0, 1, 2), (0.0, 2, 3), (0.5, 3, 2), horizon=200.0)
    run = minisim.simulate(scenario, Slots())
    assert run.columns.arrived.all()
    assert run.columns.waiting_time.max() == 0.0


def test_the_first_goes_and_the_other_hears_how_fast() -> None:
    said = decide(car(1, "a2", 100.0, 14.0), car(2, "b2", 101.0, 14.0))
    assert {Go(1), Advise(1, math.inf)} < said
    (advice,) = said - {Go(1), Advise(1, math.inf)}
    assert isinstance(advice, Advise)
    assert advice.vehicle == 2
    assert 0.0 < advice.speed < 14.0


def test_vehicles_in_harmony_go_at_once_and_one_behind_a_holder_with_it() -> None:
    go = decide(car(1, "a2", 60.0, 14.0), car(2, "a2", 85.0, 14.0), car(3, "c2", 70.0, 14.0))
    assert {it.vehicle for it in go if isinstance(it, Go)} == {1, 2, 3}


def test_none_goes_before_one_in_conflict_that_has_to_wait_itself() -> None:
    """The third would be out of the way of the second, which cannot go before the first has."""
    said = decide(car(1, "a2", 60.0, 14.0), car(2, "b2", 61.0, 14.0), car(3, "c2", 62.0, 14.0))
    assert [it for it in said if isinstance(it, Go)] == [Go(1)]


@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
@pytest.mark.parametrize("mark", [0.0, 6.0])
def test_when_a_vehicle_comes_alone_is_foreseen(manoeuvre: int, mark: float) -> None:
    run = minisim.simulate(
        replayed(FOUR, (0.0, 0, manoeuvre), horizon=100.0), Unregulated(), record="all"
    )
    entry = SITE.intersection.approach_length
    start = run.trace[(run.trace["s"] > entry - 150.0) & (run.trace["s"] < entry - 148.0)][0]
    wanted = run.trace["tick"][(run.trace["s"] - entry).searchsorted(mark)]
    me = car(0, f"a{manoeuvre}", float(entry - start["s"]), float(start["v"]))
    manager = Slots().start(SITE).manager
    assert manager.alone(me, int(start["tick"]), mark) == wanted
