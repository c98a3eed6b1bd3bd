"""V2I-C as it was run: its quirks one by one, and the published means."""

from __future__ import annotations

import numpy as np
import pytest

import minisim
from baselines import V2ICAsRun
from baselines.v2ic_as_run import AsRunList, Platoon, right_hand_conflicts
from dim import HarmonyMatrix
from minisim.errors import InputError
from scenarios import AS_RUN, five_way, four_way
from scenarios.paper import Cell, controller_of, replay
from tests.builders import reference_value, replayed

MOVEMENTS = four_way().intersection.movements


def index(name: str) -> int:
    return [str(m) for m in MOVEMENTS].index(name)


def platoon(id: int, name: str, driven: float, speed: float = 16.6) -> tuple[int, Platoon]:
    order = (0.0, MOVEMENTS[index(name)].origin, id)
    return id, Platoon(index(name), driven, speed, order)


def step(rules: AsRunList, *platoons: tuple[int, Platoon]) -> dict[int, float]:
    return rules.step(dict(platoons))


def test_the_conflicts_are_those_of_right_hand_traffic() -> None:
    """The authors' table: 6, 6 and 2 conflicts of manoeuvre 1, 2 and 3."""
    names = {
        str(m): {str(MOVEMENTS[q]) for q in right_hand_conflicts()[p]}
        for p, m in enumerate(MOVEMENTS)
    }
    assert names["a1"] == {"b1", "b2", "c2", "c3", "d1", "d2"}
    assert names["a2"] == {"b1", "b2", "c1", "d1", "d2", "d3"}
    assert names["a3"] == {"b2", "c1"}
    assert sum(map(len, names.values())) == 56


def test_of_60_foes_28_are_missing_and_24_are_spurious() -> None:
    """Against SUMO's foes: the paper's table, and the opposite far turns (as_run.md, no. 6)."""
    harmony = np.array(HarmonyMatrix.paper(4).values)
    foes = np.array(
        [[not harmony[p, q] and a.origin != b.origin for q, b in enumerate(MOVEMENTS)]
         for p, a in enumerate(MOVEMENTS)]
    )  # fmt: skip
    for a, b in (("a3", "c3"), ("b3", "d3")):
        foes[index(a), index(b)] = foes[index(b), index(a)] = True
    listed = np.zeros_like(foes)
    for p, row in enumerate(right_hand_conflicts()):
        listed[p, list(row)] = True
    assert (foes.sum(), (foes & ~listed).sum(), (listed & ~foes).sum()) == (60, 28, 24)


def test_vehicles_register_200_m_before_the_reference_and_leave_24_m_behind_it() -> None:
    rules = AsRunList()
    for driven, listed in ((199.99, []), (200.0, [1]), (423.9, [1]), (424.0, [])):
        step(rules, platoon(1, "a2", driven))
        assert rules.order == listed
    step(rules, platoon(2, "a2", 300.0))  # too late to register
    assert rules.order == []


def test_vehicles_that_register_in_one_step_come_in_the_order_of_lanes() -> None:
    rules = AsRunList()
    step(rules, platoon(1, "c2", 200.0), platoon(2, "a2", 200.0), platoon(3, "b1", 200.0))
    assert rules.order == [2, 3, 1]


def test_a_release_asks_for_20_m_s_at_most() -> None:
    for speed in (16.6, 5.0):
        rules = AsRunList()
        assert step(rules, platoon(1, "a2", 200.0, speed)) == {1: 20.0}
        assert step(rules, platoon(1, "a2", 300.0)) == {}  # for good


def test_for_one_step_a_released_vehicle_is_expected_to_leave_too_soon() -> None:
    """(20 − 16.6)/2.6 = 1.31 s: 2·180/1.31 − 16.6 m/s, cut to 20; then distance over speed."""
    rules = AsRunList()
    first, second = platoon(1, "a2", 200.0), platoon(2, "b2", 200.0)
    assert step(rules, first, second) == {1: 20.0, 2: 20.0}
    assert rules.granted == {1}
    leaving = 224.0 / (16.6 + 1e-5)
    assert step(rules, first, second)[2] == pytest.approx(2.0 * 180.0 / leaving - 16.6, abs=1e-3)


def test_a_waiting_vehicle_blocks_by_distance_over_speed_without_a_cap() -> None:
    rules = AsRunList()
    ahead, waiting, third = (
        platoon(1, "a2", 205.0), platoon(2, "b2", 203.0, 0.0), platoon(3, "c1", 200.0)
    )  # fmt: skip
    conflicts = right_hand_conflicts()
    assert index("c1") in conflicts[index("b2")]
    step(rules, ahead, waiting, third)
    assert step(rules, ahead, waiting, third)[3] == 0.0  # b2 never leaves: 224 m at 10⁻⁵ m/s


def test_no_vehicle_is_regulated_past_the_list() -> None:
    """Two straight vehicles that left the list: the junction 65 m on is not regulated."""
    rules = AsRunList()
    assert step(rules, platoon(1, "a2", 430.0), platoon(2, "b2", 430.0)) == {}


@pytest.mark.parametrize(("speed", "least", "most"), [(16.6, 54.25, 54.6), (14.0, 56.35, 56.7)])
def test_a_vehicle_alone(speed: float, least: float, most: float) -> None:
    """The isolated-vehicle times of the published runs, to their last digit."""
    scenario = four_way(100, profile=AS_RUN)
    for manoeuvre in (1, 2, 3):
        alone = replayed(scenario, (0.01, 0, manoeuvre), horizon=100.0)
        (travel,) = minisim.simulate(alone, V2ICAsRun(speed)).columns.travel_time
        assert least < travel < most


@pytest.mark.slow
@pytest.mark.parametrize("density", [150, 200, 250, 300, 350])
def test_replays_meet_the_published_means(density: int) -> None:
    """At 350 veh/h in SUMO with its junction check 55 pairs collided (as_run.md, no. 14)."""
    cell = Cell("balanced", density, 4, "v2ic")
    run = minisim.simulate(replay(*cell), controller_of(*cell), on_collision="record")
    travel = reference_value(cell, "travel_time_s")
    wait = reference_value(cell, "waiting_time_s")
    assert run.summary()["travel_time_s"] == pytest.approx(travel, abs=1.0)
    assert run.summary()["waiting_time_s"] == pytest.approx(wait, abs=0.1)
    assert density < 350 or 40 <= len(run.collisions) <= 70


def test_it_collides_where_the_matrix_is_blind() -> None:
    """b2 and c3 meet in left-hand traffic, not in right-hand: they register at once, and crash."""
    assert index("c3") not in right_hand_conflicts()[index("b2")]
    scenario = replayed(four_way(100, profile=AS_RUN), (0.01, 1, 2), (0.01, 2, 3), horizon=60.0)
    run = minisim.simulate(scenario, V2ICAsRun(), on_collision="record")
    assert [c.movements for c in run.collisions] == [("b2", "c3")]


def test_bad_input() -> None:
    with pytest.raises(InputError, match="4 arms"):
        V2ICAsRun().start(five_way(profile=AS_RUN).site(0))
    with pytest.raises(InputError, match=r"ends 424 m after insertion"):
        V2ICAsRun().start(four_way(profile=AS_RUN, arm_length=300.0).site(0))
