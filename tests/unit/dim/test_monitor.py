"""The safety monitor: what another may do, how hard to brake, who goes on, and whom it saves."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest

import minisim
from dim import Dim, HarmonyMatrix, Monitor, NoisyPerception
from dim.monitor import ROOM, Watch
from dim.perception import UNKNOWN, See
from minisim.control import Brake, Go, Observed, Site, View, Wake
from minisim.errors import InputError
from minisim.junction.coordination import STEP, passes, region
from minisim.junction.movements import Movement
from minisim.junction.partings import showing
from minisim.results.run import Run
from scenarios import Scenario, four_way
from tests.builders import digest, drained, replayed

SCENARIO = four_way(250, profile="fair", arm_length=150.0)
SITE = SCENARIO.site(0)
PLACE = SITE.intersection, SITE.vehicle
MATRIX = HarmonyMatrix.from_geometry(SITE.intersection, SITE.vehicle)
SIGHT = 8.0


def car(vehicle: int, movement: str, past: float, speed: float) -> Observed:
    """A vehicle whose front is so far past the entry [m]."""
    lane, manoeuvre = MATRIX.movements[MATRIX.index(movement)]
    return Observed(vehicle, lane, manoeuvre, -past, speed, SITE.vehicle.length)


def view(*cars: Observed, time: float = 0.0) -> View:
    return View(time, tuple(sorted(cars, key=lambda c: (c.lane, c.distance))))


def watch(**options: float) -> Watch:
    return Monitor(**options).start(SITE, MATRIX, SIGHT)


def read_as(seen: View, **readings: int) -> View:
    """What is seen where the vehicles of a lane are read to want this manoeuvre."""
    return View(
        seen.time,
        tuple(v._replace(manoeuvre=readings.get("abcd"[v.lane], v.manoeuvre)) for v in seen[1]),
    )


def braking(
    watch: Watch, true: View, seen: dict[int, View] | None = None, going: set[int] | None = None
) -> dict[int, float]:
    """Who is told to brake at what, if all see everything unless said otherwise."""
    everything = {v.id: true for v in true.vehicles}
    ids = set(everything)
    commands = list(watch.look(true, everything | (seen or {}), ids if going is None else going))
    assert all(isinstance(command, Brake) for command in commands)
    return {command.vehicle: command.deceleration for command in commands}


# What another may do.


def test_a_reading_holds_as_long_as_motion_does_not_contradict_it() -> None:
    """a3 is read as a2, in harmony with c2, until it is 0.3 m beside that path."""
    shows = showing(SITE.intersection, 0.3)[2, 1]
    for past in (0.0, 1.0, shows - 0.01, shows + 0.01, 4.0):
        true = view(car(1, "a3", past, 6.0), car(2, "c2", past, 6.0))
        told = braking(watch(), true, {2: read_as(true, a=2)})
        assert (2 in told) == (past > shows), past
        assert 1 in told, "the other has read c2 right"


def test_a_reading_that_changes_is_a_doubt() -> None:
    monitors = watch()
    true = view(car(1, "a2", 0.5, 6.0), car(2, "c2", 2.0, 6.0))
    assert braking(monitors, true) == {}
    assert 2 in braking(monitors, true, {2: read_as(true, a=3)})
    assert braking(monitors, true, {2: read_as(true, a=2)}) == {}, "no change: it still brakes"


def test_an_unknown_intent_is_every_manoeuvre() -> None:
    true = view(car(1, "a2", 0.5, 6.0), car(2, "c2", 2.0, 6.0))
    assert 2 in braking(watch(), true, {2: read_as(true, a=UNKNOWN)})


def test_an_unknown_intent_is_one_of_its_own_lane() -> None:
    """Whatever comes out of lane d keeps clear of a left turn from c, unlike what comes from a."""
    for past in (-0.5, 0.5):
        true = view(car(1, "c1", 2.0, 6.0), car(2, "d1", past, 6.0))
        assert braking(watch(), true, {1: read_as(true, d=UNKNOWN)}) == {}


def test_who_is_not_seen_is_not_braked_for() -> None:
    true = view(car(1, "a3", 2.0, 6.0), car(2, "c2", 2.0, 6.0))
    blind = view(car(2, "c2", 2.0, 6.0))
    assert set(braking(watch(), true, {2: blind})) == {1}


def test_whoever_can_stop_before_the_junction_is_nobodys_danger() -> None:
    true = view(car(1, "a3", 2.0, 6.0), car(2, "c2", -4.0, 5.0))
    assert braking(watch(), true, going=set()) == {}


# How hard.


def test_it_brakes_as_hard_as_it_takes_from_comfortable_on() -> None:
    """v²/2d before the conflict area, and not at all while less than b will do."""
    a2, b2 = MATRIX.index("a2"), MATRIX.index("b2")
    shared = region(*PLACE, a2, b2)
    assert shared is not None
    room, v, b = shared.room(0.0, 3.0), 5.0, SITE.vehicle.deceleration
    for left in np.arange(1.75, room, STEP).tolist():
        true = view(car(1, "a2", room - left, v), car(2, "b2", 3.0, 5.0))
        needed = v * v / (2.0 * (shared.room(room - left, 3.0) - ROOM))
        told = braking(watch(), true).get(1, 0.0)
        if told:
            assert told == pytest.approx(max(needed, b))
            assert needed > 0.6 * b, "one step more at full acceleration would take more than b"
        else:
            assert needed < b


def test_it_brakes_no_harder_than_told() -> None:
    for weak in (2.0, 5.0):
        true = view(car(1, "a2", 2.0, 6.0), car(2, "b2", 2.0, 6.0))
        told = braking(watch(deceleration=weak), true)
        assert told
        assert max(told.values()) <= weak


def test_whoever_is_out_in_good_time_goes_on() -> None:
    """Leaving at its speed, the other coming at full acceleration: the margin is between."""
    a2, b2 = MATRIX.index("a2"), MATRIX.index("b2")
    shared, mirrored = region(*PLACE, a2, b2), region(*PLACE, b2, a2)
    assert shared is not None
    assert mirrored is not None
    x, v, y, w, a = 14.0, 9.0, -2.2, 4.6, SITE.vehicle.acceleration
    leaves = (shared.ends(y) - x) / v
    room = mirrored.room(y, x)
    comes = (math.sqrt(w * w + 2.0 * a * room) - w) / a
    assert 0.3 < comes - leaves < 2.0
    true = view(car(1, "a2", x, v), car(2, "b2", y, w))
    assert 1 not in braking(watch(time_margin=comes - leaves - 0.01), true)
    assert 1 in braking(watch(time_margin=comes - leaves + 0.01), true)


@pytest.mark.parametrize("v", [1.0, 4.0])
def test_it_brakes_when_one_more_step_would_take_more_than_comfort(v: float) -> None:
    """That step at full acceleration, then v²/2b, and `ROOM`."""
    a2, b2 = MATRIX.index("a2"), MATRIX.index("b2")
    shared = region(*PLACE, a2, b2)
    assert shared is not None
    a, b, dt = SITE.vehicle.acceleration, SITE.vehicle.deceleration, SITE.dt
    after = v + a * dt
    needed = (v + after) / 2.0 * dt + after * after / (2.0 * b) + ROOM
    x = shared.room(0.0, 3.0) - needed
    assert x > 0.0
    other = car(2, "b2", 3.0, 5.0)
    assert 1 not in braking(watch(), view(car(1, "a2", x - 1e-3, v), other))
    assert braking(watch(), view(car(1, "a2", x + 1e-3, v), other))[1] == b
    gentle = 0.7 * b
    needed = (v + after) / 2.0 * dt + after * after / (2.0 * gentle) + ROOM
    x = shared.room(0.0, 3.0) - needed
    assert 1 not in braking(watch(deceleration=gentle), view(car(1, "a2", x - 1e-3, v), other))
    assert braking(watch(deceleration=gentle), view(car(1, "a2", x + 1e-3, v), other))[1] == gentle


def test_whoever_still_can_stops_before_the_junction() -> None:
    """There it keeps nobody from clearing it; the conflict area begins later."""
    a, b, dt, v = SITE.vehicle.acceleration, SITE.vehicle.deceleration, SITE.dt, 5.0
    after = v + a * dt
    needed = (v + after) / 2.0 * dt + after * after / (2.0 * b) + ROOM
    other = car(2, "b2", 3.0, 5.0)
    assert 1 not in braking(watch(), view(car(1, "a2", -needed - 1e-3, v), other))
    told = braking(watch(), view(car(1, "a2", -needed + 1e-3, v), other))[1]
    assert told == pytest.approx(max(b, v * v / (2.0 * (needed - ROOM))))


@pytest.mark.parametrize("look_ahead", [1.0, 4.0])
def test_too_late_to_stop_it_does_what_does_not_touch(look_ahead: float) -> None:
    """Brake as hard as possible, unless only going on touches nobody; all positions."""
    a2, b2 = MATRIX.index("a2"), MATRIX.index("b2")
    shared, mirrored = region(*PLACE, a2, b2), region(*PLACE, b2, a2)
    assert shared is not None
    assert mirrored is not None
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
        told = braking(watch(look_ahead=look_ahead), true).get(1, 0.0)
        assert told == (0.0 if brakes and not goes else most), (x, y)
        answers.add(told)
    assert answers == {0.0, most}, "both occur"


def test_whoever_stands_right_before_the_area_stays_there() -> None:
    """No division by the room that is left: none."""
    shared = region(*PLACE, MATRIX.index("a2"), MATRIX.index("b2"))
    assert shared is not None
    ego = car(1, "a2", shared.room(0.0, 3.0) - ROOM, 0.0)
    assert shared.room(-ego.distance, 3.0) == ROOM
    told = braking(watch(), view(ego, car(2, "b2", 3.0, 5.0)))
    assert told[1] == SITE.vehicle.max_deceleration


def test_it_is_told_when_it_may_stop_braking_and_nothing_twice() -> None:
    monitors = watch()
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
        monitors = watch()
        braking(monitors, view(*cars), going=going)
        assert monitors.needed is needed, (cars, going)


# Who goes on.


def conflicting() -> list[tuple[int, int]]:
    m = MATRIX.movements
    return [
        (p, q)
        for p, q in itertools.product(range(len(m)), repeat=2)
        if m[p].origin < m[q].origin and not MATRIX.values[p, q]
    ]


@pytest.mark.parametrize(("p", "q"), conflicting())
def test_of_two_that_stand_one_goes_on_wherever_they_stand(p: int, q: int) -> None:
    """All positions: one whose way is free goes on, the other no further than it can stop."""
    shared, mirrored = region(*PLACE, p, q), region(*PLACE, q, p)
    assert shared is not None
    assert mirrored is not None
    one, other = str(MATRIX.movements[p]), str(MATRIX.movements[q])
    rows, columns = shared.close.shape
    for x, y in itertools.product(range(0, rows, 3), range(0, columns, 3)):
        s, t = (x + 0.5) * STEP, (y + 0.5) * STEP
        told = braking(watch(), view(car(1, one, s, 0.0), car(2, other, t, 0.0)))
        free = {1: passes(*PLACE, p, s, q, t), 2: passes(*PLACE, q, t, p, s)}
        room = {1: shared.room(s, t), 2: mirrored.room(t, s)}
        go = {1, 2} - set(told)
        assert go or not any(free.values()), (s, t)
        into_the_area = {vehicle for vehicle in go if room[vehicle] <= ROOM}
        assert len(into_the_area) <= 1, (s, t)
        assert all(free[vehicle] for vehicle in into_the_area), (s, t)


def test_where_all_stand_and_wait_the_first_lane_goes_alone() -> None:
    monitors, ranks = watch(patience=2.0), (2, 0, 1, 3)
    cars = [car(k, f"{lane}2", -2.25, 0.0) for k, lane in enumerate("abc")]
    for tick in range(40):
        seen = view(*cars, time=tick / 10)
        going = [monitors.goes(seen, seen, v, False, ranks) for v in seen.vehicles]
        list(monitors.look(seen, {v.id: seen for v in seen.vehicles}, set()))
        assert going == [False, tick >= 20, False], "b has rank 0"
    inside = view(*cars, car(9, "d2", 1.0, 5.0), time=4.0)
    assert not monitors.goes(inside, inside, cars[1], False, ranks), "its turn is over"


def test_nobody_goes_alone_where_somebody_moves_or_crosses() -> None:
    for moving in (car(9, "d2", -6.0, 2.0), car(9, "d2", 3.0, 0.0)):
        monitors = watch(patience=1.0)
        for tick in range(30):
            seen = view(car(0, "a2", -2.25, 0.0), moving, time=tick / 10)
            assert not monitors.goes(seen, seen, seen.vehicles[0], False, (0, 1, 2, 3))


def stands(monitors: Watch, seen: View, vehicle: int, decided: bool = False) -> bool:
    """Whether a vehicle goes that sees everything."""
    ego = next(v for v in seen.vehicles if v.id == vehicle)
    return monitors.goes(seen, seen, ego, decided, (0, 1, 2, 3))


def test_patience_begins_anew_whenever_anything_happens() -> None:
    ego, other = car(0, "a2", -2.25, 0.0), car(1, "b2", -2.25, 0.0)
    happens = {
        "another moves": (view(ego, other._replace(speed=0.2), time=1.0), False),
        "another crosses": (view(ego, car(2, "c2", 1.0, 0.0), time=1.0), False),
        "it moves": (view(ego._replace(speed=0.1), other, time=1.0), False),
        "it may go": (view(ego, other, time=1.0), True),
        "somebody is before it": (view(ego, car(3, "a2", -1.0, 0.0), time=1.0), False),
    }
    for what, (meanwhile, decided) in happens.items():
        monitors = watch(patience=2.0)
        assert not stands(monitors, view(ego, other), 0)
        assert stands(monitors, meanwhile, 0, decided) is decided
        assert not stands(monitors, view(ego, other, time=1.5), 0)
        assert not stands(monitors, view(ego, other, time=3.4), 0), what
        assert stands(monitors, view(ego, other, time=3.5), 0), what


def test_who_is_far_or_not_seen_does_not_matter_to_the_patient() -> None:
    ego, far = car(0, "a2", -2.25, 0.0), car(1, "b2", -SIGHT - 0.1, 5.0)
    hidden = car(2, "c2", 1.0, 5.0)
    monitors = watch(patience=1.0)
    for time, goes in ((0.0, False), (0.9, False), (1.0, True)):
        true, seen = view(ego, far, hidden, time=time), view(ego, far, time=time)
        assert monitors.goes(true, seen, ego, False, (0, 1, 2, 3)) is goes


def test_whoever_went_alone_goes_on_once_it_is_inside() -> None:
    ego, other = car(0, "a2", -2.25, 0.0), car(1, "b2", 1.0, 3.0)
    monitors = watch(patience=1.0)
    assert not stands(monitors, view(ego), 0)
    assert stands(monitors, view(ego, time=1.0), 0)
    assert stands(monitors, view(ego._replace(distance=2.0, speed=1.0), time=1.2), 0)
    assert stands(monitors, view(ego._replace(distance=-1.0, speed=3.0), other, time=1.5), 0)
    assert not stands(monitors, view(ego._replace(distance=2.0, speed=0.5), other, time=1.6), 0)
    assert not stands(monitors, view(ego, time=1.7), 0), "it gave it back"


# Whom it saves.


@dataclass(frozen=True)
class Wrong:
    """Everybody else, or one, reads the vehicles of these lanes to want these manoeuvres."""

    read: tuple[tuple[int, int], ...]
    reader: int | None = None
    name: str = "wrong"
    period: float = 0.1

    def start(self, site: Site) -> See:
        read = dict(self.read)

        def see(true: View, ego: Observed) -> View:
            if self.reader not in (None, ego.id):
                return true
            return View(
                true.time,
                tuple(
                    v if v.id == ego.id else v._replace(manoeuvre=read.get(v.lane, v.manoeuvre))
                    for v in true.vehicles
                ),
            )

        return see


def test_a_session_brakes_as_its_monitors_say_and_looks_again() -> None:
    session = Dim(monitor=Monitor()).start(SITE)
    true = view(car(1, "a3", 2.0, 6.0), car(2, "c2", 2.0, 6.0), time=7.0)
    commands = list(session.decide(true))
    brakes = {c.vehicle: c.deceleration for c in commands if isinstance(c, Brake)}
    assert brakes == braking(watch(), true) != {}
    assert [c.time for c in commands if isinstance(c, Wake)] == [7.0 + SITE.dt]


def test_a_session_lets_the_first_lane_go_alone_after_a_while() -> None:
    """a2, b2 and d3 are in conflict, so it is a's turn; a takes d for d2, and finds it is not."""
    waiting = [car(1, "a2", -2.1, 0.0), car(2, "b2", -2.1, 0.0), car(4, "d3", -2.1, 0.0)]
    wrong = Wrong(((3, 2),), reader=1)
    session = Dim(perception=wrong, monitor=Monitor(patience=1.5)).start(SITE)
    for time, commands in ((0.0, []), (1.4, []), (1.5, [Go(1)]), (1.6, [])):
        found = list(session.decide(view(*waiting, time=time)))
        assert [c for c in found if not isinstance(c, Wake)] == commands
        assert Wake(time + SITE.dt) in found
    bare = Dim(perception=wrong).start(SITE)
    assert not any(
        isinstance(c, Go) for t in (0.0, 9.0) for c in bare.decide(view(*waiting, time=t))
    )


def test_whoever_arrives_at_the_yellow_zone_ends_the_wait() -> None:
    """As above, with c3, which is in conflict with all; 8 m before the junction it takes part."""
    waiting = [car(1, "a2", -2.1, 0.0), car(2, "b2", -2.1, 0.0), car(4, "d3", -2.1, 0.0)]
    for past, goes in ((-8.0, False), (-8.001, True)):
        session = Dim(perception=Wrong(((3, 2),), reader=1), monitor=Monitor()).start(SITE)
        for time in (0.0, 9.0):
            commands = list(session.decide(view(*waiting, car(3, "c3", past, 1.0), time=time)))
        assert (Go(1) in commands) is goes


def misread_pairs() -> list[tuple[Movement, Movement, int, int]]:
    """Two in conflict, and what each is taken for, such that both see harmony."""
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
    dim = Dim(perception=Wrong(((a.origin, as_a), (b.origin, as_b))), monitor=monitor)
    return minisim.simulate(scenario, dim, on_collision="record")


@pytest.mark.parametrize("profile", ["fair", "paper"])
def test_two_that_misread_each_other_do_not_collide_nor_block(profile: str) -> None:
    """The worst case: neither knows of the conflict until the other's motion shows it."""
    without = 0
    for pair in misread_pairs():
        for offset in (-0.6, 0.0, 0.3):
            run = meet(pair, offset, Monitor(), profile)
            assert not run.collisions, (pair, offset)
            assert run.columns.arrived.all(), (pair, offset)
        without += len(meet(pair, 0.0, None, profile).collisions)
    assert without > 0, "the test can fail"


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["fair", "paper"])
def test_two_that_misread_each_other_do_not_collide_whenever_they_come(profile: str) -> None:
    for pair in misread_pairs():
        for offset in np.arange(-2.0, 2.01, 0.1):
            run = meet(pair, round(float(offset), 1), Monitor(), profile)
            assert not run.collisions, (pair, offset)
            assert run.columns.arrived.all(), (pair, offset)


NOISY = NoisyPerception(intent_error=0.15, kind="symmetric")


def test_noisy_intent_collides_without_it_and_not_with_it() -> None:
    """Some 280 vehicles; nobody waits for ever either."""
    scenario = drained(four_way(250, profile="fair", horizon=900.0, arm_length=150.0), 3, 3000.0)
    for options in ({"shared": False}, {"persistent": False}):
        noisy = dataclasses.replace(NOISY, **options)
        bare = minisim.simulate(scenario, Dim(perception=noisy), 3, on_collision="record")
        saved = minisim.simulate(scenario, Dim(perception=noisy, monitor=Monitor()), 3)
        assert bare.collisions
        assert saved.columns.arrived.all()


def test_it_also_removes_what_the_papers_commit_rule_causes() -> None:
    scenario = drained(four_way(300, horizon=900.0), 1, 3000.0)
    bare = minisim.simulate(scenario, Dim(commit="paper"), 1, on_collision="record")
    saved = minisim.simulate(scenario, Dim(commit="paper", monitor=Monitor()), 1)
    assert bare.collisions
    assert saved.columns.arrived.all()


def test_it_never_acts_where_perception_is_exact() -> None:
    for gate in ("clear", "harmonious"):
        for scenario in (four_way(330, horizon=600.0), SCENARIO):
            bare = run_of(scenario, Dim(gate=gate))
            assert digest(run_of(scenario, Dim(gate=gate, monitor=Monitor()))) == digest(bare)


def run_of(scenario: Scenario, dim: Dim) -> Run:
    return minisim.simulate(scenario, dim, seed=2, record="junction")


# Errors.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"time_margin": -1.0}, "time_margin .s. must be at least 0 and at most 10"),
        ({"time_margin": 10.5}, "time_margin .s. must be at least 0 and at most 10,"),
        ({"look_ahead": 0.0}, "look_ahead .s. must be at least 0.5 and at most 30"),
        ({"look_ahead": 30.5}, "look_ahead .s. must be at least 0.5 and at most 30,"),
        ({"tolerance": 0.0}, "tolerance .m. must be above 0 and at most 1"),
        ({"tolerance": 1.5}, "tolerance .m. must be above 0 and at most 1,"),
        ({"tolerance": math.nan}, "tolerance .m. must be"),
        ({"deceleration": 0.0}, "deceleration of the monitor .m/s². must be at least 1"),
        ({"deceleration": 1001}, "deceleration of the monitor .m/s². must be .* at most 1000"),
        ({"deceleration": "hard"}, "deceleration of the monitor .m/s². must be a number"),
        ({"patience": 0.0}, "patience .s. must be at least 0.5 and at most 60"),
        ({"patience": 61.0}, "patience .s. must be at least 0.5 and at most 60,"),
    ],
)
def test_bad_parameters_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Monitor(**options)  # type: ignore[arg-type]


def test_bounds_are_allowed() -> None:
    Monitor(time_margin=0, look_ahead=0.5, tolerance=1, deceleration=1000, patience=0.5)
    Monitor(time_margin=10, look_ahead=30, tolerance=1e-3, deceleration=1, patience=60)


def test_what_is_no_monitor_is_refused() -> None:
    with pytest.raises(InputError, match="monitor"):
        Dim(monitor=True)  # type: ignore[arg-type]


def test_its_name_tells() -> None:
    assert Dim(monitor=Monitor()).name == "dim:monitor=on"
