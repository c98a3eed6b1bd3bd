"""The authors' rules, quirk by quirk, on hand-made situations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import minisim
from dim import AsRunDim, DecisionTable
from dim.as_run import (
    BOUND,
    EXIT_SPEED,
    GO_SPEED,
    GREEN_SPEED,
    HELD_SPEED,
    RED_SPEED,
    AsRunRules,
    Car,
    winner,
)  # fmt: skip
from dim.harmony import HarmonyMatrix
from minisim.control import Advise, Observed, Plan, View, Wake
from minisim.errors import InputError
from minisim.junction.movements import Movement
from scenarios import four_way, regular
from scenarios.library import MAKERS
from scenarios.paper import replay
from tests.builders import EveryStep, replayed


def car(name: str, driven: float, id: int | None = None) -> Car:
    """A car called `v7.a_2`; its id is the second of its demand unless given."""
    second, movement = name[1:].split(".")
    lane, manoeuvre = movement.split("_")
    number = int(second) if id is None else id
    return Car(number, name, Movement("abcde".index(lane), int(manoeuvre)), driven)


def rules(arms: int = 4, **options: Any) -> AsRunRules:
    return AsRunRules(AsRunDim(**options), HarmonyMatrix.paper(arms))


def step(rule: AsRunRules, *cars: Car) -> dict[int, float]:
    return rule.step({c.id: c for c in cars})


@pytest.mark.parametrize(
    ("arms", "red", "yellow"), [(3, 467.0, 487.0), (4, 465.0, 485.0), (5, 458.0, 483.0)]
)
def test_zones_of_the_three_junctions(arms: int, red: float, yellow: float) -> None:
    assert step(rules(arms), car("v1.a_1", red - 0.01)) == {}
    rule = rules(arms)
    assert step(rule, car("v1.a_1", red)) == {1: RED_SPEED}
    assert step(rule, car("v1.a_1", yellow - 0.01)) == {}, "told once"
    assert rule.action == []
    step(rule, car("v1.a_1", yellow))
    assert rule.action == [1]


def test_a_lone_vehicle_never_stops() -> None:
    """It is held and chosen in the same step; the last word is 10 m/s, up to clear and beyond."""
    rule = rules()
    step(rule, car("v1.a_1", 470.0))
    for driven in (485.0, 487.9, 488.0, 490.0, 492.0, 506.0, 507.0):
        assert step(rule, car("v1.a_1", driven)) == {1: GO_SPEED}
    assert step(rule, car("v1.a_1", 508.01)) == {1: EXIT_SPEED}
    assert step(rules(exit_speed=14.0), car("v1.a_1", 508.01)) == {1: 14.0}, "as_run.md, no. 15"


def test_the_movement_breaks_a_tie_of_seconds() -> None:
    rule = rules(3)
    cars = [car("v5.b_1", 488.0, 3), car("v5.a_2", 488.0, 1), car("v5.a_1", 488.0, 2)]
    step(rule, *cars)
    assert rule.action == [2, 1, 3]


def test_no_more_take_part_than_there_are_arms() -> None:
    rule = rules(3)
    cars = [car(f"v{k}.{'abc'[k % 3]}_{k % 2 + 1}", 488.0) for k in range(6)]
    step(rule, *cars)
    assert rule.action == [0, 1, 2]


def test_a_place_is_free_again_at_506_m_for_vehicles_visited_later() -> None:
    """v3 leaves the list while v1 was already turned away, and v7 comes after: one step apart."""
    rule = rules(3)
    first = [car("v2.a_1", 500.0), car("v3.b_1", 506.0), car("v4.c_1", 500.0)]
    rule.action = [2, 3, 4]
    waiting = [car("v1.a_2", 488.0), car("v7.b_2", 488.0)]
    step(rule, *first, *waiting)
    assert rule.action == [2, 3, 4]
    first[1] = car("v3.b_1", 506.01)
    step(rule, *first, *waiting)
    assert rule.action == [2, 4, 7]
    rule = rules(3)
    rule.action = [2, 3, 4]
    step(rule, *first, waiting[0])
    assert rule.action == [2, 4]
    step(rule, *first, waiting[0])
    assert rule.action == [2, 4, 1]


@pytest.mark.parametrize("first", ["v1.a_1", "v1.a_3"])
def test_of_one_lane_only_one_goes(first: str) -> None:
    """Of one movement the later entry; a1 comes before a3."""
    rule = rules()
    rule.action = [1]
    step(rule, car(first, 487.9), car("v2.a_1", 485.0))
    assert rule.action == [1, 2]
    assert rule.chosen == (2,)


@pytest.mark.parametrize(("driven", "chosen"), [(490.01, ()), (508.0, ()), (508.01, (2,))])
def test_no_decision_while_the_junction_is_busy(driven: float, chosen: tuple[int, ...]) -> None:
    rule = rules()
    rule.serving = [1]
    step(rule, car("v1.c_1", driven), car("v2.a_1", 486.0))
    assert rule.chosen == chosen


def test_the_bound_itself_is_yellow() -> None:
    rule = rules()
    step(rule, car("v1.c_2", 490.0))
    assert rule.chosen == (1,)  # not yet in `serving`, so not green either


def test_in_the_green_zone_it_goes_without_right_of_way_and_blocks() -> None:
    rule = rules()
    step(rule, car("v1.a_2", 480.0), car("v2.b_2", 480.0))
    assert step(rule, car("v1.a_2", 486.0), car("v2.b_2", 486.0)) == {1: GO_SPEED, 2: HELD_SPEED}
    assert rule.chosen == (1,)
    speeds = step(rule, car("v1.a_2", 487.0), car("v2.b_2", 488.0))
    assert speeds == {1: GO_SPEED, 2: GREEN_SPEED}
    # no decision about a new vehicle while it is there
    step(rule, car("v1.a_2", 487.0), car("v2.b_2", 488.0), car("v3.c_1", 486.0))
    assert rule.chosen == (1,)


def test_outside_the_action_list_the_green_zone_is_yellow() -> None:
    rule = rules(3)
    rule.action = [1, 2, 3]
    rule.serving = [4]
    others = [car(f"v{k}.{a}_1", 487.5) for k, a in ((1, "a"), (2, "b"), (3, "c"))]
    assert step(rule, *others, car("v4.c_2", 491.0))[4] == HELD_SPEED


def test_the_right_of_way_lasts_until_the_next_decision() -> None:
    """Beyond 506 m it still asks for 10 m/s, not 20, as long as others keep the junction busy."""
    rule = rules()
    rule.chosen, rule.action = (1,), [1]
    speeds = step(rule, car("v1.a_1", 506.5), car("v2.c_1", 495.0))
    assert speeds == {1: GO_SPEED, 2: EXIT_SPEED}
    speeds = step(rule, car("v1.a_1", 509.0), car("v2.c_1", 508.5))
    assert speeds == {1: EXIT_SPEED, 2: EXIT_SPEED}


def test_a_vehicle_that_loses_the_right_of_way_is_told_20_for_one_step() -> None:
    rule = rules()
    step(rule, car("v2.c_2", 485.5))
    assert rule.chosen == (2,)
    speeds = step(rule, car("v2.c_2", 485.6), car("v3.b_2", 485.0))
    assert rule.chosen == (3,)
    assert speeds == {2: EXIT_SPEED, 3: GO_SPEED}
    assert step(rule, car("v2.c_2", 485.7), car("v3.b_2", 485.1))[2] == HELD_SPEED


@pytest.mark.parametrize(
    ("options", "cars", "chosen"),
    [
        ({"order": "lanes"}, "v1.a_3 v2.b_2 v4.d_2", (1,)),
        ({"order": "size"}, "v1.a_3 v2.b_2 v4.d_2", (2, 4)),
        # In conflict; in the runs at 4:1:4:1 the second arm was called c.
        ({"names": "abcd"}, "v2.b_2 v3.c_2", (2,)),
        ({"names": "acbd"}, "v2.b_2 v3.c_2", (3,)),
    ],
)
def test_the_rules_decide_by_order_and_by_the_arms_names(
    options: dict[str, str], cars: str, chosen: tuple[int, ...]
) -> None:
    rule = rules(**options)
    step(rule, *(car(name, 486.0) for name in cars.split()))
    assert rule.chosen == chosen


@pytest.mark.parametrize(("arms", "differ"), [(3, 1), (4, 26), (5, 508)])
def test_how_often_the_orders_differ(arms: int, differ: int) -> None:
    """The counts of as_run.md, one vehicle per lane."""
    matrix = HarmonyMatrix.paper(arms)
    cases = [frozenset(case) for case in DecisionTable(matrix)]
    assert differ == sum(winner(matrix, c, "lanes") != winner(matrix, c, "size") for c in cases)
    assert winner(matrix, frozenset(), "lanes") == ()


def test_the_session_reads_views_and_tells_changes_once() -> None:
    site = four_way(profile="as_run").site()
    session = AsRunDim().start(site)
    origin = 492.8 - 4.1  # distance before the junction at insertion

    def seen(driven: float) -> View:
        return View(50.0, (Observed(7, 0, 2, origin - driven, 14.0, 4.0, 12.01),))

    assert list(session.decide(seen(465.0))) == [Advise(7, 10.0)]
    assert list(session.decide(seen(466.0))) == []
    assert list(session.decide(seen(485.0))) == [Wake(50.01)]  # 0, then 10 again: nothing to tell
    assert session.rules.action == [7]
    assert list(session.decide(seen(508.1))) == [Advise(7, 20.0), Wake(50.01)]
    assert list(session.decide(View(60.0, ()))) == []


def test_the_recipe_reaches_the_rules() -> None:
    dim = AsRunDim("size", HarmonyMatrix.paper(4), "acbd", 14.0)
    made = dim.start(four_way(profile="as_run").site()).rules
    assert (made.arms, made.order, made.names, made.exit_speed) == (4, "size", "acbd", 14.0)
    assert made.matrix is dim.matrix


def test_the_session_names_vehicles_by_second_lane_and_manoeuvre() -> None:
    """v100.b_2 before v20.a_1 and v20.a_2, whatever their ids and their order on the road."""
    session = AsRunDim().start(four_way(profile="as_run").site())
    distance = 492.8 - 4.1 - 486.0
    cars = [(1, 0, 2, 20.9), (2, 0, 1, 20.0), (3, 1, 2, 100.0)]
    session.decide(
        View(110.0, tuple(Observed(k, lane, j, distance, 0.0, 4.0, t) for k, lane, j, t in cars))
    )
    assert session.rules.action == [3, 2, 1]


def test_no_vehicle_outside_the_view_is_told_anything() -> None:
    """With the right of way far behind the junction, it is told 20 m/s at 600 m, for good."""
    site = four_way(profile="as_run").site()
    session = AsRunDim().start(site)
    origin = 492.8 - 4.1

    def seen(first: float, second: float | None) -> View:
        cars = [Observed(1, 0, 1, origin - first, 10.0, 4.0, 12.01)]
        if second is not None:
            cars.append(Observed(2, 2, 1, origin - second, 10.0, 4.0, 13.01))
        return View(50.0, tuple(cars))

    session.decide(seen(485.0, 485.0))
    assert session.rules.chosen == (1, 2)
    assert Advise(1, EXIT_SPEED) not in list(session.decide(seen(599.9, 491.0)))
    assert list(session.decide(seen(600.0, 491.0))) == [Advise(1, EXIT_SPEED)]
    assert 1 in session.rules.chosen  # the second one keeps the junction busy
    told = list(session.decide(View(51.0, seen(0.0, 492.0).vehicles[1:])))
    assert all(command.vehicle != 1 for command in told if isinstance(command, Advise))


def test_the_plan_wakes_where_a_zone_begins_or_ends() -> None:
    plan = AsRunDim().start(four_way(profile="as_run").site()).plan
    assert isinstance(plan, Plan)
    assert plan.marks == pytest.approx((23.7, 3.7, 0.7, -1.3, -17.3, -19.3, -111.3))
    assert plan.reach > 111.3 + 0.5  # a step at most
    assert plan.lanes_open
    long = AsRunDim().start(four_way(profile="as_run", arm_length=700.0).site()).plan
    assert long.reach == 0.0


def test_names_and_sites_that_the_rules_do_not_fit() -> None:
    with pytest.raises(InputError, match=r"^names must be different letters, got 'abca'"):
        AsRunDim(names="abca")
    with pytest.raises(InputError, match="3, 4 or 5 arms"):
        AsRunDim().start(regular(6, profile="as_run").site())
    with pytest.raises(InputError, match="matrix is for 3 arms"):
        AsRunDim(matrix=HarmonyMatrix.paper(3)).start(four_way().site())
    with pytest.raises(InputError, match="names must be 4 letters, one per arm, got 'abc'"):
        AsRunDim(names="abc").start(four_way().site())
    with pytest.raises(InputError, match="zones begin"):
        AsRunDim().start(four_way(arm_length=300.0).site())
    assert set(BOUND) == set(MAKERS)


@pytest.mark.parametrize(("manoeuvre", "seconds"), [(1, 63.99), (2, 64.26), (3, 64.24)])
def test_isolated_vehicles_take_the_published_time(manoeuvre: int, seconds: float) -> None:
    """SUMO 1.28: 63.99, 64.26, and 64.25 or 64.24 s."""
    road = four_way(profile="as_run")
    alone = replayed(road, (0.01, 3, manoeuvre), horizon=road.horizon)
    run = minisim.simulate(alone, AsRunDim())
    assert run.summary()["travel_time_s"] == pytest.approx(seconds, abs=0.0101)
    assert run.summary()["waiting_time_s"] == pytest.approx(0.16)


def test_the_session_is_woken_often_enough() -> None:
    """Called at every step, as the authors' script is, it says the same."""
    what = replace(replay("balanced", 350, 4), horizon=240.0)
    few = minisim.simulate(what, AsRunDim(), on_collision="record")
    many = minisim.simulate(what, EveryStep(AsRunDim()), on_collision="record")
    assert few.trips.equals(many.trips)
    assert few.summary()["unfinished"] > 0
