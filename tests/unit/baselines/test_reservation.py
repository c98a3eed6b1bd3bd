"""Reservation on hand-made situations: predictions, zones, grants, refusals, cancellations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import minisim
from baselines import Reservation
from baselines.manager import Slot
from baselines.prediction import Leader, courses, law_of, predict
from baselines.reservation import ReservationSession
from minisim.control import (
    Command,
    Go,
    Hold,
    Observed,
    Session,
    Site,
    Unregulated,
    View,
    Wake,
)
from minisim.errors import InputError
from minisim.junction.partings import branch
from minisim.laws import traits_of
from minisim.testing import SmallScenario
from minisim.vehicle import VehicleType
from scenarios import AS_RUN, FAIR, PAPER, four_way
from scenarios.profiles import Profile
from tests.builders import Scripted, ScriptedSession, replayed, seen

FAIR_FOUR = four_way(100, profile="fair")
SITE = FAIR_FOUR.site(1)
ENTRY = SITE.intersection.approach_length
car = partial(seen, speed=14.0)


def session(**options: Any) -> ReservationSession:
    return Reservation(**options).start(SITE)


def decide(run: ReservationSession, time: float, *cars: Observed) -> list[object]:
    return [c for c in run.decide(View(time, cars)) if not isinstance(c, Wake)]


@pytest.mark.parametrize("profile", [FAIR, PAPER], ids=lambda p: p.name)
@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
def test_predictions_are_what_minisim_does(profile: Profile, model: str, manoeuvre: int) -> None:
    """Two vehicles of one lane: the second follows, and turns where the first goes straight."""
    length, b = profile.vehicle.length, profile.vehicle.deceleration
    vehicle = VehicleType(length=length, deceleration=b, model=model)
    road = four_way(profile=Profile(name="test", vehicle=vehicle, speed_limit=profile.speed_limit))
    scenario = replayed(road, (0.0, 0, 2), (0.0, 0, manoeuvre), horizon=100.0)
    run = minisim.simulate(scenario, Unregulated(), record="all")
    site = run.site
    tracks = [run.trace[run.trace["row"] == row] for row in (0, 1)]
    now = int(tracks[1]["tick"][0]) + 300
    first, second = (track[track["tick"] >= now] for track in tracks)
    law, me, ways = law_of(site), traits_of(site.vehicle), courses(site)
    leader = predict(law, me, ways[1], first["s"][0] - ENTRY, first["v"][0])
    assert leader is not None
    assert np.allclose(leader.s, first["s"] - ENTRY, atol=1e-6)
    until = float(branch(site.intersection, site.vehicle)[1, manoeuvre - 1]) - ENTRY
    lane, start = [Leader(leader.s, leader.v, me.length, me.b_max, until)], second["s"][0] - ENTRY
    follower = predict(law, me, ways[manoeuvre - 1], start, second["v"][0], lane=lane)
    assert follower is not None
    assert np.allclose(follower.s, second["s"] - ENTRY, atol=1e-6)
    assert np.allclose(follower.v, second["v"], atol=1e-6)


def test_a_whole_queue_and_what_merges_with_it_are_predicted_to_the_last_step() -> None:
    """Every session's predictions, when each vehicle was let go, come true to a millimetre."""
    kept: dict[int, Slot] = {}

    @dataclass(frozen=True)
    class Kept:
        name: str = "kept"

        def start(self, site: Site) -> Session:
            session = Reservation().start(site)

            def decide(view: View) -> Iterable[Command]:
                commands = list(session.decide(view))
                kept.update(session.manager.slots)
                return commands

            return ScriptedSession(session.plan, decide)

    run = minisim.simulate(four_way(350, profile="fair", horizon=300.0), Kept(), 3, record="all")
    assert len(kept) > 80
    for vehicle, slot in kept.items():
        track = run.trace[run.rows["id"][run.trace["row"]] == vehicle]
        track = track[(track["tick"] >= slot.start) & (track["tick"] <= slot.ends)]
        assert np.allclose(track["s"] - ENTRY, slot.s[: len(track)], atol=1e-3)


@pytest.mark.parametrize("limit", [0.5, 100.0])
def test_a_vehicle_is_predicted_until_it_arrives_however_long_that_takes(limit: float) -> None:
    site = replace(SITE, speed_limit=limit)
    way = courses(site)[1]
    motion = predict(law_of(site), traits_of(site.vehicle), way, -5.0, 0.0)
    assert motion is not None
    assert motion.s[-1] == pytest.approx(way.end, abs=limit * site.dt)


def test_a_vehicle_that_hits_a_leader_is_not_predicted() -> None:
    me = traits_of(SITE.vehicle)
    standing = Leader(np.full(100, 3.0), np.zeros(100), me.length, me.b_max)
    assert predict(law_of(SITE), me, courses(SITE)[0], -3.0, 14.0, lane=[standing]) is None


def test_the_first_to_ask_gets_it_and_one_that_would_meet_it_does_not() -> None:
    run = session()
    assert decide(run, 0.0, car(1, 0, 2, 28.0)) == [Go(1)]
    slot = run.manager.slots[1]
    again = car(1, 0, 2, -float(slot.s[5]), speed=float(slot.v[5]))
    assert decide(run, 0.5, again, car(2, 1, 2, 26.0)) == []
    assert list(run.manager.slots) == [1]


def test_harmony_is_granted_at_once() -> None:
    assert decide(session(), 0.0, car(1, 0, 2, 28.0), car(2, 2, 2, 28.0)) == [Go(1), Go(2)]


def test_a_passage_well_before_or_after_is_granted() -> None:
    run = session(reach=120.0)
    assert decide(run, 0.0, car(1, 0, 2, 110.0), car(2, 1, 2, 20.0)) == [Go(1), Go(2)]
    late, early = run.manager.slots[1], run.manager.slots[2]
    assert late.zones[early.movement][0] >= early.zones[late.movement][1] + 5  # 0.5 s


def test_the_buffer_is_kept() -> None:
    """b2 ever further behind a2: refused until it comes half a second later."""
    gaps = []
    for distance in np.arange(20.0, 80.0, 1.0):
        run = session(reach=100.0)
        decide(run, 0.0, car(1, 0, 2, 20.0))
        if decide(run, 0.0, car(1, 0, 2, 20.0), car(2, 1, 2, float(distance))):
            first, second = run.manager.slots[1], run.manager.slots[2]
            gaps.append(second.zones[1][0] - first.zones[4][1])
    assert 5 <= min(gaps) <= 6


def test_into_one_exit_lane_no_vehicle_goes_before_an_earlier_holder() -> None:
    """b1 could turn south long before a2, which is far away, gets there: it may not overtake."""
    for turn, granted in ((1, []), (2, [Go(2)])):  # into another exit it goes
        run = session(reach=150.0)
        assert decide(run, 0.0, car(1, 0, 2, 140.0)) == [Go(1)]
        assert decide(run, 0.0, car(1, 0, 2, 140.0), car(2, 1, turn, 5.0, speed=5.0)) == granted


def test_a_follower_asks_only_behind_a_holder() -> None:
    run = session()
    decide(run, 0.0, car(1, 1, 2, 20.0))
    cars = (car(2, 0, 2, 21.0), car(3, 0, 1, 28.5))
    assert decide(run, 0.0, *cars, car(1, 1, 2, 20.0)) == []  # a2 is refused, so a1 may not ask
    assert decide(session(), 0.0, *cars) == [Go(2), Go(3)]


def test_requests_are_considered_in_the_order_of_the_first() -> None:
    run = session()
    decide(run, 0.0, car(1, 2, 2, 20.0))  # holds
    blocked = (car(2, 1, 2, 24.0), car(1, 2, 2, 20.0))
    assert decide(run, 0.0, *blocked) == []
    # c2 is gone; b2 asked first, a2 (nearer, earlier in the view) conflicts with it.
    run.manager.slots.clear()
    assert decide(run, 1.0, car(3, 0, 2, 15.0, speed=5.0), car(2, 1, 2, 18.0, speed=5.0)) == [Go(2)]


def test_a_holder_that_differs_is_predicted_anew_and_keeps_what_still_fits() -> None:
    run = session()
    decide(run, 0.0, car(1, 0, 2, 28.0))
    assert decide(run, 0.5, car(1, 0, 2, 23.0, speed=10.0)) == []
    assert run.manager.slots[1].start == 5
    assert run.manager.slots[1].v[0] == 10.0


def just_behind(*cars: Observed) -> tuple[ReservationSession, Observed]:
    """A session in which the cars and the nearest b2 that can follow them hold reservations."""
    for distance in np.arange(30.0, 140.0, 1.0):
        run, last = session(reach=150.0), car(9, 1, 2, float(distance))
        decide(run, 0.0, *cars)
        if decide(run, 0.0, *cars, last) == [Go(9)]:
            return run, last
    raise AssertionError("b2 is never granted")


def test_a_late_holder_that_no_longer_fits_is_held_when_it_can_stop() -> None:
    run, other = just_behind(car(1, 0, 2, 40.0))
    on_time = car(9, 1, 2, other.distance - 7.0)
    assert decide(run, 0.5, car(1, 0, 2, 40.0), on_time) == [Hold(1)]  # predicted at 33 m
    assert set(run.manager.slots) == {9}


def test_a_vehicle_that_cannot_stop_keeps_its_reservation_and_the_other_yields() -> None:
    """21.8 m are needed to stop from 14 m/s; the other is as predicted, and still loses its own."""
    run, other = just_behind(car(1, 0, 2, 28.0))
    late = car(1, 0, 2, 21.5)  # predicted at 14 m
    on_time = car(9, 1, 2, other.distance - 14.0)
    assert decide(run, 1.0, late, on_time) == [Hold(9)]
    assert set(run.manager.slots) == {1}


def test_with_its_leader_a_follower_loses_its_reservation() -> None:
    """a2 is late for b2; a1 behind it is in harmony with b2, and cannot pass a2."""
    first, follower = car(1, 0, 2, 40.0), car(3, 0, 1, 65.0)
    run, other = just_behind(first, follower)
    on_time = car(9, 1, 2, other.distance - 7.0)
    assert not SITE.conflicts[0, 4]  # a1 and b2
    assert decide(run, 0.5, first, car(3, 0, 1, 58.0), on_time) == [Hold(1), Hold(3)]
    assert set(run.manager.slots) == {9}


def test_a_passage_that_brakes_hard_for_a_leader_from_another_lane_is_refused() -> None:
    """c3 and a1 leave by one exit; on their arcs they would be beside each other at first."""
    scenario = replayed(FAIR_FOUR, (0.0, 2, 3), (0.0, 0, 1), horizon=100.0)
    run = minisim.simulate(scenario, Reservation(), record="all")
    assert run.columns.arrived.all()
    assert run.trace["a"].min() == pytest.approx(-FAIR.vehicle.deceleration)


def test_vehicles_that_follow_krauss_at_long_headways_and_coarse_steps_do_not_collide() -> None:
    """Predicted by the IDM, d3 and c2 collided at 105 s."""
    vehicle = VehicleType(model="krauss", deceleration=0.5, headway=10.0, min_gap=20.0)
    profile = Profile(name="test", vehicle=vehicle, speed_limit=100.0, dt=0.25)
    scenario = four_way(350, profile=profile, arm_length=80.0, horizon=300.0)
    minisim.simulate(scenario, Reservation(), seed=1)  # a collision raises


def test_vehicles_that_could_pass_the_limit_within_a_step_do_not_collide() -> None:
    """At 22.9 m/s² and steps of 0.5 s, a2 reached 14 m/s at a limit of 10 and hit b2 at 30 s."""
    vehicle = VehicleType(
        model="iidm", acceleration=22.9, deceleration=0.1, min_gap=4.32, max_deceleration=2.0
    )
    scenario = SmallScenario(
        bearings=(0.0, 75.0, 190.0, 260.0), density=1200.0, demand_time=15.0, drain=35.0,
        arm_length=150.0, vehicle=vehicle, speed_limit=9.92, dt=0.5,
    )  # fmt: skip
    run = minisim.simulate(scenario, Reservation(), 2, record="all")  # a collision raises
    assert run.trace["v"].max() <= 9.92 + 1e-9


@pytest.mark.parametrize("profile", [FAIR, PAPER], ids=lambda p: p.name)
def test_no_vehicle_brakes_harder_than_its_law_does(profile: Profile) -> None:
    """In 7-9 % of the trips the brakes did all they can; the law needs a quarter more than b."""
    scenario = four_way(350, profile=profile, horizon=900.0)
    run = minisim.simulate(scenario, Reservation(), 1, record="all")
    assert run.trace["a"].min() >= -1.3 * profile.vehicle.deceleration


def test_no_delay_at_low_demand_and_less_than_the_all_way_stop_at_350() -> None:
    """SUMO's all-way stop with 1 s of hold loses 7.6 s at 350 veh/h/lane; a lone turn 1–2 s."""
    quiet, rush = four_way(10, profile="fair"), four_way(350, profile="fair", horizon=1800.0)
    run = minisim.simulate(quiet, Reservation(), seed=1)
    free = minisim.simulate(quiet, Unregulated(), seed=1, on_collision="record")
    assert run.summary()["time_loss_s"] - free.summary()["time_loss_s"] < 0.3
    assert run.summary()["waiting_time_s"] < 0.05
    busy = minisim.simulate(rush, Reservation(), seed=1)
    assert busy.summary()["time_loss_s"] < 5.9  # the all-way stop without any hold


@pytest.mark.parametrize(
    ("profile", "got"),
    [
        (AS_RUN, "model 'cc'"),
        (replace(FAIR, vehicle=VehicleType(speed_deviation=0.1)), "speed_deviation of 0.1"),
    ],
)
def test_vehicles_that_cannot_be_predicted_are_refused(profile: Profile, got: str) -> None:
    with pytest.raises(InputError, match=rf"reservation is for .* alike.*, got .*{got}"):
        Reservation().start(four_way(profile=profile).site(0))


def test_by_default_they_ask_as_late_as_they_can() -> None:
    assert session().plan.sight == pytest.approx(14.0**2 / 9.0 + 7.0)


@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
@pytest.mark.parametrize("released", [33.0, 34.5, 50.0])
def test_a_vehicle_that_is_held_for_a_while_is_predicted(model: str, released: float) -> None:
    """Let go before it brakes for its line, while it does, and as it stands there."""
    profile = Profile(name="test", vehicle=VehicleType(model=model), speed_limit=14.0)
    scenario = replayed(four_way(profile=profile), (0.0, 0, 2), horizon=120.0)
    first = [Wake(released)]

    def answer(view: View) -> list[Command]:
        return [Go(0)] if view.time else [*first]

    run = minisim.simulate(scenario, Scripted(answer), record="all")
    track = run.trace[run.trace["tick"] >= 320]
    law, me, way = law_of(run.site), traits_of(run.site.vehicle), courses(run.site)[1]
    held = round(released / run.site.dt) - 320
    motion = predict(law, me, way, track["s"][0] - ENTRY, track["v"][0], held=held)
    assert motion is not None
    assert np.allclose(motion.s[: len(track)], track["s"] - ENTRY, atol=1e-6)
    slowest = {33.0: 14.0, 34.5: 8.5, 50.0: 0.0}[released]
    assert track["v"].min() == pytest.approx(slowest, abs=0.7)
