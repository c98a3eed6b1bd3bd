"""The vehicle of the published runs: law, step, insertion, leaders."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import minisim
from baselines import FixedTime, V2ICAsRun
from minisim.carfollowing import (
    cruise_control,
    distance_control,
    engine_lag,
    semi_implicit,
)
from minisim.control import Advise, Plan, Unregulated
from minisim.engine.cruise.ends import look
from minisim.engine.cruise.law import FASTEST, build_cruise
from minisim.engine.cruise.step import accelerate
from minisim.engine.state import AMBER, DRIVING, Records, build_lanes, build_layout, build_vehicles
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.laws import build_law
from minisim.vehicle import CruiseVehicle, VehicleType
from scenarios import AS_RUN, Scenario, four_way
from scenarios.library import MAKERS
from scenarios.paper import controller_of, replay
from scenarios.published import published_ways
from tests.builders import Fixed, Scripted, replayed

DT = AS_RUN.dt


def scenario(*rows: tuple[float, int, int]) -> Scenario:
    return replayed(four_way(profile="as_run"), *rows, horizon=200.0)


def trace(*rows: tuple[float, int, int], until: float, controller: object = None) -> minisim.Run:
    simulation = minisim.Simulation(
        scenario(*rows), controller or Unregulated(), record="all", on_collision="record"
    )
    simulation.advance(until)
    return simulation.result()


@pytest.mark.parametrize(
    ("v", "u"), [(0.0, 4.0), (10.0, 4.0), (13.0, 1.0), (14.0, 0.0), (15.0, -1.0), (20.0, -1.5)]
)
def test_cruise_control_is_proportional_within_its_bounds(v: float, u: float) -> None:
    assert cruise_control(v, 14.0, 1.0, 4.0, 1.5) == pytest.approx(u)


def test_acc_answers_speed_difference_and_spacing_error() -> None:
    for v in (0.0, 5.0, 14.0):
        assert distance_control(v, 1.5 * v + 2.0, v, 1.5, 0.1, 2.0) == pytest.approx(0.0)
    assert distance_control(10.0, 17.0, 8.5, 1.5, 0.1, 2.0) == pytest.approx(-1.5 / 1.5)
    assert distance_control(10.0, 32.0, 10.0, 1.5, 0.1, 2.0) == pytest.approx(0.1 * 15.0 / 1.5)


def test_step_response_of_the_lag_is_geometric() -> None:
    """a_k = u·(1 − (1 − α)^k), α = dt/(lag + dt): within dt of the exponential of lag 0.5 s."""
    a, u, alpha = 0.0, 4.0, DT / (0.5 + DT)
    for k in range(1, 201):
        a = engine_lag(a, u, 0.5, DT)
        assert a == pytest.approx(u * (1.0 - (1.0 - alpha) ** k))
        assert a == pytest.approx(u * (1.0 - math.exp(-k * DT / 0.5)), abs=u * DT)

    assert engine_lag(-3.0, 2.0, 0.0, DT) == 2.0, "without lag it obeys at once"


def test_semi_implicit_step_moves_with_the_new_speed_and_never_reverses() -> None:
    assert semi_implicit(5.0, 10.0, -2.0, 0.1) == pytest.approx((5.98, 9.8))
    assert semi_implicit(5.0, 0.1, -2.0, 0.1) == (5.0, 0.0)


def test_a_vehicle_starts_at_rest_as_the_closed_form_says() -> None:
    frame = trace((0.0, 0, 2), until=3.0).trajectories
    alpha = DT / (0.5 + DT)
    k = np.arange(1, 201)
    speed = np.cumsum(4.0 * (1.0 - (1.0 - alpha) ** k)) * DT
    position = 4.0 + 0.1 + np.cumsum(speed) * DT  # SUMO's base position: length and 0.1 m
    assert frame["speed_mps"].to_numpy()[:200] == pytest.approx(speed)
    assert frame["s_m"].to_numpy()[:200] == pytest.approx(position)


def test_speed_limits_mean_nothing() -> None:
    """No vehicle slows for a turn; the cruise speed holds all the way."""
    run = minisim.simulate(scenario((0.0, 0, 3)), Unregulated(), record="all")
    inside = run.trajectories[run.trajectories["s_m"].between(480.0, 520.0)]
    assert inside["speed_mps"].to_numpy() == pytest.approx(14.0, abs=1e-6)
    assert run.site.intersection.turn_speed(run.site.intersection.movements[2], 5.5) < 9.0


def test_platoons_settle_at_the_gap_of_the_law() -> None:
    slow = Fixed(Plan(lanes_open=True), (Advise(0, 5.0),))
    frame = trace((0.0, 0, 2), (3.0, 0, 2), until=90.0, controller=slow).trajectories
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
    """SUMO's quirk: a desired speed of 0 asks for standstill within a step, from the next on."""
    stop = Scripted(
        lambda view: [Advise(vehicle.id, 0.0) for vehicle in view.vehicles],
        Plan(lanes_open=True, marks=(100.0,), sight=100.0),
    )
    frame = trace((0.0, 0, 2), until=60.0, controller=stop).trajectories
    s, v, a = (frame[c].to_numpy() for c in ("s_m", "speed_mps", "acceleration_mps2"))
    first = int(np.argmax(s >= 392.8))
    alpha = DT / (0.5 + DT)
    assert a[first + 1] == pytest.approx(-1.5 * alpha, abs=1e-6)
    assert a[first + 2] == pytest.approx((1 - alpha) * a[first + 1] - alpha * v[first + 1] / DT)
    assert a.min() == pytest.approx(-177.5, abs=0.1)  # 158 m/s² from 12.5 m/s, as_run: "about 160"
    assert s[-1] - s[first] == pytest.approx(1.03, abs=0.01)
    assert v[-1] == 0.0


@pytest.mark.parametrize(
    ("v", "a", "wanted", "acceleration"),
    [
        (14.733474, -0.5484, 0.070323, -2.0682),
        (14.712792, -2.0682, 0.029533, -19.3866),
        (14.518926, -19.3866, 0.006979, -44.7599),
    ],
)
def test_a_desired_speed_near_0_lowers_the_top_speed_from_the_next_step_on(
    v: float, a: float, wanted: float, acceleration: float
) -> None:
    """SUMO 1.18, V2I-C, 4:1:4:1 at 250 veh/h, vehicle 80 from 280.79 s on.

    10000 km/h times `wanted` over the limit of 14 m/s is all that it may drive.
    """
    assert chosen((0, 2, 325.0, v, a, 0), wanted=wanted)[0] == pytest.approx(acceleration, abs=0.02)
    enough = v * 14.0 / FASTEST + 1e-3
    free = engine_lag(a, 14.0 - v, 0.5, DT)
    assert chosen((0, 2, 325.0, v, a, 0), wanted=enough)[0] == pytest.approx(free)


def test_closed_lanes_hold_it() -> None:
    never = Fixed(Plan(hold_distance=2.0))
    frame = trace((0.0, 0, 2), until=80.0, controller=never).trajectories
    assert frame["speed_mps"].iloc[-1] == 0.0
    assert 490.2 <= frame["s_m"].iloc[-1] <= 490.8
    assert frame["acceleration_mps2"].min() > -1.6


def test_it_arrives_a_decimetre_before_the_end_of_the_road() -> None:
    run = minisim.simulate(scenario((0.0, 0, 2)), Unregulated(), record="all")
    assert run.summary()["waiting_time_s"] == pytest.approx(0.16), "sixteen steps of the start"
    length = run.site.intersection.paths[1].length
    last = run.trajectories["s_m"].iloc[-1]
    assert last < length - 0.1 <= last + 14.0 * DT + 1e-6


def test_cruise_control_and_model_go_together() -> None:
    with pytest.raises(InputError, match="'cc' needs a CruiseVehicle"):
        VehicleType(model="cc")
    with pytest.raises(InputError, match="car-following model of a CruiseVehicle"):
        CruiseVehicle(model="idm")


def test_a_vehicle_bound_for_the_same_exit_slows_the_first_of_another_lane() -> None:
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


def test_a_crossing_vehicle_does_not_slow_an_approaching_one() -> None:
    alone = trace((2.0, 0, 2), until=36.0).trajectories["speed_mps"].to_numpy()
    both = trace((0.0, 1, 2), (2.0, 0, 2), until=36.0).trajectories
    second = both.loc[both["vehicle"] == 1, "speed_mps"].to_numpy()
    assert second == pytest.approx(alone, abs=0.0)


def chosen(
    *cars: tuple[int, int, float, float, float, int],
    sumo: str = "1.28",
    arms: int = 4,
    within: Scenario | None = None,
    light: int = 1,
    steps: int = 1,
    wanted: float = 14.0,
) -> list[float]:
    """Accelerations [m/s²] of cars alone on the published 4-arm junction, one step on.

    Each is (lane, manoeuvre, s, v, a, tick of entering the junction); all want 10 m/s inside and
    14 m/s before it. `light` is what all lanes show; `wanted` is what they desired in the step
    before, and in the last of `steps` all that they remember is of this scene.
    """
    profile = replace(AS_RUN, vehicle=replace(AS_RUN.vehicle, sumo=sumo))
    what = within or replace(MAKERS[arms](profile="as_run"), profile=profile)
    demanded = [(0.0, lane, manoeuvre) for lane, manoeuvre, *_ in cars]
    what = replayed(what, *demanded, horizon=200.0)
    site = what.site(0)
    plan = Unregulated().start(site).plan
    layout = build_layout(site, plan)
    law = build_law(
        site, plan, depart_speed=what.depart_speed, record=None, record_window=(0.0, math.inf)
    )
    vehicles = build_vehicles(site, what.arrivals(0))
    lanes = build_lanes(site, vehicles, plan.lanes_open)
    lanes["open"] = light
    cruise = build_cruise(site, len(vehicles))
    assert cruise is not None
    cruise.memory["fastest"] = FASTEST * wanted / 14.0
    rows = []
    for lane, _, s, v, a, entered in cars:
        row = int(lanes[lane]["next"])
        vehicles["status"][row] = DRIVING
        cruise.memory["entered"][row] = entered
        if s >= law.entry + cruise.waits[vehicles["path"][row], 0]:
            cruise.memory["merged"][row] = entered
        for name, value in (("s", s), ("v", v), ("a", a)):
            vehicles[name][row] = value
        lanes["next"][lane] = row + 1
        if s >= law.entry:
            lanes["front"][lane] = row + 1
            vehicles["advice"][row] = 10.0
        exit_arm = int(layout.ends[vehicles["path"][row], 2])
        if s >= layout.ends[vehicles["path"][row], 0]:
            cruise.last[exit_arm] = row
            cruise.memory["left"][row] = 1
        rows.append(row)
    before = vehicles["a"].copy()
    for _ in range(steps):
        vehicles["a"] = before
        accelerate(vehicles, lanes, layout, law, cruise)
    return [float(vehicles["a"][row]) for row in rows]


def test_of_two_merging_vehicles_the_radar_shows_the_one_with_less_room() -> None:
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
        (507.04277405851946, 0.26953906033426733),  # in the exit lane, its rear beside: no leader
    ],
)
def test_a_vehicle_beside_in_the_exit_lane_holds_no_other_back(
    ahead: float, acceleration: float
) -> None:
    """SUMO 1.28, the same run at 1547.33 s: d2 beside c3, which it overlaps."""
    d2 = (3, 2, 505.68493538437724, 7.841895997802385, 0.23176776149717707, 154551)
    c3 = (2, 3, ahead, 10.56398635583315, 3.99, 154482)
    assert chosen(d2, c3)[0] == pytest.approx(acceleration, abs=1e-6)


def asked(v: float, gap: float, v_leader: float, a: float = 0.0) -> float:
    """Acceleration of the next step behind such a leader [m/s²]."""
    return engine_lag(a, distance_control(v, gap, v_leader, 1.5, 0.1, 2.0), 0.5, DT)


def test_its_radar_sees_a_vehicle_that_only_crosses() -> None:
    """SUMO 1.18, published arrivals of 4 arms at 150 veh/h, 56.67 s: b3 enters, a2 brakes."""
    a2 = (0, 2, 458.4373174449642, 14.0, 0.0, 0)
    b3 = (1, 3, 492.81891454751445, 4.140555090130774, 3.798889819738527, 5667)
    assert chosen(a2, b3, sumo="1.18")[0] == pytest.approx(-0.12575921087361053, abs=1e-6)
    assert chosen(a2, b3, sumo="1.28")[0] == pytest.approx(0.0, abs=1e-9)


def test_its_radar_sees_one_from_its_own_lane_that_turns_off_elsewhere() -> None:
    a1, a3 = (0, 1, 460.0, 14.0, 0.0, 0), (0, 3, 497.5, 5.0, 0.0, 10)
    # The ways part 4.97 m before the end of that of a1, which is 9.03 m long.
    gap = (492.8 + 9.03 - 4.967 - 460.0) - 2.0 - (4.064 - (497.5 - 492.8 - 4.0))
    assert chosen(a3, a1, sumo="1.18")[1] == pytest.approx(asked(14.0, gap, 5.0), abs=1e-3)
    assert chosen(a3, a1, sumo="1.28")[1] == pytest.approx(0.0, abs=1e-9)


def test_one_before_a_waiting_position_that_has_priority_is_bumper_to_bumper() -> None:
    """b2 must give way to a3; c2 must not."""
    a3 = (0, 3, 496.0, 5.0, 0.0, 10)
    b2, c2 = (1, 2, 460.0, 14.0, 0.0, 0), (2, 2, 460.0, 14.0, 0.0, 0)
    assert chosen(b2, a3, sumo="1.18")[0] == pytest.approx(asked(14.0, 0.0, 5.0))
    assert chosen(b2, a3, sumo="1.28")[0] == pytest.approx(0.0, abs=1e-9)
    assert chosen(c2, a3, sumo="1.18")[0] == pytest.approx(0.0, abs=1e-9)


def test_an_overlap_with_one_inside_counts_as_bumper_to_bumper() -> None:
    """d1 and b3 leave by arm a: 1.28 takes the room up to the junction instead."""
    b3, d1 = (1, 3, 492.6, 10.0, 0.0, 0), (3, 1, 493.0, 5.0, 0.0, 10)
    assert chosen(b3, d1, sumo="1.18")[0] == pytest.approx(asked(10.0, 0.0, 5.0))
    assert chosen(b3, d1, sumo="1.28")[0] == pytest.approx(asked(10.0, 0.2, 5.0))


def test_inside_the_one_that_must_yield_counts_from_its_waiting_position() -> None:
    """a3 entered first, but c2, to which it must give way, came before it passed its position."""

    def against(a3_at: float) -> list[float]:
        return chosen((0, 3, a3_at, 5.0, 0.0, 10), (2, 2, 494.0, 5.0, 0.0, 20), sumo="1.18")

    alone = chosen((0, 3, 496.0, 5.0, 0.0, 10), sumo="1.18")
    assert against(496.0)[0] < alone[0] - 0.01  # still before it: c2 leads
    assert against(498.0)[0] == pytest.approx(alone[0], abs=1e-9)


@pytest.mark.parametrize(
    ("arm", "back", "delay"),
    # A vehicle at 14 m/s wants 14 m, and the turnaround of 4.67 m counts.
    [(1, 0.5, 0.5), (2, 0.5, 0.5), (1, 0.9, 0.0), (0, 0.5, 0.0), (3, 0.5, 0.0)],
)
def test_where_the_road_leads_back_one_that_arrives_delays_an_insertion(
    arm: int, back: float, delay: float
) -> None:
    """The other leaves by the same arm, `back` s after the insertion is due."""
    first = (0.0, (arm + 2) % 4, 2)
    when = round(trace(first, until=100.0).columns.arrival[0] - back, 2)
    columns = trace(first, (when, arm, 2), until=when + 3.0).columns
    assert columns.depart[columns.lane == arm][0] - when == pytest.approx(delay)


def test_teleport_takes_the_one_off_the_road_that_runs_into_another_on_its_exit() -> None:
    """SUMO 1.18, published arrivals of 4:3:2:1 at 350 veh/h: b2 of 148 s, at 195.98 s."""
    what = replace(replay("4:3:2:1", 350, 4), horizon=200.0)
    run = minisim.simulate(what, controller_of("4:3:2:1", 350, 4), on_collision="teleport")
    assert run.columns.arrival[72] == pytest.approx(195.98)
    with pytest.raises(InputError, match="'teleport' needs a CruiseVehicle"):
        minisim.simulate(four_way(profile="fair"), Unregulated(), on_collision="teleport")


def test_its_top_speed_holds_up_to_the_junctions_exit_only() -> None:
    """V2I-C tells a1 20 m/s on the approach: 54.30 s; as if it could be faster, 54.28 s."""
    for top, travel in ((20.0, 54.30), (30.0, 54.28)):
        vehicle = replace(AS_RUN.vehicle, max_speed=top)
        what = replace(scenario((4.0, 0, 1)), profile=replace(AS_RUN, vehicle=vehicle))
        run = minisim.simulate(what, V2ICAsRun())
        assert run.columns.travel_time[0] == pytest.approx(travel)


def test_given_ways_are_the_lengths_of_the_published_networks() -> None:
    for arms, approach, lengths in (
        (3, 495.84, (5.88, 9.24)),
        (4, 492.8, (9.03, 14.4, 14.2)),
        (5, 491.6, (9.09, 15.22, 17.18, 15.55)),
    ):
        junction = MAKERS[arms](profile="as_run").intersection
        assert junction.approach_length == pytest.approx(approach, abs=0.01)
        drawn = [path.exit - path.entry for path in junction.paths[: arms - 1]]
        assert drawn == pytest.approx(lengths, abs=0.011)


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


@pytest.mark.parametrize(
    ("scene", "acceleration"),
    [
        (60902, 2.6386286934876324),  # it hardly moves, and yields to a1 on its exit
        (60914, 2.7159611690461105),  # it would drive 0.1 m/s in the next step
    ],
)
def test_one_that_hardly_moves_inside_and_yields_is_not_seen(
    scene: int, acceleration: float
) -> None:
    """SUMO 1.18, fixed-time, 4:3:2:1 at 350 veh/h: a3 (vehicle 157) has run amber, d2 sets off.

    d2's way is the straightest onto the exit that a1 has not left with its tail.
    """
    cars = {
        60902: (
            (0, 1, 501.83 + 2.4206112561810453, 11.24375821062331, 2.7224838604087864, 60743),
            (0, 3, 482.5898209318934, 8.3513480053597, 2.611401267357394, 0),
            (3, 2, 492.8 + 3.1218762028245055e-05, 0.00233756247597078, 0.15532487504805842, 60901),
        ),
        60914: (
            (0, 1, 501.83 + 3.7910690728796372, 11.569483523355508, 2.6966321078019106, 60743),
            (0, 3, 483.6132912956612, 8.684498951193401, 2.9050993756897014, 0),
            (3, 2, 492.8 + 0.004124975411724168, 0.07575004917657889, 0.968499901646841, 60901),
        ),
    }
    a = chosen(*cars[scene], within=replay("4:3:2:1", 350, 4, "fts"), steps=2)
    assert a[1] == pytest.approx(acceleration, abs=1e-6)


def test_one_that_yields_to_none_is_seen_however_slow() -> None:
    """As above, but a1 is gone, or bound for another exit."""
    a3 = (0, 3, 482.5898209318934, 8.3513480053597, 2.611401267357394, 0)
    d2 = (3, 2, 492.8 + 3.1218762028245055e-05, 0.00233756247597078, 0.15532487504805842, 60901)
    a2 = (0, 2, 507.2 + 2.4, 11.24, 2.72, 60743)
    for ahead in ((), (a2,)):
        a = chosen(*ahead, a3, d2, within=replay("4:3:2:1", 350, 4, "fts"), steps=2)
        assert a[len(ahead)] == pytest.approx(asked(a3[3], 0.0, d2[3], a3[4]))


# --- speed mode 31: limits and lights -------------------------------------------------------------


@pytest.mark.parametrize(("light", "behind"), [(AMBER, "b3"), (0, "b3"), (1, "b1")])
def test_beyond_an_amber_or_red_light_only_the_radar_sees(light: int, behind: str) -> None:
    """SUMO 1.18, fixed-time, 4:1:4:1 at 300 veh/h, amber at 564.58 s: vehicle 157 (b1) looks ahead.

    The radar shows b3 on its lane, but not b1 inside, on its own way.
    """
    cars = (
        (1, 1, 492.8 + 3.2464104484473673, 9.002269266332927, -3.532411732476959, 56400),
        (1, 3, 471.2881541858806, 11.788475019923231, -0.9664430021294024, 0),
        (1, 1, 444.8136683339488, 11.708889772558932, 0.6017198310020788, 0),
    )
    a = chosen(*cars, within=replay("4:1:4:1", 300, 4, "fts"), light=light)
    (_, _, inside, its, *_), _, (_, _, s, v, before, _) = cars
    b1 = asked(v, inside - 4.0 - s - 2.0, its, before)
    assert a[2] == pytest.approx({"b3": 0.5921527802852822, "b1": b1}[behind], abs=1e-6)


def obeying(
    s: float, v: float, a: float, *, lane: int = 0, manoeuvre: int = 1
) -> tuple[Records, Callable[[], bool]]:
    """The vehicle's acceleration, and its row, of a car alone that obeys limits at a red light."""
    car = (0.0, lane, manoeuvre)
    what = replayed(MAKERS[4](profile="as_run_obeying"), car, horizon=200.0)
    site = what.site(0)
    layout = build_layout(site, FixedTime().start(site).plan)
    law = build_law(
        site, FixedTime().start(site).plan, depart_speed=0.0, record=None,
        record_window=(0.0, math.inf),
    )  # fmt: skip
    vehicles = build_vehicles(site, what.arrivals(0))
    lanes = build_lanes(site, vehicles, lanes_open=False)
    cruise = build_cruise(site, 1)
    assert cruise is not None
    vehicles["status"], lanes["next"][lane] = DRIVING, 1
    vehicles["s"], vehicles["v"], vehicles["a"] = s, v, a
    lanes["front"][lane] = int(s >= law.entry)
    accelerate(vehicles, lanes, layout, law, cruise)
    return vehicles, lambda: look(vehicles, lanes, layout, law, cruise, 1)


def test_a_limit_counts_for_the_first_step_beyond_it_and_through_the_lag() -> None:
    """SUMO 1.18, fixed-time, 4:3:2:1 at 150 veh/h, 83.29 s: vehicle 6 (d1) has entered its turn."""
    v, before = 13.798586948920386, 13.797885076884404
    vehicles, _ = obeying(492.8 + 0.06216767704455606, v, (v - before) / 0.01, lane=3)
    assert v + vehicles["a"][0] * 0.01 == pytest.approx(13.65636158917291, abs=1e-9)


def test_it_stops_dead_on_the_line_at_red_and_starts_from_an_engine_at_rest() -> None:
    """SUMO 1.18, the same run, 53.18 s: vehicle 1 (c2) stops from 14 m/s within a step."""
    vehicles, after = obeying(492.78271338554714, 13.999999999995646, 0.0)
    assert 13.999999999995646 + vehicles["a"][0] * 0.01 == 0.0
    after()
    assert vehicles["s"][0] == pytest.approx(492.8, abs=1e-8)
    assert vehicles["s"][0] < 492.8
    assert vehicles["a"][0] == 0.0
