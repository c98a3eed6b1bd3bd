"""The safety monitor: what another may do, how hard to brake, which goes first, its effect."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

import minisim
from dim import Dim, HarmonyMatrix, Monitor, NoisyPerception
from dim.monitor import ROOM, Monitors
from dim.perception import UNKNOWN
from minisim.control import Brake, Go, Observed, View, Wake
from minisim.junction.coordination import STEP, Region, passes, region
from minisim.junction.movements import Movement
from minisim.junction.partings import showing
from minisim.results.run import Run
from scenarios import four_way
from tests import builders
from tests.builders import Reading, drained, replayed, view

SCENARIO = four_way(250, profile="fair", arm_length=150.0)
SITE = SCENARIO.site(0)
PLACE = SITE.intersection, SITE.vehicle
MATRIX = HarmonyMatrix.from_geometry(SITE.intersection, SITE.vehicle)
A2, B2 = MATRIX.index("a2"), MATRIX.index("b2")
SIGHT = 8.0


def car(vehicle: int, movement: str, past: float, speed: float) -> Observed:
    """A vehicle whose front is so far past the entry [m]."""
    return builders.car(vehicle, movement, -past, speed)


def regions(p: int, q: int) -> tuple[Region, Region]:
    """The forbidden region of two movements, seen from the first and from the second."""
    shared, mirrored = region(*PLACE, p, q), region(*PLACE, q, p)
    assert shared is not None
    assert mirrored is not None
    return shared, mirrored


def started(**options: float) -> Monitors:
    return Monitor(**options).start(SITE, MATRIX, SIGHT)


def read_as(seen: View, **readings: int) -> View:
    """What is seen where the vehicles of a lane are read to want this manoeuvre."""
    return View(
        seen.time,
        tuple(v._replace(manoeuvre=readings.get("abcd"[v.lane], v.manoeuvre)) for v in seen[1]),
    )


def braking(
    watch: Monitors, true: View, seen: dict[int, View] | None = None, going: set[int] | None = None
) -> dict[int, float]:
    """Vehicle -> how hard it must brake, where all see everything unless `seen` says otherwise."""
    everything = {v.id: true for v in true.vehicles}
    ids = set(everything)
    commands = list(watch.look(true, everything | (seen or {}), ids if going is None else going))
    assert all(isinstance(command, Brake) for command in commands)
    return {command.vehicle: command.deceleration for command in commands}


def test_a_reading_holds_as_long_as_motion_does_not_contradict_it() -> None:
    """a3 is read as a2, in harmony with c2, until it is 0.3 m beside that path."""
    shows = showing(SITE.intersection, 0.3)[2, 1]
    for past in (0.0, 1.0, shows - 0.01, shows + 0.01, 4.0):
        true = view(car(1, "a3", past, 6.0), car(2, "c2", past, 6.0))
        told = braking(started(), true, {2: read_as(true, a=2)})
        assert (2 in told) == (past > shows), past
        assert 1 in told, "the other has read c2 right"


def test_a_reading_that_changes_is_a_doubt() -> None:
    monitors = started()
    true = view(car(1, "a2", 0.5, 6.0), car(2, "c2", 2.0, 6.0))
    assert braking(monitors, true) == {}
    assert 2 in braking(monitors, true, {2: read_as(true, a=3)})
    assert braking(monitors, true, {2: read_as(true, a=2)}) == {}, "no change: it still brakes"
    assert 2 in braking(started(), true, {2: read_as(true, a=UNKNOWN)}), "any manoeuvre"


def test_an_unknown_intent_is_one_of_its_own_lane() -> None:
    """Whatever comes out of lane d keeps clear of a left turn from c, unlike what comes from a."""
    for past in (-0.5, 0.5):
        true = view(car(1, "c1", 2.0, 6.0), car(2, "d1", past, 6.0))
        assert braking(started(), true, {1: read_as(true, d=UNKNOWN)}) == {}


def test_a_vehicle_that_is_not_seen_is_not_braked_for() -> None:
    true = view(car(1, "a3", 2.0, 6.0), car(2, "c2", 2.0, 6.0))
    blind = view(car(2, "c2", 2.0, 6.0))
    assert set(braking(started(), true, {2: blind})) == {1}


def test_a_vehicle_that_can_stop_before_the_junction_endangers_none() -> None:
    true = view(car(1, "a3", 2.0, 6.0), car(2, "c2", -4.0, 5.0))
    assert braking(started(), true, going=set()) == {}


def test_it_brakes_as_hard_as_it_takes_from_comfortable_on() -> None:
    """v²/2d before the conflict area, and not at all while less than b will do."""
    shared, _ = regions(A2, B2)
    room, v, b = shared.room(0.0, 3.0), 5.0, SITE.vehicle.deceleration
    for left in np.arange(1.75, room, STEP).tolist():
        true = view(car(1, "a2", room - left, v), car(2, "b2", 3.0, 5.0))
        needed = v * v / (2.0 * (shared.room(room - left, 3.0) - ROOM))
        told = braking(started(), true).get(1, 0.0)
        if told:
            assert told == pytest.approx(max(needed, b))
            assert needed > 0.6 * b, "one step more at full acceleration would take more than b"
        else:
            assert needed < b


def test_a_vehicle_that_is_out_in_good_time_goes_on() -> None:
    """Leaving at its speed, the other coming at full acceleration: the margin is between."""
    shared, mirrored = regions(A2, B2)
    x, v, y, w, a = 14.0, 9.0, -2.2, 4.6, SITE.vehicle.acceleration
    leaves = (shared.ends(y) - x) / v
    room = mirrored.room(y, x)
    comes = (math.sqrt(w * w + 2.0 * a * room) - w) / a
    assert 0.3 < comes - leaves < 2.0
    true = view(car(1, "a2", x, v), car(2, "b2", y, w))
    assert 1 not in braking(started(time_margin=comes - leaves - 0.01), true)
    assert 1 in braking(started(time_margin=comes - leaves + 0.01), true)


@pytest.mark.parametrize("v", [1.0, 4.0])
def test_it_brakes_when_one_more_step_would_take_more_than_comfort(v: float) -> None:
    """That step at full acceleration, then v²/2b, and `ROOM`."""
    shared, _ = regions(A2, B2)
    after, other = v + SITE.vehicle.acceleration * SITE.dt, car(2, "b2", 3.0, 5.0)
    for options, b in (({}, SITE.vehicle.deceleration), ({"deceleration": 3.1}, 3.1)):
        needed = (v + after) / 2.0 * SITE.dt + after * after / (2.0 * b) + ROOM
        x = shared.room(0.0, 3.0) - needed
        assert x > 0.0
        assert 1 not in braking(started(**options), view(car(1, "a2", x - 1e-3, v), other))
        assert braking(started(**options), view(car(1, "a2", x + 1e-3, v), other))[1] == b


def test_a_vehicle_stops_before_the_junction_while_it_can() -> None:
    """There it blocks no vehicle that clears the junction; the conflict area begins later."""
    a, b, dt, v = SITE.vehicle.acceleration, SITE.vehicle.deceleration, SITE.dt, 5.0
    after = v + a * dt
    needed = (v + after) / 2.0 * dt + after * after / (2.0 * b) + ROOM
    other = car(2, "b2", 3.0, 5.0)
    assert 1 not in braking(started(), view(car(1, "a2", -needed - 1e-3, v), other))
    told = braking(started(), view(car(1, "a2", -needed + 1e-3, v), other))[1]
    assert told == pytest.approx(max(b, v * v / (2.0 * (needed - ROOM))))


@pytest.mark.parametrize("look_ahead", [1.0, 4.0])
def test_too_late_to_stop_it_does_what_does_not_touch(look_ahead: float) -> None:
    """Brake as hard as possible, unless only going on avoids a touch; all positions."""
    shared, mirrored = regions(A2, B2)
    a, most = SITE.vehicle.acceleration, SITE.vehicle.max_deceleration
    v, w, t = 6.0, 5.0, np.arange(0.0, look_ahead, SITE.dt)
    rolling = np.minimum(t, v / most)
    answers = set()
    for x, y in itertools.product(np.arange(0.1, 15.0, 0.5), np.arange(0.1, 15.0, 0.5)):
        room = shared.room(x, y)
        comes = (math.sqrt(w * w + 2.0 * a * mirrored.room(y, x)) - w) / a
        in_time = (shared.ends(y) - x) / v + 1.0 < comes
        if room == math.inf or in_time or v * v <= 2.0 * most * (room - ROOM):
            continue
        brakes = shared.touches(x + v * rolling - most / 2.0 * rolling**2, y + w * t)
        goes = shared.touches(x + v * t + a / 2.0 * t**2, y + w * t)
        true = view(car(1, "a2", float(x), v), car(2, "b2", float(y), w))
        told = braking(started(look_ahead=look_ahead), true).get(1, 0.0)
        assert told == (0.0 if brakes and not goes else most), (x, y)
        answers.add(told)
    assert answers == {0.0, most}, "both occur"


def test_a_vehicle_that_stands_right_before_the_area_stays_there() -> None:
    """No division by the room that is left, which is none."""
    shared, _ = regions(A2, B2)
    ego = car(1, "a2", shared.room(0.0, 3.0) - ROOM, 0.0)
    assert shared.room(-ego.distance, 3.0) == ROOM
    told = braking(started(), view(ego, car(2, "b2", 3.0, 5.0)))
    assert told[1] == SITE.vehicle.max_deceleration


def test_it_is_told_when_it_may_stop_braking_and_nothing_twice() -> None:
    monitors = started()
    other, ego = car(1, "a2", 2.0, 6.0), car(2, "b2", 2.0, 6.0)
    assert braking(monitors, view(ego, other))[2] > 0.0
    assert braking(monitors, view(ego, other)) == {}
    assert braking(monitors, view(ego)) == {2: 0.0}
    assert braking(monitors, view(ego)) == {}


def test_it_is_needed_where_two_lanes_may_meet() -> None:
    standing = car(3, "c2", -2.25, 0.0)
    for cars, going, needed in (
        ([car(1, "a2", 2.0, 5.0)], set(), False),
        ([car(1, "a2", 9.0, 5.0), car(2, "a3", 2.0, 5.0)], set(), False),
        ([car(1, "a2", 2.0, 5.0), car(2, "c2", 2.0, 5.0)], set(), True),
        ([car(1, "a2", 2.0, 5.0), standing], set(), False),
        ([car(1, "a2", 2.0, 5.0), standing], {3}, True),
    ):
        monitors = started()
        braking(monitors, view(*cars), going=going)
        assert monitors.needed is needed, (cars, going)


def conflicting() -> list[Any]:
    """Every two movements in conflict; those without lane a are rotations of others."""
    m = MATRIX.movements
    return [
        pytest.param(p, q, marks=pytest.mark.slow if m[p].origin else ())
        for p, q in itertools.product(range(len(m)), repeat=2)
        if m[p].origin < m[q].origin and not MATRIX.values[p, q]
    ]


@pytest.mark.parametrize(("p", "q"), conflicting())
def test_of_two_that_stand_one_goes_on_wherever_they_stand(p: int, q: int) -> None:
    """All positions: one whose way is free goes on, the other no further than it can stop."""
    shared, mirrored = regions(p, q)
    one, other = str(MATRIX.movements[p]), str(MATRIX.movements[q])
    rows, columns = shared.close.shape
    for x, y in itertools.product(range(0, rows, 3), range(0, columns, 3)):
        s, t = (x + 0.5) * STEP, (y + 0.5) * STEP
        told = braking(started(), view(car(1, one, s, 0.0), car(2, other, t, 0.0)))
        free = {1: passes(*PLACE, p, s, q, t), 2: passes(*PLACE, q, t, p, s)}
        room = {1: shared.room(s, t), 2: mirrored.room(t, s)}
        go = {1, 2} - set(told)
        assert go or not any(free.values()), (s, t)
        into_the_area = {vehicle for vehicle in go if room[vehicle] <= ROOM}
        assert len(into_the_area) <= 1, (s, t)
        assert all(free[vehicle] for vehicle in into_the_area), (s, t)


def test_where_all_stand_and_wait_the_first_lane_goes_alone() -> None:
    monitors, ranks = started(patience=2.0), (2, 0, 1, 3)
    cars = [car(k, f"{lane}2", -2.25, 0.0) for k, lane in enumerate("abc")]
    for tick in range(40):
        seen = view(*cars, time=tick / 10)
        going = [monitors.patience.goes(seen, seen, v, False, ranks) for v in seen.vehicles]
        list(monitors.look(seen, {v.id: seen for v in seen.vehicles}, set()))
        assert going == [False, tick >= 20, False], "b has rank 0"
    inside = view(*cars, car(9, "d2", 1.0, 5.0), time=4.0)
    assert not monitors.patience.goes(inside, inside, cars[1], False, ranks), "its turn is over"


def stands(monitors: Monitors, seen: View, vehicle: int, decided: bool = False) -> bool:
    """Whether a vehicle that sees everything goes."""
    ego = next(v for v in seen.vehicles if v.id == vehicle)
    return monitors.patience.goes(seen, seen, ego, decided, (0, 1, 2, 3))


def test_patience_begins_anew_whenever_anything_happens() -> None:
    ego, other = car(0, "a2", -2.25, 0.0), car(1, "b2", -2.25, 0.0)
    happens = {
        "another moves": (view(ego, other._replace(speed=0.2), time=1.0), False),
        "another crosses": (view(ego, car(2, "c2", 1.0, 0.0), time=1.0), False),
        "it moves": (view(ego._replace(speed=0.1), other, time=1.0), False),
        "it may go": (view(ego, other, time=1.0), True),
        "another is before it": (view(ego, car(3, "a2", -1.0, 0.0), time=1.0), False),
    }
    for what, (meanwhile, decided) in happens.items():
        monitors = started(patience=2.0)
        assert not stands(monitors, view(ego, other), 0)
        assert stands(monitors, meanwhile, 0, decided) is decided
        assert not stands(monitors, view(ego, other, time=1.5), 0)
        assert not stands(monitors, view(ego, other, time=3.4), 0), what
        assert stands(monitors, view(ego, other, time=3.5), 0), what


def test_patience_does_not_depend_on_vehicles_far_away_or_unseen() -> None:
    ego, far = car(0, "a2", -2.25, 0.0), car(1, "b2", -SIGHT - 0.1, 5.0)
    hidden = car(2, "c2", 1.0, 5.0)
    monitors = started(patience=1.0)
    for time, goes in ((0.0, False), (0.9, False), (1.0, True)):
        true, seen = view(ego, far, hidden, time=time), view(ego, far, time=time)
        assert monitors.patience.goes(true, seen, ego, False, (0, 1, 2, 3)) is goes


def test_a_vehicle_that_went_alone_goes_on_once_it_is_inside() -> None:
    ego, other = car(0, "a2", -2.25, 0.0), car(1, "b2", 1.0, 3.0)
    monitors = started(patience=1.0)
    assert not stands(monitors, view(ego), 0)
    assert stands(monitors, view(ego, time=1.0), 0)
    assert stands(monitors, view(ego._replace(distance=2.0, speed=1.0), time=1.2), 0)
    assert stands(monitors, view(ego._replace(distance=-1.0, speed=3.0), other, time=1.5), 0)
    assert not stands(monitors, view(ego._replace(distance=2.0, speed=0.5), other, time=1.6), 0)
    assert not stands(monitors, view(ego, time=1.7), 0), "it gave it back"


def wrong(read: dict[int, int], reader: int | None = None) -> Reading:
    """All others, or one, read the vehicles of these lanes to want these manoeuvres."""

    def reads(_: View, ego: Observed, v: Observed) -> int:
        errs = reader in (None, ego.id) and v.id != ego.id
        return read.get(v.lane, v.manoeuvre) if errs else v.manoeuvre

    return Reading(reads)


def test_a_session_brakes_as_its_monitors_say_and_looks_again() -> None:
    session = Dim(monitor=Monitor()).start(SITE)
    true = view(car(1, "a3", 2.0, 6.0), car(2, "c2", 2.0, 6.0), time=7.0)
    commands = list(session.decide(true))
    brakes = {c.vehicle: c.deceleration for c in commands if isinstance(c, Brake)}
    assert brakes == braking(started(), true) != {}
    assert [c.time for c in commands if isinstance(c, Wake)] == [7.0 + SITE.dt]


WAITING = [car(1, "a2", -2.1, 0.0), car(2, "b2", -2.1, 0.0), car(4, "d3", -2.1, 0.0)]


def test_a_session_lets_the_first_lane_go_alone_after_a_while() -> None:
    """a2, b2 and d3 are in conflict, so it is a's turn; but a takes d for d2, and waits."""
    misread = wrong({3: 2}, reader=1)
    session = Dim(perception=misread, monitor=Monitor(patience=1.5)).start(SITE)
    for time, commands in ((0.0, []), (1.4, []), (1.5, [Go(1)]), (1.6, [])):
        found = list(session.decide(view(*WAITING, time=time)))
        assert [c for c in found if not isinstance(c, Wake)] == commands
        assert Wake(time + SITE.dt) in found
    bare = Dim(perception=misread).start(SITE)
    later = (c for t in (0.0, 9.0) for c in bare.decide(view(*WAITING, time=t)))
    assert not any(isinstance(c, Go) for c in later)


def misread_pairs() -> list[tuple[Movement, Movement, int, int]]:
    """Two movements in conflict, and what each is taken for, so that both see harmony."""
    n = SITE.intersection.n
    return [
        (a, b, as_a, as_b)
        for a, b in itertools.combinations(MATRIX.movements, 2)
        if a.origin != b.origin and not MATRIX.harmony(a, b)
        for as_a, as_b in itertools.product(range(1, n), repeat=2)
        if MATRIX.harmony(Movement(a.origin, as_a), b)
        and MATRIX.harmony(a, Movement(b.origin, as_b))
    ]


def meet(
    pair: tuple[Movement, Movement, int, int], offset: float, monitor: Monitor | None, profile: str
) -> Run:
    a, b, as_a, as_b = pair
    scenario = replayed(
        four_way(profile=profile, arm_length=150.0),
        (3.0, *a), (3.0 + offset, *b), horizon=120.0,
    )  # fmt: skip
    dim = Dim(perception=wrong({a.origin: as_a, b.origin: as_b}), monitor=monitor)
    return minisim.simulate(scenario, dim, on_collision="record")


@pytest.mark.parametrize("profile", ["fair", "paper"])
@pytest.mark.parametrize(
    "offsets",
    [(-0.6, 0.0, 0.3), pytest.param(np.arange(-2.0, 2.01, 0.1).round(1), marks=pytest.mark.slow)],
    ids=["some", "many"],
)
def test_two_that_misread_each_other_do_not_collide(profile: str, offsets: Iterable[float]) -> None:
    """The worst case: neither knows of the conflict until the other's motion shows it."""
    without = 0
    for pair in misread_pairs():
        for offset in offsets:
            run = meet(pair, float(offset), Monitor(), profile)
            assert not run.collisions, (pair, offset)
            assert run.columns.arrived.all(), (pair, offset)
        without += len(meet(pair, 0.0, None, profile).collisions)
    assert without > 0, "the test can fail"


FAIR = four_way(250, profile="fair", horizon=900.0, arm_length=150.0)


@pytest.mark.parametrize(
    ("scenario", "dim", "seed"),
    [
        (FAIR, Dim(perception=NoisyPerception(0.15, "symmetric", shared=False)), 3),
        (FAIR, Dim(perception=NoisyPerception(0.15, "symmetric", persistent=False)), 3),
        (four_way(300, horizon=900.0), Dim(commit="paper"), 1),
    ],
    ids=["own errors", "fleeting errors", "the paper's commit rule"],
)
def test_what_collides_without_it_does_not_with_it(scenario: Any, dim: Dim, seed: int) -> None:
    """Some 280 vehicles; none waits for ever either."""
    scenario = drained(scenario, seed, 3000.0)
    bare = minisim.simulate(scenario, dim, seed, on_collision="record")
    saved = minisim.simulate(scenario, dataclasses.replace(dim, monitor=Monitor()), seed)
    assert bare.collisions
    assert saved.columns.arrived.all()
