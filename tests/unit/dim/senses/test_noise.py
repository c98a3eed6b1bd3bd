"""Noisy perception: exact by default, repeatable, ordered, and wrong where it says so."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dim import Dim, NoisyPerception
from dim.perception import UNKNOWN, See, see_all
from dim.senses.noise import UNSIGNALLED, in_order, with_ego
from dim.senses.sight import Bodies
from minisim import simulate
from minisim.control import Observed, View
from minisim.testing import check_controller, small_scenario
from scenarios.strategies import floats
from tests.builders import seen

SITE = small_scenario(4).site(3)
WAITING = View(5.0, (seen(1, 0, 1, 2.1), seen(5, 0, 3, 8.2), seen(2, 1, 2, 2.1), seen(3, 2, 3, 2.1),
                     seen(4, 3, 1, 2.1)))  # fmt: skip

#: Everything at once.
ALL = NoisyPerception(
    0.15, "symmetric", shared=False, persistent=False, unsignalled=UNSIGNALLED, confidence=0.7,
    sensor_range=25.0, occlusion=True, delay=0.3, position_noise=0.5, speed_noise=0.5,
)  # fmt: skip


def intents(see: See, view: View, ego: int) -> dict[int, int]:
    sight = see(view, next(v for v in view.vehicles if v.id == ego))
    return {v.id: v.manoeuvre for v in sight.vehicles}


def crowd(count: int, time: float = 0.0) -> View:
    """Vehicles that wait on four lanes, all turning left; for counting errors."""
    vehicles = (seen(k, k * 4 // count, 1, 2.0 + k % (count // 4)) for k in range(count))
    return View(time, tuple(vehicles))


def test_without_errors_the_runs_are_those_of_exact_perception() -> None:
    """Also where senses are at work that never err, and vehicles look every 0.1 s."""
    scenario = small_scenario(4, density=350.0)
    exact = simulate(scenario, Dim(), 1).trips
    assert (NoisyPerception().period, NoisyPerception().start(SITE)) == (None, see_all)
    for perception in (
        NoisyPerception(sensor_range=1000.0),
        NoisyPerception(position_noise=1e-12),
        NoisyPerception(intent_error=1e-12, kind="symmetric"),
    ):
        assert perception.period == 0.1
        assert simulate(scenario, Dim(perception=perception), 1).trips.equals(exact)


@pytest.mark.parametrize(
    "given",
    [
        {"intent_error": 0.1}, {"unsignalled": (0.1, 0.0)}, {"unsignalled": (0.0, 0.1)},
        {"sensor_range": 50.0}, {"occlusion": True}, {"delay": 0.1}, {"position_noise": 0.1},
        {"speed_noise": 0.1},
    ],
)  # fmt: skip
def test_where_anything_may_err_vehicles_look_every_frame(given: dict[str, Any]) -> None:
    assert NoisyPerception(**given).period == 0.1
    assert NoisyPerception(**given, frame=0.2).period == 0.2
    assert NoisyPerception(confidence=0.9).period is None, "nothing to be unsure of"


def test_the_ego_sees_itself_as_it_is() -> None:
    see = ALL.start(SITE)
    for ego in WAITING.vehicles:
        assert ego in see(WAITING, ego).vehicles


def test_shared_errors_are_the_same_for_all_others() -> None:
    view, see = crowd(200), NoisyPerception(0.25).start(SITE)
    one, other = intents(see, view, 0), intents(see, view, 199)
    differ = {v for v in one if one[v] != other[v]}
    assert differ <= {0, 199}
    assert 20 <= sum(m != 1 for m in one.values()) <= 80  # 50 ± 5 standard deviations


def test_own_errors_are_independent() -> None:
    """Of 400 vehicles, 2·0.25·0.75 = 37.5 % are misread by exactly one of two: 150 ± 10."""
    view, see = crowd(400), NoisyPerception(0.25, shared=False).start(SITE)
    one, other = intents(see, view, 0), intents(see, view, 399)
    assert 110 <= sum(one[v] != other[v] for v in one) <= 190


def test_persistent_errors_last_and_fleeting_ones_do_not() -> None:
    lasting, fleeting = NoisyPerception(0.25), NoisyPerception(0.25, persistent=False)
    see = lasting.start(SITE)
    assert intents(see, crowd(400), 0) == intents(see, crowd(400, 60.0), 0)
    see = fleeting.start(SITE)
    now, soon, later = (intents(see, crowd(400, t), 0) for t in (0.0, 0.05, 0.1))
    assert now == soon  # the same frame
    assert 110 <= sum(now[v] != later[v] for v in now) <= 190


def test_a_frame_begins_on_time() -> None:
    """Also where 0.3 / 0.1 is less than 3, in floating point."""
    see = NoisyPerception(0.25, persistent=False).start(SITE)
    before, at, after = (intents(see, crowd(400, t), 0) for t in (0.25, 0.3, 0.35))
    assert before != at == after
    see = NoisyPerception(0.25, persistent=False, frame=0.5).start(SITE)
    start, end, following = (intents(see, crowd(400, t), 0) for t in (0.0, 0.45, 0.5))
    assert start == end != following


def test_a_late_reading_is_that_of_then() -> None:
    fleeting = NoisyPerception(0.25, persistent=False)
    see, late = fleeting.start(SITE), replace(fleeting, delay=0.2).start(SITE)
    intents(late, crowd(400, 0.0), 0)
    assert intents(late, crowd(400, 0.2), 0) == intents(see, crowd(400, 0.0), 0)


def test_the_order_of_looking_does_not_matter() -> None:
    """Readings belong to vehicles and frames, not to the order in which they are asked for."""
    perception = replace(ALL, delay=0.0)
    one, other = perception.start(SITE), perception.start(SITE)
    egos = WAITING.vehicles
    for time in (4.0, 4.3):
        other(WAITING._replace(time=time), egos[0])  # one more look
    forth = [one(WAITING, ego) for ego in egos]
    back = [other(WAITING, ego) for ego in reversed(egos)]
    assert forth == back[::-1]


def test_what_others_do_to_ids_changes_no_error() -> None:
    """An id depends on the arrivals on all lanes; lane and rank do not."""
    noisy = NoisyPerception(intent_error=0.5, shared=False, position_noise=1.0, speed_noise=1.0)
    places = list(enumerate(crowd(40).vehicles))
    renamed = View(0.0, tuple(v._replace(id=1000 - k) for k, v in places))
    see, again = noisy.start(SITE), noisy.start(SITE)
    for k, ego in places:
        seen_by, after = see(crowd(40), ego), again(renamed, renamed.vehicles[k])
        assert [v[1:] for v in seen_by.vehicles] == [v[1:] for v in after.vehicles]


def test_a_seed_is_a_run_of_its_own() -> None:
    perception = NoisyPerception(0.25)
    views = [intents(perception.start(small_scenario(4).site(s)), crowd(400), 0) for s in (1, 1, 2)]
    assert views[0] == views[1] != views[2]


def test_turns_without_signal_are_straight_on_for_all_others() -> None:
    see = NoisyPerception(unsignalled=(1.0, 0.0), shared=False).start(SITE)
    assert intents(see, WAITING, 3) == {1: 2, 5: 3, 2: 2, 3: 3, 4: 2}
    assert intents(see, WAITING, 1) == {1: 1, 5: 3, 2: 2, 3: 3, 4: 2}  # knows its own intent


def test_an_unsure_intent_is_unknown() -> None:
    see = NoisyPerception(0.25, "symmetric", confidence=1.0).start(SITE)
    assert set(intents(see, crowd(40), 0).values()) == {1, UNKNOWN}
    assert list(intents(see, crowd(40), 0).values()).count(1) == 1  # itself
    sure = NoisyPerception(0.25, "missed", confidence=1.0).start(SITE)
    read = intents(sure, crowd(400), 0)
    assert 60 <= list(read.values()).count(UNKNOWN) <= 140  # a signal that is seen is sure
    assert set(read.values()) == {1, UNKNOWN}


def test_at_the_end_of_its_range_a_vehicle_is_seen() -> None:
    ego, other = WAITING.vehicles[0], WAITING.vehicles[3]
    bodies = Bodies(SITE)
    one, two = bodies.body(ego), bodies.body(other)
    reach = math.hypot(one.x - two.x, one.y - two.y)
    for less, seen_by_ego in ((0.0, True), (1e-9, False)):
        see = NoisyPerception(sensor_range=reach - less).start(SITE)
        assert (other in see(WAITING, ego).vehicles) is seen_by_ego


def test_a_newcomer_sees_from_where_it_is() -> None:
    """Its own older view has no place for it; 6 m behind one, 14 m from the other."""
    see = NoisyPerception(delay=0.2, sensor_range=10.0).start(SITE)
    before = View(0.0, (seen(1, 0, 2, 2.0), seen(2, 1, 2, 2.0)))
    see(before, before.vehicles[0])
    now = View(0.2, (seen(1, 0, 2, 2.0), seen(3, 0, 1, 8.0), seen(2, 1, 2, 2.0)))
    assert [v.id for v in see(now, now.vehicles[1]).vehicles] == [1, 3]


def test_a_vehicle_inside_hides_those_behind_it() -> None:
    """A vehicle going straight on from b stands across the way between a and c."""
    ego, behind, across = seen(1, 0, 2, 2.0), seen(2, 2, 1, 6.0), seen(3, 1, 2, -9.0)
    see = NoisyPerception(occlusion=True).start(SITE)
    assert {v.id for v in see(View(0.0, (ego, behind)), ego).vehicles} == {1, 2}
    hidden = [
        distance
        for distance in range(16)
        if 2 not in {
            v.id
            for v in see(
                View(1.0 + distance, (ego, across._replace(distance=-float(distance)), behind)), ego
            ).vehicles
        }
    ]  # fmt: skip
    assert hidden
    assert hidden != list(range(16))


def test_a_late_view_is_the_one_of_then() -> None:
    see = NoisyPerception(delay=0.5).start(SITE)
    views = [View(k / 10, (seen(1, 0, 2, 8.0 - k), seen(2, 1, 2, 7.5 - k / 2))) for k in range(8)]
    sights = [see(view, view.vehicles[0]) for view in views]
    assert [len(s.vehicles) for s in sights] == [1, 1, 1, 1, 1, 2, 2, 2]  # none was seen yet
    assert sights[7].time == views[7].time
    assert sights[7].vehicles == (views[7].vehicles[0], views[2].vehicles[1])


def test_an_older_view_with_the_ego_in_its_place() -> None:
    a, b, d = seen(1, 0, 1, 2.0), seen(2, 1, 1, 2.0), seen(4, 3, 1, 2.0)
    older = (a, b, d)
    assert with_ego(older, b._replace(distance=1.0)) == older
    for lane, where in ((0, 1), (1, 2), (2, 2), (3, 3)):
        ego = seen(9, lane, 1, 9.0)
        assert with_ego(older, ego) == (*older[:where], ego, *older[where:])


@given(st.lists(st.tuples(st.integers(0, 3), floats(-20, 10)), min_size=1, max_size=8), st.data())
def test_lanes_stay_in_order(places: list[tuple[int, float]], data: st.DataObject) -> None:
    """No vehicle is invented, dropped or put before its leader; the ego stays where it is."""
    places.sort(key=lambda place: place[0])
    vehicles = tuple(seen(k, lane, 1, d) for k, (lane, d) in enumerate(places))
    ego = data.draw(st.sampled_from(vehicles))
    ordered = in_order(vehicles, ego)
    assert [(v.id, v.lane) for v in ordered] == [(v.id, v.lane) for v in vehicles]
    assert ego in ordered
    assert all(a.distance <= b.distance for a, b in pairwise(ordered) if a.lane == b.lane)
    assert in_order(ordered, ego) == ordered


def test_noise_has_the_spread_that_it_says() -> None:
    """Root mean square of 400 draws of N(0, σ): σ ± 4 standard errors, 4·σ/√800."""
    view = View(0.0, tuple(seen(k, 0, 1, 5.0 * k, 50.0) for k in range(400)))
    sight = NoisyPerception(position_noise=0.5, speed_noise=2.0).start(SITE)(view, view.vehicles[0])
    for spread, k in ((0.5, 3), (2.0, 4)):
        errors = [a[k] - b[k] for a, b in zip(sight.vehicles, view.vehicles, strict=True)]
        assert (sum(e * e for e in errors) / 400) ** 0.5 == pytest.approx(spread, rel=4 / 800**0.5)


@pytest.mark.parametrize(("noise", "field"), [("position_noise", 3), ("speed_noise", 4)])
def test_noise_is_new_each_frame_and_one_for_all_or_each_its_own(noise: str, field: int) -> None:
    def errors(perception: NoisyPerception, ego: int, time: float) -> list[float]:
        view = View(time, tuple(seen(k, 0, 1, 100.0 * k, 50.0) for k in range(50)))
        sight = perception.start(SITE)(view, view.vehicles[ego])
        return [round(a[field] - b[field], 6) for a, b in zip(sight[1], view[1], strict=True)][2:]

    alike, own = (NoisyPerception(**{noise: 0.5}, shared=shared) for shared in (True, False))
    assert errors(alike, 0, 0.0) == errors(alike, 1, 0.0) == errors(alike, 0, 0.05)
    assert errors(own, 0, 0.0) == errors(own, 0, 0.05)
    for one, other in (
        (errors(own, 0, 0.0), errors(own, 1, 0.0)),
        (errors(own, 0, 0.0), errors(own, 0, 0.1)),
        (errors(alike, 0, 0.0), errors(alike, 0, 0.1)),
    ):
        assert all(a != b for a, b in zip(one, other, strict=True))
        assert len(set(one)) == len(one), "each vehicle errs on its own"


def test_no_vehicle_seems_to_drive_backwards() -> None:
    view = View(0.0, tuple(seen(k, 0, 1, 5.0 * k) for k in range(100)))
    sight = NoisyPerception(speed_noise=2.0).start(SITE)(view, view.vehicles[0])
    assert min(v.speed for v in sight.vehicles) == 0.0


def test_unknown_stays_unknown() -> None:
    ego, other = seen(1, 0, 1, 2.0), Observed(2, 1, UNKNOWN, 2.0, 0.0, 5.0)
    sight = NoisyPerception(0.5).start(SITE)(View(0.0, (ego, other)), ego)
    assert sight.vehicles == (ego, other)


def test_the_contract() -> None:
    """All but the promise of no collision."""
    check_controller(Dim(perception=ALL), arms=(4,), horizon=60.0, collision_free=False)
