"""Human drivers and vehicles of DIM on hand-made views, and in runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import minisim
from baselines import AllWayStop
from dim import Dim, Humans, Mixed, NoisyPerception
from dim.agent import GATES
from dim.controller import DimSession
from dim.humans.drivers import Drivers
from minisim.control import Go, Observed, Session, View, Wake
from minisim.junction.movements import Movement
from scenarios import four_way
from scenarios.recipe import Recipe
from scenarios.sweep.rows import outcome_of
from tests.builders import digest, replayed, seen, view

SITE = four_way(profile="fair").site()
#: Drivers of this share and seed, with ids (and ranks) that are of one kind on every lane.
MIXED = Mixed(share=0.5)
DRIVERS = Drivers(MIXED.share, SITE.seed)
HUMAN = np.array([[DRIVERS[lane, i].human for lane in range(4)] for i in range(400)])
PEOPLE = np.flatnonzero(HUMAN.all(axis=1)).tolist()
#: A driver that announces every turn, on every lane.
TELLING = next(i for i in PEOPLE if all(DRIVERS[k, i].careless > 0.29 for k in range(4)))
CARS = np.flatnonzero(~HUMAN.any(axis=1)).tolist()
A, B, C, D = range(4)
LEFT, STRAIGHT, RIGHT = 1, 2, 3
EVERY_GATE = pytest.mark.parametrize("gate", GATES)


class Scene:
    """A session that is shown views."""

    def __init__(self, mixed: Mixed = MIXED) -> None:
        self.session = mixed.start(SITE)

    def goes(self, time: float, *vehicles: Observed) -> set[int]:
        """The vehicles that may go from now on."""
        commands = list(self.session.decide(view(*vehicles, time=time)))
        assert sum(isinstance(c, Wake) for c in commands) <= 1
        return {c.vehicle for c in commands if isinstance(c, Go)}


def test_a_driver_stops_looks_and_goes() -> None:
    scene, driver = Scene(), seen(PEOPLE[0], A, STRAIGHT, 2.1)
    assert scene.goes(0.0, seen(PEOPLE[0], A, STRAIGHT, 7.0, 4.0)) == set()
    assert scene.goes(2.0, driver) == set()
    assert scene.goes(3.8, driver) == set()
    assert scene.goes(3.9, driver) == {PEOPLE[0]}  # 1.9 s, HCM: 3.9 s less 2.0 s for moving up


def test_the_first_to_stop_goes_first() -> None:
    first, second = seen(PEOPLE[0], B, STRAIGHT, 2.0), seen(PEOPLE[1], A, STRAIGHT, 2.0)
    scene = Scene()
    scene.goes(0.0, first)
    scene.goes(1.0, first, second)
    assert scene.goes(1.9, first, second) == {PEOPLE[0]}
    inside = first._replace(distance=-3.0, speed=4.0)
    assert scene.goes(4.0, inside, second) == set()
    assert scene.goes(6.0, second) == {PEOPLE[1]}


def test_of_equals_the_lane_decides_and_only_one_of_two_in_conflict_goes() -> None:
    both = [seen(PEOPLE[k], lane, STRAIGHT, 2.0) for k, lane in enumerate((B, A))]
    scene = Scene()
    scene.goes(0.0, *both)
    assert scene.goes(1.9, *both) == {PEOPLE[1]}


def test_followers_keep_the_follow_up_time() -> None:
    """3.5 s for the far turn (HCM exhibit 20-18), although it stood long enough before."""
    scene = Scene()
    scene.goes(0.0, seen(PEOPLE[0], A, RIGHT, 2.0))
    assert scene.goes(1.9, seen(PEOPLE[0], A, RIGHT, 2.0)) == {PEOPLE[0]}
    follower = seen(PEOPLE[1], A, RIGHT, 2.0)
    scene.goes(2.0, follower)
    assert scene.goes(5.3, follower) == set()
    assert scene.goes(5.4, follower) == {PEOPLE[1]}


@pytest.mark.parametrize("speed", [0.0, 4.0])
def test_a_driver_waits_for_what_came_first_until_it_is_out_of_the_way(speed: float) -> None:
    """Whether the vehicle of DIM stands or rolls, and whether or not it has the right of way."""
    scene, driver = Scene(), seen(PEOPLE[0], A, STRAIGHT, 2.0)
    crossing = seen(CARS[1], C, RIGHT, -2.0, 5.0)
    car = seen(CARS[0], B, STRAIGHT, 6.0, 4.0)
    assert scene.goes(0.0, car, crossing) == set()
    assert scene.goes(0.1, driver, car, crossing) == set()
    assert scene.goes(4.0, driver, car._replace(distance=2.0, speed=speed), crossing) == set()
    assert scene.goes(5.0, driver, car._replace(distance=2.0)) == {CARS[0]}
    assert scene.goes(6.0, driver, car._replace(distance=-4.0, speed=5.0)) == set()
    assert scene.goes(7.0, driver) == {PEOPLE[0]}


@pytest.mark.parametrize("distance", [8.0, 3.0])
def test_a_driver_waits_for_none_that_comes_later_and_that_one_waits(distance: float) -> None:
    scene, driver = Scene(), seen(PEOPLE[0], A, STRAIGHT, 2.0)
    scene.goes(0.0, driver, seen(CARS[0], B, STRAIGHT, 8.1, 5.0))
    assert scene.goes(1.9, driver, seen(CARS[0], B, STRAIGHT, distance, 5.0)) == {PEOPLE[0]}
    waiting = seen(CARS[0], B, STRAIGHT, 2.0)
    assert scene.goes(2.1, driver._replace(distance=0.0, speed=2.0), waiting) == set()
    assert scene.goes(3.0, driver._replace(distance=-2.0, speed=4.0), waiting) == set()
    assert scene.goes(6.0, waiting) == {CARS[0]}


def test_a_driver_waits_for_none_that_is_not_in_its_way() -> None:
    scene, driver = Scene(), seen(PEOPLE[0], A, LEFT, 2.0)
    car = seen(CARS[0], B, LEFT, 6.0, 3.0)
    scene.goes(0.0, car, seen(CARS[1], C, RIGHT, -2.0, 5.0))  # which keeps the car waiting
    scene.goes(0.1, driver, car._replace(distance=2.0, speed=0.0))
    assert PEOPLE[0] in scene.goes(2.0, driver, car._replace(distance=2.0, speed=0.0))


@EVERY_GATE
def test_dim_waits_for_no_driver_that_is_still_rolling(gate: str) -> None:
    scene = Scene(replace(MIXED, dim=Dim(gate=gate)))
    driver = seen(PEOPLE[0], B, STRAIGHT, 3.1, 0.5)
    assert scene.goes(0.0, driver) == set()
    assert scene.goes(1.0, driver, seen(CARS[0], A, STRAIGHT, 8.0, 5.0)) == {CARS[0]}


def test_where_humans_wait_none_overtakes_a_vehicle_that_came_first() -> None:
    """Without the human, a3 waits for d2 inside, and c1, in harmony with d2, goes before it."""
    inside, first = seen(CARS[1], D, STRAIGHT, -1.0, 4.0), seen(CARS[0], A, RIGHT, 2.0)
    last, driver = seen(CARS[2], C, LEFT, 6.0, 4.0), seen(TELLING, B, LEFT, 2.0)
    mixed = replace(MIXED, dim=Dim(gate="harmonious"), trust="signals")
    for human in (False, True):
        scene, others = Scene(mixed), [inside, first, *[driver] * human]
        scene.goes(0.0, inside, first)
        scene.goes(0.1, *others)
        assert (last.id in scene.goes(0.2, *others, last)) is not human


def test_while_a_human_is_at_the_junction_the_gate_is_harmonious() -> None:
    scene, car = Scene(), seen(CARS[0], A, LEFT, 6.0, 4.0)
    other, driver = seen(CARS[1], B, LEFT, -1.0, 4.0), seen(TELLING, B, LEFT, -8.5, 4.0)
    assert scene.goes(0.0, car, other) == set()
    assert scene.goes(0.1, car, driver) == {CARS[0]}
    assert Scene().goes(0.0, car, other, seen(PEOPLE[0], C, LEFT, 2.0)) == {CARS[0]}


@pytest.mark.parametrize("noisy", [False, True])
def test_dim_goes_as_soon_as_a_human_inside_is_out_of_the_way(noisy: bool) -> None:
    """A driver at the same place goes then, too; where perception errs, DIM waits until it left."""
    dim = Dim(perception=NoisyPerception(1e-9)) if noisy else Dim()
    starts = {}
    for first in (CARS[0], PEOPLE[0]):
        scene, inside = Scene(replace(MIXED, dim=dim)), seen(PEOPLE[1], B, STRAIGHT, 2.0)
        scene.goes(0.0, inside)
        waiting = seen(first, A, STRAIGHT, 2.0)
        scene.goes(0.1, inside, waiting)
        places = np.arange(0.0, 22.0, 0.5)
        entered = (inside._replace(distance=-float(p), speed=5.0) for p in places)
        went = [first in scene.goes(2.5 + k, waiting, v) for k, v in enumerate(entered)]
        starts[first] = went.index(True) if True in went else len(places)
    assert 0 < starts[PEOPLE[0]] < len(places)
    assert starts[CARS[0]] == (len(places) if noisy else starts[PEOPLE[0]])


def test_what_the_host_has_to_provide() -> None:
    """DIM without its rest, and a mark at the entry."""
    alone, plan = MIXED.dim.start(SITE).plan, MIXED.start(SITE).plan
    assert plan.marks == (*alone.marks, 0.0)
    awake = replace(alone, wake_when_empty=False)
    assert replace(plan, marks=alone.marks) == awake != alone
    harmonious = Dim(gate="harmonious")
    assert Mixed(harmonious).start(SITE).plan.marks == harmonious.start(SITE).plan.marks
    noisy = Dim(perception=NoisyPerception(0.15, frame=0.2))
    assert Mixed(noisy).start(SITE).plan.period == 0.2
    assert Mixed(noisy).name == "dim:perception=noisy(intent_error=0.15,frame=0.2)+humans=0.2"


def wakes(session: Session, time: float, *vehicles: Observed) -> list[float]:
    return [c.time for c in session.decide(View(time, vehicles)) if isinstance(c, Wake)]


def test_drivers_at_the_junction_look_five_times_a_second() -> None:
    driver = seen(PEOPLE[0], A, STRAIGHT, 2.0)
    assert wakes(MIXED.start(SITE), 3.0, driver) == [pytest.approx(3.2)]
    assert wakes(MIXED.start(SITE), 3.0, driver._replace(distance=8.5)) == []
    slow = replace(SITE, dt=0.5)
    assert wakes(MIXED.start(slow), 3.0, driver) == [3.5]  # as often as there are steps
    unseen = seen(CARS[0], B, STRAIGHT, 0.0, 5.0)  # has entered without a right of way
    assert wakes(MIXED.start(SITE), 3.0, driver, unseen) == [pytest.approx(3.0 + SITE.dt)]


def test_a_driver_stands_at_the_line() -> None:
    """Up to 1 m before it, at no more than 0.1 m/s; what it sees, it sees half a step early."""
    line = MIXED.dim.zones.green
    for distance, speed, goes in (
        (line + 0.99, 0.0, True), (line + 1.01, 0.0, False), (2.0, 0.09, True), (2.0, 0.11, False)
    ):  # fmt: skip
        scene, driver = Scene(), seen(PEOPLE[0], A, STRAIGHT, distance, speed)
        scene.goes(0.0, driver)
        assert (scene.goes(1.9, driver) == {PEOPLE[0]}) is goes
    for early, goes in ((0.4, True), (0.6, False)):
        scene, driver = Scene(), seen(PEOPLE[0], A, STRAIGHT, 2.0)
        scene.goes(0.0, driver)
        assert (scene.goes(1.9 - early * SITE.dt, driver) == {PEOPLE[0]}) is goes


def test_a_driver_that_rolls_on_begins_anew() -> None:
    scene, driver = Scene(), seen(PEOPLE[0], A, STRAIGHT, 2.0)
    scene.goes(0.0, driver)
    scene.goes(1.0, driver._replace(speed=0.5))
    assert scene.goes(2.0, driver) == set()
    assert scene.goes(3.8, driver) == set()
    assert scene.goes(3.9, driver) == {PEOPLE[0]}


def test_no_vehicle_of_dim_goes_from_behind_a_human() -> None:
    driver, car = seen(PEOPLE[0], A, STRAIGHT, 0.5), seen(CARS[0], A, STRAIGHT, 7.9)
    assert Scene(replace(MIXED, dim=Dim(gate="harmonious"))).goes(0.0, driver, car) == set()


@pytest.mark.parametrize(("trust", "believed"), [("motion", False), ("signals", True)])
@pytest.mark.parametrize("lane", [B, C, D])
@pytest.mark.parametrize("manoeuvre", [LEFT, RIGHT])
@pytest.mark.parametrize("distance", [-0.5, 2.0])  # inside; at the line
@EVERY_GATE
def test_an_indicator_that_is_believed_means_its_way_and_else_any(
    lane: int, manoeuvre: int, distance: float, trust: str, believed: bool, gate: str
) -> None:
    other = seen(TELLING, lane, manoeuvre, distance)
    matrix, ways = Dim().harmony(SITE), [manoeuvre] if believed else [LEFT, STRAIGHT, RIGHT]
    for mine in (LEFT, STRAIGHT, RIGHT):
        car = seen(CARS[0], A, mine, 6.0, 4.0)
        harmony = all(matrix.harmony(Movement(A, mine), Movement(lane, way)) for way in ways)
        scene = Scene(replace(MIXED, dim=Dim(gate=gate), trust=trust))
        scene.goes(0.0, other)
        assert (CARS[0] in scene.goes(0.1, car, other)) is harmony, mine


@EVERY_GATE
def test_without_humans_runs_are_those_of_dim(gate: str) -> None:
    """Also where some might be human, so that all others look cautiously."""
    assert isinstance(Mixed(Dim(gate=gate), 0.0).start(SITE), DimSession)
    scenario = four_way(300, profile="fair", horizon=120.0)
    rare = Mixed(Dim(gate=gate), 1e-9)
    run, alone = (minisim.simulate(scenario, c, 4, record="junction") for c in (rare, rare.dim))
    assert set(run.kinds) == {"automated"}
    assert digest(run) == digest(alone)


def test_one_driver_alone_loses_what_stopping_costs() -> None:
    """Standing for the reaction time, ± the time between two looks, with an empty road."""
    scenario = replayed(four_way(profile="fair"), (0.0, A, STRAIGHT), horizon=120.0)
    run = minisim.simulate(scenario, Mixed(share=1.0))
    waited = float(run.columns.waiting_time[0])
    assert waited == pytest.approx(1.9, abs=0.3)
    stop = minisim.simulate(scenario, AllWayStop(reaction=1.9))
    assert waited == pytest.approx(float(stop.columns.waiting_time[0]), abs=0.3)


def test_drivers_that_believe_in_silence_collide() -> None:
    """The check of safety can fail: 3 of 10 turns come unannounced."""
    careless = Mixed(share=1.0, humans=Humans(trust="silence"))
    scenario = four_way(250, profile="fair")
    run = minisim.simulate(scenario, careless, 1, on_collision="record")
    assert run.collisions


def test_the_groups_of_a_run_make_up_the_whole() -> None:
    run = minisim.simulate(four_way(150, profile="fair", horizon=600.0), Mixed(share=0.4), 2)
    groups = run.summary()["kinds"]
    drivers, met = Drivers(0.4, run.seed), run.scenario.arrivals(run.seed)
    human = np.array([drivers[k].human for k in zip(met.lane, met.rank, strict=True)])
    assert groups["human"]["trips"] == int(human.sum()) > 10
    waits = run.columns.waiting_time[human & run.columns.departed]
    assert groups["human"]["complete"]["waiting_time_s"] == pytest.approx(float(waits.mean()))
    row = outcome_of(Recipe(run.scenario, Dim(), 2, humans=0.4)).row  # type: ignore[arg-type]
    assert row["kinds_human_trips"] == groups["human"]["trips"]
    assert run.trips["kind"].tolist() == ["human" if one else "automated" for one in human]
    alone = minisim.simulate(four_way(50, horizon=60.0), Dim())
    assert "kinds" not in alone.summary()
    assert "kind" not in alone.trips
