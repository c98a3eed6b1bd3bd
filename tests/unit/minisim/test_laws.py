"""The laws of a run: how each model inserts, follows and counts a vehicle ahead."""

from __future__ import annotations

import math
from itertools import product

import pytest

from minisim.control import Plan
from minisim.laws import (
    Law,
    build_law,
    closeness,
    drive,
    follow,
    hold,
    insertable,
    room_behind,
    stop_at_line,
    traits_of,
)
from minisim.testing import small_scenario
from minisim.vehicle import MODELS, CruiseVehicle, VehicleType

#: A vehicle of the usual kind.
CAR = traits_of(VehicleType())


def law(model: str) -> Law:
    vehicle = CruiseVehicle() if model == "cc" else VehicleType(model=model)
    return build_law(small_scenario(vehicle=vehicle).site(0), Plan())


@pytest.mark.parametrize("model", MODELS)
def test_nothing_is_inserted_closer_than_the_gap_at_standstill(model: str) -> None:
    assert insertable(2.4, 14.0, CAR, law(model)) < 0.0
    assert insertable(2.6, 14.0, CAR, law(model)) >= 0.0


def test_a_law_without_a_rule_of_its_own_inserts_at_any_speed() -> None:
    assert insertable(2.6, 0.0, CAR, law("cc")) == math.inf
    for model in ("idm", "iidm", "krauss"):
        assert insertable(2.6, 0.0, CAR, law(model)) < 1.0


@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
def test_a_vehicle_ahead_counts_more_the_closer_it_is(model: str) -> None:
    counts = [closeness(10.0, gap, 5.0, CAR, law(model)) for gap in (200.0, 50.0, 20.0, 5.0, 0.0)]
    assert counts == sorted(counts)
    assert counts[-1] == math.inf
    wanted = [follow(10.0, 14.0, z, CAR, law(model)) for z in counts[:-1]]
    assert wanted == sorted(wanted, reverse=True)
    assert wanted[0] > 0.0 > wanted[-1]


@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
def test_a_desired_speed_of_zero_is_comfortable_braking(model: str) -> None:
    assert follow(10.0, 0.0, 0.0, CAR, law(model)) == pytest.approx(-4.5)


@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
def test_advice_adds_nothing_to_hard_braking_for_a_leader(model: str) -> None:
    """The IDM would add both: V2I-C's vehicles braked at 8.7 m/s² behind leaders 17 m ahead."""
    for v, advice, gap in product((2.0, 7.0, 14.0), (0.0, 1.0, 6.5, 13.0), (5.0, 17.0, 40.0)):
        z = closeness(v, gap, 2.5, CAR, law(model))
        acc, alone = (drive(v, 14.0, told, z, CAR, law(model)) for told in (advice, math.inf))
        assert min(alone, -4.5) <= acc <= alone
        assert acc <= max(follow(v, advice, 0.0, CAR, law(model)), -4.5) + 1e-9


@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
def test_no_step_passes_an_advised_speed(model: str) -> None:
    coarse = law(model)._replace(dt=0.5)
    for v, advice in ((0.0, 0.5), (0.3, 0.5), (1.5, 2.0), (3.9, 4.0)):
        assert v + 0.5 * drive(v, 14.0, advice, 0.0, CAR, coarse) <= advice + 1e-9


@pytest.mark.parametrize("model", ["idm", "iidm", "krauss"])
def test_a_vehicle_that_rolled_off_and_is_held_again_brakes_comfortably(model: str) -> None:
    """0.2 m before the junction at 0.5 m/s, it braked with all that its brakes had."""
    held = law(model)
    assert hold(0.5, held.entry - 0.2, CAR, held) == pytest.approx(-4.5)
    assert hold(3.0, held.entry - 0.6, CAR, held) < -9.0, "it could not stop in time"


@pytest.mark.parametrize("name", MODELS)
def test_the_table_says_how_a_model_steps_and_where_it_inserts(name: str) -> None:
    assert law(name).semi_implicit == (name in ("krauss", "cc"))
    assert law(name).margin == (0.1 if name == "cc" else 0.0)  # as in SUMO, where it drives so
    assert list(MODELS)[law(name).model] == name


def test_sumos_vehicles_stop_a_metre_before_the_line_or_nearer_if_they_must() -> None:
    """SUMO 1.18, fixed-time, balanced 150: its vehicles stand 1.001 m before a red light."""
    signals = law("krauss")._replace(dt=0.01, sumo=True)
    me = CAR._replace(a=50.0, b=1000.0, b_max=1000.0)

    def ends(to_line: float, v: float) -> float:
        s = signals.hold - to_line
        for _ in range(100):
            v = max(v + stop_at_line(v, signals.hold - s, me, signals) * signals.dt, 0.0)
            s += v * signals.dt
        return signals.hold - s

    assert ends(5.0, 14.0) == pytest.approx(1.001, abs=1e-9)
    assert ends(0.9, 14.0) == pytest.approx(0.861, abs=1e-9)  # 0.04 m are what it needs to brake
    assert ends(0.05, 14.0) == pytest.approx(0.05)  # SUMO keeps 0.1 m, but never drives back


def test_whole_numbers_do_not_have_the_kernels_compiled_once_more() -> None:
    site = small_scenario(vehicle=VehicleType(acceleration=2, headway=1), speed_limit=14).site(0)
    made = build_law(site, Plan(), depart_speed=5, record=None, record_window=(0.0, math.inf))
    assert [type(x) for x in made] == [type(x) for x in law("idm")]
    assert all(type(x) is float for x in traits_of(site.vehicle))


def stops(v: float, b: float, time: float) -> float:
    """How far a vehicle has come after `time` of braking at b from speed v [m]."""
    braking = min(time, v / b)
    return v * braking - b * braking * braking / 2.0


@pytest.mark.parametrize("mine", [3.0, 9.0])
@pytest.mark.parametrize("b_leader", [3.0, 9.0])
def test_vehicles_with_other_brakes_never_touch_while_both_stop(
    mine: float, b_leader: float
) -> None:
    """Neither at the end nor on the way there, from the least gap that leaves room."""
    me, run = CAR._replace(b_max=mine), law("idm")._replace(room=0.0)
    for v, v_leader in ((20.0, 10.0), (10.0, 20.0), (15.0, 15.0), (5.0, 0.0)):
        other = room_behind(0.0, v_leader, b_leader, me, run) / (2.0 * mine)
        gap = max(v * v / (2.0 * mine) - other, 0.0)  # the room is just what it takes to stop
        times = [k / 100.0 for k in range(1000)]
        apart = [gap + stops(v_leader, b_leader, t) - stops(v, mine, t) for t in times]
        assert min(apart) > -1e-6
