"""The vehicle of the published runs: law, step, insertion, leaders."""

from __future__ import annotations

import math

import numpy as np
import pytest

import minisim
from minisim.arrivals import Arrivals
from minisim.carfollowing import (
    cruise_control,
    distance_control,
    engine_lag,
    semi_implicit,
)
from minisim.control import Advise, Command, Plan, Site, Unregulated, View
from minisim.engine.cruise import accelerate, build_cruise
from minisim.engine.state import (
    DRIVING,
    build_lanes,
    build_law,
    build_road,
    build_vehicles,
)
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.vehicle import CruiseVehicle, VehicleType
from scenarios import AS_RUN, Scenario, four_way
from scenarios.published import published_ways

DT = AS_RUN.dt


def arrivals(*rows: tuple[float, int, int]) -> Arrivals:
    time, lane, manoeuvre = zip(*rows, strict=True)
    return Arrivals(np.array(time, float), np.array(lane), np.array(manoeuvre))


def scenario(*rows: tuple[float, int, int], horizon: float = 200.0) -> Scenario:
    return four_way(profile="as_run", recorded=arrivals(*rows), horizon=horizon)


def trace(*rows: tuple[float, int, int], until: float, controller: object = None) -> minisim.Run:
    simulation = minisim.Simulation(
        scenario(*rows), controller or Unregulated(), record="all", on_collision="record"
    )
    simulation.advance(until)
    return simulation.result()


# --- the law -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("v", "u"), [(0.0, 4.0), (10.0, 4.0), (13.0, 1.0), (14.0, 0.0), (15.0, -1.0), (20.0, -1.5)]
)
def test_cruise_control_is_proportional_within_its_bounds(v: float, u: float) -> None:
    assert cruise_control(v, 14.0, 1.0, 4.0, 1.5) == pytest.approx(u)


@pytest.mark.parametrize("v", [0.0, 5.0, 14.0])
def test_acc_is_in_equilibrium_at_headway_and_spacing(v: float) -> None:
    assert distance_control(v, 1.5 * v + 2.0, v, 1.5, 0.1, 2.0) == pytest.approx(0.0)


def test_acc_answers_speed_difference_and_spacing_error() -> None:
    assert distance_control(10.0, 17.0, 8.5, 1.5, 0.1, 2.0) == pytest.approx(-1.5 / 1.5)
    assert distance_control(10.0, 32.0, 10.0, 1.5, 0.1, 2.0) == pytest.approx(0.1 * 15.0 / 1.5)


def test_step_response_of_the_lag_is_geometric() -> None:
    """a_k = u·(1 − (1 − α)^k), α = dt/(lag + dt): within dt of the exponential of lag 0.5 s."""
    a, u, alpha = 0.0, 4.0, DT / (0.5 + DT)
    for k in range(1, 201):
        a = engine_lag(a, u, 0.5, DT)
        assert a == pytest.approx(u * (1.0 - (1.0 - alpha) ** k))
        assert a == pytest.approx(u * (1.0 - math.exp(-k * DT / 0.5)), abs=u * DT)


def test_without_lag_the_engine_obeys_at_once() -> None:
    assert engine_lag(-3.0, 2.0, 0.0, DT) == 2.0


def test_semi_implicit_step_moves_with_the_new_speed_and_never_reverses() -> None:
    assert semi_implicit(5.0, 10.0, -2.0, 0.1) == pytest.approx((5.98, 9.8))
    assert semi_implicit(5.0, 0.1, -2.0, 0.1) == (5.0, 0.0)


# --- the vehicle in the kernel -------------------------------------------------------------------


def test_a_vehicle_starts_at_rest_as_the_closed_form_says() -> None:
    frame = trace((0.0, 0, 2), until=3.0).trajectories
    alpha = DT / (0.5 + DT)
    k = np.arange(1, 201)
    speed = np.cumsum(4.0 * (1.0 - (1.0 - alpha) ** k)) * DT
    position = 4.0 + 0.1 + np.cumsum(speed) * DT  # SUMO's base position: length and 0.1 m
    assert frame["speed_mps"].to_numpy()[:200] == pytest.approx(speed)
    assert frame["s_m"].to_numpy()[:200] == pytest.approx(position)


def test_sixteen_steps_of_the_start_count_as_waiting() -> None:
    run = minisim.simulate(scenario((0.0, 0, 2)), Unregulated())
    assert run.summary()["waiting_time_s"] == pytest.approx(0.16)


def test_speed_limits_mean_nothing() -> None:
    """Nobody slows for a turn; the cruise speed holds all the way."""
    run = minisim.simulate(scenario((0.0, 0, 3)), Unregulated(), record="all")
    frame = run.trajectories
    inside = frame[(frame["s_m"] > 480.0) & (frame["s_m"] < 520.0)]
    assert inside["speed_mps"].to_numpy() == pytest.approx(14.0, abs=1e-6)
    assert run.site.intersection.turn_speed(run.site.intersection.movements[2], 5.5) < 9.0


def test_platoons_settle_at_the_gap_of_the_law() -> None:
    class Slow:
        name = "slow"

        def start(self, site: Site) -> SlowSession:
            return SlowSession()

    class SlowSession:
        plan = Plan(lanes_open=True, period=1.0, sight=500.0)

        def decide(self, view: View) -> list[Command]:
            return [Advise(0, 5.0)] if view.time < 2.0 else []

    frame = trace((0.0, 0, 2), (3.0, 0, 2), until=90.0, controller=Slow()).trajectories
    last = frame[frame["time_s"] == 90.0].set_index("vehicle")
    gap = last.loc[0, "s_m"] - 4.0 - last.loc[1, "s_m"]
    # the ACC's 1.5·v + 2 lies beyond minGap 2
    assert gap == pytest.approx(1.5 * 5.0 + 2.0 + 2.0, abs=0.05)


def test_insertion_waits_for_min_gap_and_nothing_else() -> None:
    trips = minisim.simulate(scenario((0.0, 0, 2), (0.0, 0, 1)), Unregulated()).trips
    leader = trace((0.0, 0, 2), until=5.0).trajectories
    room = leader.loc[leader["s_m"] - 4.0 >= 4.1 + 2.0, "time_s"].iloc[0]
    assert trips["depart_s"].tolist() == pytest.approx([0.0, room])
    assert room == pytest.approx(2.16)


def test_advice_of_zero_stops_within_a_metre_one_step_later() -> None:
    """SUMO's quirk: a desired speed of 0 asks for standstill within one step, from the next on."""

    class Stop:
        name = "stop"

        def start(self, site: Site) -> StopSession:
            return StopSession()

    class StopSession:
        plan = Plan(lanes_open=True, marks=(100.0,), sight=100.0)

        def decide(self, view: View) -> list[Command]:
            return [Advise(vehicle.id, 0.0) for vehicle in view.vehicles]

    frame = trace((0.0, 0, 2), until=60.0, controller=Stop()).trajectories
    s, v, a = (frame[c].to_numpy() for c in ("s_m", "speed_mps", "acceleration_mps2"))
    first = int(np.argmax(s >= 392.8))
    alpha = DT / (0.5 + DT)
    assert a[first + 1] == pytest.approx(-1.5 * alpha, abs=1e-6)
    assert a[first + 2] == pytest.approx((1 - alpha) * a[first + 1] - alpha * v[first + 1] / DT)
    assert a.min() == pytest.approx(-177.5, abs=0.1)  # 158 m/s² from 12.5 m/s, as_run: "about 160"
    assert s[-1] - s[first] == pytest.approx(1.03, abs=0.01)
    assert v[-1] == 0.0


def test_closed_lanes_hold_it() -> None:
    class Never:
        name = "never"

        def start(self, site: Site) -> NeverSession:
            return NeverSession()

    class NeverSession:
        plan = Plan(hold_distance=2.0)

        def decide(self, view: View) -> list[Command]:
            return []

    frame = trace((0.0, 0, 2), until=80.0, controller=Never()).trajectories
    assert frame["speed_mps"].iloc[-1] == 0.0
    assert 490.2 <= frame["s_m"].iloc[-1] <= 490.8
    assert frame["acceleration_mps2"].min() > -1.6


def test_it_arrives_a_decimetre_before_the_end_of_the_road() -> None:
    run = minisim.simulate(scenario((0.0, 0, 2)), Unregulated(), record="all")
    length = run.site.intersection.paths[1].length
    last = run.trajectories["s_m"].iloc[-1]
    assert last < length - 0.1 <= last + 14.0 * DT + 1e-6


def test_cruise_control_and_model_go_together() -> None:
    with pytest.raises(InputError, match="'cc' goes with a CruiseVehicle"):
        VehicleType(model="cc")
    with pytest.raises(InputError, match="car-following model of a CruiseVehicle"):
        CruiseVehicle(model="idm")
    with pytest.raises(InputError, match=r"lag \[s\]"):
        CruiseVehicle(lag=-1.0)


# --- who is followed -----------------------------------------------------------------------------


def test_who_joins_its_exit_slows_the_first_vehicle_of_another_lane() -> None:
    """d1 and b3 leave by arm a: b3 follows d1 from the moment that d1 is inside."""
    alone = trace((1.0, 1, 3), until=45.0).trajectories.set_index("time_s")["speed_mps"]
    both = trace((0.0, 3, 1), (1.0, 1, 3), until=45.0).trajectories
    second = both[both["vehicle"] == 1].set_index("time_s")["speed_mps"]
    first = both[both["vehicle"] == 0].set_index("time_s")["s_m"]
    entered = first.index[first >= 492.8][0]
    same = second.loc[:entered].to_numpy() - alone.loc[:entered].to_numpy()
    assert np.abs(same).max() == 0.0
    later = second.loc[entered + DT :].to_numpy() - alone.loc[entered + DT :].to_numpy()
    assert later.min() < -0.1


def test_who_only_crosses_does_not_slow_an_approaching_vehicle() -> None:
    alone = trace((2.0, 0, 2), until=36.0).trajectories["speed_mps"].to_numpy()
    both = trace((0.0, 1, 2), (2.0, 0, 2), until=36.0).trajectories
    second = both.loc[both["vehicle"] == 1, "speed_mps"].to_numpy()
    assert second == pytest.approx(alone, abs=0.0)


def chosen(*cars: tuple[int, int, float, float, float, int]) -> list[float]:
    """Accelerations [m/s²] of cars alone on the published 4-arm junction, one step on.

    Each is (lane, manoeuvre, s, v, a, tick of entering the junction); all want 10 m/s inside and
    14 m/s before it.
    """
    what = scenario(*((0.0, lane, manoeuvre) for lane, manoeuvre, *_ in cars))
    site = what.site(0)
    plan = Unregulated().start(site).plan
    road = build_road(site, plan)
    law = build_law(
        site, plan, depart_speed=what.depart_speed, record=None, record_window=(0.0, math.inf)
    )
    vehicles = build_vehicles(site, what.arrivals(0))
    lanes = build_lanes(site, vehicles, plan.lanes_open)
    cruise = build_cruise(site, len(vehicles))
    assert cruise is not None
    rows = []
    for lane, _, s, v, a, entered in cars:
        row = int(lanes[lane]["first"])
        vehicles["status"][row] = DRIVING
        cruise.memory["entered"][row] = entered
        for name, value in (("s", s), ("v", v), ("a", a)):
            vehicles[name][row] = value
        lanes["next"][lane] = row + 1
        if s >= law.entry:
            lanes["front"][lane] = row + 1
            vehicles["advice"][row] = 10.0
        exit_arm = int(road.ends[vehicles["path"][row], 2])
        if s >= road.ends[vehicles["path"][row], 0]:
            cruise.last[exit_arm] = row
        rows.append(row)
    accelerate(vehicles, lanes, road, law, cruise)
    return [float(vehicles["a"][row]) for row in rows]


def test_of_two_who_join_the_radar_shows_the_one_with_less_room() -> None:
    """SUMO 1.28, published arrivals of 4 arms at 350 veh/h, 1546.08 s: a1 looks at c3 and d2.

    Behind d2 are 49.42 m, behind the slower c3 50.44 m; with the speeds added it would be c3.
    """
    a1 = (0, 1, 435.31567089466705, 13.159965240067596, -2.164292267392976, 0)
    c3 = (2, 3, 496.9210771013592, 5.607380270153639, 3.9, 154482)
    d2 = (3, 2, 496.10070821309107, 6.852836973840388, 3.8, 154551)
    assert chosen(a1, c3, d2)[0] == pytest.approx(-2.1681235211490605, abs=1e-6)


@pytest.mark.parametrize(
    ("ahead", "acceleration"),
    [
        (506.9371341949611, 0.244816),  # still inside: the radar shows it, as if bumper to bumper
        (507.04277405851946, 0.26953906033426733),  # in the exit lane, its rear beside: nobody
    ],
)
def test_who_has_entered_the_exit_lane_from_beside_restrains_nobody(
    ahead: float, acceleration: float
) -> None:
    """SUMO 1.28, the same run at 1547.33 s: d2 beside c3, which it overlaps."""
    d2 = (3, 2, 505.68493538437724, 7.841895997802385, 0.23176776149717707, 154551)
    c3 = (2, 3, ahead, 10.56398635583315, 3.99, 154482)
    assert chosen(d2, c3)[0] == pytest.approx(acceleration, abs=1e-6)


# --- given ways ----------------------------------------------------------------------------------


def test_given_ways_are_the_lengths_of_the_published_networks() -> None:
    for arms, approach, lengths in (
        (3, 495.84, (5.88, 9.24)),
        (4, 492.8, (9.03, 14.4, 14.2)),
        (5, 491.6, (9.09, 15.22, 17.18, 15.55)),
    ):
        from scenarios.library import MAKERS

        junction = MAKERS[arms](profile="as_run").intersection
        assert junction.approach_length == pytest.approx(approach, abs=0.01)
        for path in junction.paths[: arms - 1]:
            wanted = lengths[path.movement.manoeuvre - 1]
            assert path.exit - path.entry == pytest.approx(wanted, abs=0.011)


@pytest.mark.parametrize(
    ("ways", "message"),
    [
        (published_ways(3), "12 curves"),
        ((*published_ways(4)[:-1], "way"), "d3: a Way of two or more points"),
        ((*published_ways(4)[:-1], published_ways(4)[0]._replace(length=0.1)), "way of d3"),
        ((*published_ways(4)[:-1], published_ways(4)[0]._replace(wait=50.0)), "waiting position"),
    ],
)
def test_ways_are_checked(ways: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Intersection((0.0, 90.0, 180.0, 270.0), ways=ways)  # type: ignore[arg-type]
