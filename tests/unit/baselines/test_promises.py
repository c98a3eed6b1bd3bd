"""Passages by messages that fail, on hand-made situations and in whole runs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

import minisim
from baselines import Platoons, Reservation, Slots
from baselines.flows import Flow, FlowSession
from baselines.manager import Slot
from baselines.reservation import ReservationSession
from minisim.channel import Channel
from minisim.control import (
    Advise,
    Command,
    Controller,
    Go,
    Hold,
    Observed,
    Radio,
    Report,
    Reserve,
    Session,
    Site,
    View,
)
from minisim.link import Linked
from scenarios import four_way
from tests.builders import ScriptedSession, seen

SITE = four_way(100, profile="fair").site(1)
ENTRY = SITE.intersection.approach_length
car = partial(seen, speed=14.0)
LATE = SITE.with_channel(Channel(latency=0.2, loss=0.1))


def answered(
    run: ReservationSession | FlowSession, time: float, *cars: Observed,
    holding: tuple[int, ...] = (), said: float | None = None, follows: bool = True,
) -> list[tuple[int, float]]:  # fmt: skip
    """The promises [s], if the vehicles in `holding` say at `said` that they hold one."""
    said = time if said is None else said
    reports = {it.id: Report(said, it.id in holding, follows) for it in cars}
    commands = run.decide(View(time, cars, reports))
    return [(it.vehicle, it.time) for it in commands if isinstance(it, Reserve)]


@pytest.mark.parametrize(
    ("make", "latency"),
    [(Reservation(), 0.0), (Reservation(), 2.0), (Slots(), 0.4), (Platoons(), 1.0)],
    ids=["reservation", "reservation, late", "slots", "platoons, late"],
)
def test_every_promise_comes_true_if_no_message_is_lost(
    make: Reservation | Flow, latency: float
) -> None:
    promised: dict[int, Slot] = {}

    @dataclass(frozen=True)
    class Kept:
        name: str = "kept"
        radio = Radio()

        def start(self, site: Site) -> Session:
            session = make.start(site)

            def decide(view: View) -> Iterable[Command]:
                commands = list(session.decide(view))
                promised.update(session.manager.slots)
                return commands

            return ScriptedSession(session.plan, decide)

    failing = Linked(Kept(), Channel(latency=latency, jitter=0.1))
    run = minisim.simulate(
        four_way(350, profile="fair", horizon=300.0), failing, 3, record="all"
    )  # fmt: skip
    assert len(promised) > 60
    assert "Hold" not in run.exchange
    for vehicle, slot in promised.items():
        track = run.trace[run.rows["id"][run.trace["row"]] == vehicle]
        track = track[(track["tick"] >= slot.start) & (track["tick"] <= slot.ends)]
        assert np.allclose(track["s"] - ENTRY, slot.s[: len(track)], atol=1e-3)


def test_a_promise_takes_effect_when_its_message_has_arrived() -> None:
    run = Reservation().start(LATE)
    assert answered(run, 1.0, car(1, 0, 2, 40.0), said=0.8) == [(1, pytest.approx(1.2))]
    slot = run.manager.slots[1]
    assert (slot.start, slot.s[0]) == (8, -40.0)


def test_a_passage_is_free_again_only_when_its_vehicle_says_so() -> None:
    run = Reservation().start(LATE)
    foe, other = car(1, 0, 2, 40.0), car(2, 1, 2, 38.0)
    assert answered(run, 0.0, foe) == [(1, pytest.approx(0.2))]
    assert answered(run, 0.2, foe, other) == []  # it may still get the message
    assert answered(run, 0.5, foe, other, said=0.2) == []
    assert answered(run, 0.5, foe, other, said=0.3) == [(2, pytest.approx(1.2))]  # a period later
    assert {*run.manager.slots} == {2}


def test_one_that_holds_it_keeps_it_and_no_hold_is_sent() -> None:
    run = Reservation().start(LATE)
    answered(run, 0.0, car(1, 0, 2, 40.0))
    late = car(1, 0, 2, 38.0)  # predicted at 33 m
    commands = run.decide(View(0.5, (late,), {1: Report(0.5, True)}))
    assert not any(isinstance(it, Go | Hold) for it in commands)
    assert {*run.manager.slots} == {1}


def test_a_vehicle_keeps_to_its_passage_within_half_the_buffer() -> None:
    run = Reservation(buffer=0.5).start(LATE)
    (promise,) = (it for it in run.decide(View(0.0, (car(1, 0, 2, 28.0),), {1: Report(0.0, False)}))
                  if isinstance(it, Reserve))  # fmt: skip
    slot = run.manager.slots[1]
    for off, kept in ((-3, False), (-2, True), (0, True), (2, True), (3, False)):
        assert promise.keeps(car(1, 0, 2, -float(slot.s[20 + off])), 2.0) is kept


def test_after_its_passage_a_holder_blocks_all_in_conflict_with_it() -> None:
    run = Reservation().start(LATE)
    stray, foe, friend = car(1, 0, 2, 3.0), car(2, 1, 2, 28.0), car(3, 2, 2, 28.0)
    assert answered(run, 9.0, stray, foe, friend, holding=(1,)) == [(3, pytest.approx(9.2))]


def test_a_vehicle_that_would_be_early_without_another_waits_until_that_is_sure() -> None:
    """a1 and c3 leave by one exit, and c3, from the farther lane, slows down a1 behind it."""
    run = Reservation(reach=150.0).start(LATE)
    manager, ahead = run.manager, car(1, 2, 3, 20.0, speed=8.0)
    assert answered(run, 0.0, ahead)
    slot = manager.slots[1]
    ahead = ahead._replace(distance=-float(slot.s[3]), speed=float(slot.v[3]))
    for distance in np.arange(30.0, 140.0):
        behind = car(2, 0, 1, float(distance))
        with_it, without = manager.predict(behind, 3, 2), manager.predict(behind, 3, 2, [1])
        assert with_it is not None
        assert without is not None
        if manager.fits(with_it, last=True) and not np.array_equal(with_it.s, without.s):
            break
    unheard = {1: Report(0.2, False), 2: Report(0.3, False)}
    heard = {1: Report(0.3, True), 2: Report(0.3, False)}
    for reports, granted in ((unheard, []), (heard, [2])):
        commands = run.decide(View(0.3, (behind, ahead), reports))
        assert [it.vehicle for it in commands if isinstance(it, Reserve)] == granted


def test_each_promise_that_was_not_heard_lets_the_next_take_effect_a_period_later() -> None:
    run, me = Reservation(period=0.5).start(LATE), car(1, 0, 2, 40.0, speed=0.0)
    effects = [answered(run, now, me)[0][1] - now for now in (0.0, 1.0, 3.0)]
    assert effects == pytest.approx([0.2, 0.7, 1.2])


def test_the_first_promise_to_another_vehicle_begins_where_the_last_one_succeeded() -> None:
    """After two that were not heard, it takes effect two periods later, and one once it was."""
    run, me = Reservation(period=0.5).start(LATE), car(1, 0, 2, 40.0, speed=0.0)
    for now in (0.0, 1.0, 3.0):
        answered(run, now, me)
    friend, later = car(2, 2, 2, 40.0, speed=0.0), car(3, 2, 2, 60.0, speed=0.0)
    assert answered(run, 3.0, me, friend) == [(2, pytest.approx(3.0 + 0.2 + 2 * 0.5))]
    assert answered(run, 5.0, me, friend, later, holding=(1, 2)) == [(3, pytest.approx(5.7))]


def test_a_promise_waits_until_its_vehicle_follows_the_advice_before() -> None:
    run = Slots(batch=1).start(LATE)
    cars = car(1, 0, 2, 90.0), car(2, 1, 2, 91.0)
    assert answered(run, 0.0, *cars, follows=False) == []
    assert [it for it, _ in answered(run, 0.5, *cars)] == [1]
    for time, follows in ((1.0, False), (1.5, True)):
        reports = {1: Report(time, True), 2: Report(time, False, follows)}
        commands = run.decide(View(time, cars, reports))
        assert [it.vehicle for it in commands if isinstance(it, Advise)] == [2] * follows


@pytest.mark.parametrize(
    ("make", "density", "loss", "most"),
    [(Reservation(), 250.0, 0.9, 20.0), (Slots(), 150.0, 0.6, 5.0), (Platoons(), 150.0, 0.6, 5.0)],
    ids=["reservation", "slots", "platoons"],
)
def test_loss_costs_seconds(make: Controller, density: float, loss: float, most: float) -> None:
    """Promises that are sent once cost 165 s at 90 % loss, and right of way one by one 18 s."""
    scenario = four_way(density, profile="fair", horizon=400.0)
    run = minisim.simulate(scenario, Linked(make, Channel(loss=loss)), 1)
    assert run.summary(["time_loss_s"])["time_loss_s"] < most
