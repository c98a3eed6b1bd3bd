"""The engine against closed forms: free flow, limits, hold lines, queues, metrics, errors."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import minisim
from dim import Dim
from minisim.control import (
    LATERAL_ACCELERATION,
    Accelerate,
    Advise,
    Brake,
    Close,
    Command,
    Go,
    Hold,
    Marking,
    Open,
    Plan,
    Unregulated,
    View,
    Wake,
)
from minisim.errors import CollisionError, ControllerError, InputError
from minisim.results.metrics import MEANS
from minisim.results.summary import TRIP_COLUMNS
from minisim.simulation import Simulation
from minisim.vehicle import MODELS, CruiseVehicle, VehicleType
from scenarios import FAIR, PAPER, four_way, three_way
from scenarios.profiles import Profile
from scenarios.scenario import Scenario
from tests.builders import Fixed, Scripted, digest, python, rearranged, replayed

STRAIGHT = (0.0, 0, 2)
KRAUSS = dataclasses.replace(FAIR, name="krauss", vehicle=VehicleType(model="krauss"))


def lone(profile: Profile = FAIR, horizon: float = 200.0, manoeuvre: int = 2) -> Scenario:
    """One vehicle from lane a."""
    return replayed(four_way(profile=profile), (0.0, 0, manoeuvre), horizon=horizon)


@pytest.mark.parametrize("profile", [PAPER, FAIR], ids=lambda p: p.name)
def test_free_flow_takes_length_over_speed(profile: Profile) -> None:
    scenario = lone(profile)
    run = minisim.simulate(scenario, Unregulated())
    path = scenario.intersection.paths[1]
    expected = (path.length - profile.vehicle.length) / profile.speed_limit
    assert run.trips["travel_time_s"][0] == pytest.approx(expected, abs=profile.dt)
    assert run.trips["waiting_time_s"][0] == 0.0
    assert run.trips["time_loss_s"][0] == 0.0


def test_turning_vehicle_takes_the_arc_at_the_lateral_limit() -> None:
    """v = √(a_lat·r) on the arc, reached by braking at b: both closed forms."""
    scenario = lone(manoeuvre=1)
    run = minisim.simulate(scenario, Unregulated(), record="all")
    path = scenario.intersection.paths[0]
    limit = math.sqrt(LATERAL_ACCELERATION * path.radius)
    inside = run.trajectories.query(f"{path.entry} <= s_m <= {path.exit}")
    assert 0.99 * limit < inside["speed_mps"].max() <= limit
    before = run.trajectories.query(f"s_m < {path.entry}")
    braking = before["acceleration_mps2"].to_numpy()
    full = braking[braking < -1.0][1:-1]
    assert full == pytest.approx(-FAIR.vehicle.deceleration)
    distance = path.entry - before["s_m"][before["acceleration_mps2"] < -0.01].min()
    assert distance == pytest.approx((14.0**2 - limit**2) / (2 * 4.5), abs=14.0 * 0.1)


@pytest.mark.parametrize("hold_distance", [0.0, 2.0, 40.0])
@pytest.mark.parametrize(("profile", "spared"), [(PAPER, 0.0), (FAIR, 0.0), (KRAUSS, 0.1)])
def test_it_is_held_at_its_line(hold_distance: float, profile: Profile, spared: float) -> None:
    """It brakes at b, or up to a tenth less if it slows in whole steps, and not too early."""
    scenario = lone(profile, 120.0)
    run = minisim.simulate(scenario, Fixed(Plan(hold_distance=hold_distance)), record="all")
    line = scenario.intersection.approach_length - hold_distance
    last = run.trajectories.iloc[-1]
    assert 0.0 <= line - last["s_m"] <= 0.3
    assert last["speed_mps"] == 0.0
    braking = run.trajectories["acceleration_mps2"].min()
    assert braking == pytest.approx(-profile.vehicle.deceleration, rel=spared + 1e-6)
    begins = run.trajectories.query("acceleration_mps2 < -0.01")["s_m"].iloc[0]
    needed = profile.speed_limit**2 / (2 * profile.vehicle.deceleration)
    assert line - begins <= needed * (1.0 + spared) + 0.3


def test_marking_slows_ahead_of_its_start_and_ends() -> None:
    slow = Plan(lanes_open=True, markings=(Marking("slow", 100.0, 50.0, 5.0),))
    run = minisim.simulate(lone(), Fixed(slow), record="all")
    entry = run.site.intersection.approach_length
    inside = run.trajectories.query(f"{entry - 100} <= s_m < {entry - 50}")["speed_mps"]
    assert inside.max() <= 5.0 + 1e-9
    assert inside.min() == pytest.approx(5.0)
    assert run.trajectories.query(f"s_m > {entry + 100}")["speed_mps"].iloc[-1] > 13.0


def test_advice_caps_the_speed_and_infinity_lifts_it() -> None:
    advised = iter((8.0, math.inf))
    advisor = Scripted(
        lambda view: [Advise(0, next(advised))] if view.time else [],
        Plan(lanes_open=True, marks=(400.0, 300.0), sight=450.0),
    )
    run = minisim.simulate(lone(), advisor, record="all")
    entry = run.site.intersection.approach_length
    capped = run.trajectories.query(f"{entry - 330} < s_m < {entry - 305}")["speed_mps"]
    assert capped.to_numpy() == pytest.approx(8.0, abs=0.3)
    assert run.trajectories["speed_mps"].iloc[-1] > 13.0


def timed(
    script: dict[float, tuple[Command, ...]], reach: float = 0.0, is_open: bool = True
) -> Scripted:
    """A controller that gives commands at set times [s]."""
    plan = Plan(lanes_open=is_open, period=FAIR.dt, reach=reach)
    return Scripted(lambda view: script.get(view.time, ()), plan)


def braked(
    vehicle: VehicleType, script: dict[float, tuple[Command, ...]], reach: float = 60.0
) -> minisim.Run:
    """One vehicle at 14 m/s, straight on; it is in view up to `reach` past the entry [m]."""
    scenario = lone(dataclasses.replace(FAIR, vehicle=vehicle), 60.0)
    return minisim.simulate(scenario, timed(script, reach), record="all")


LAWS = {model: CruiseVehicle() if model == "cc" else VehicleType(model=model) for model in MODELS}


@pytest.mark.parametrize("asked", [3.0, 6.0, 50.0])
@pytest.mark.parametrize("model", LAWS)
@pytest.mark.parametrize("time", [20.0, 35.6], ids=["approach", "junction"])
def test_braking_takes_what_it_takes(model: str, asked: float, time: float) -> None:
    """v²/2b to standstill, wherever it is told to, by b or what its brakes can."""
    run = braked(LAWS[model], {time: (Brake(0, asked),)})
    trace = run.trajectories
    b = min(asked, LAWS[model].max_deceleration)
    before = trace[trace["time_s"] <= time + 1e-6].iloc[-1]
    assert before["speed_mps"] == pytest.approx(14.0, abs=0.2)
    rest = trace[trace["time_s"] > time + 1e-6]
    assert rest["acceleration_mps2"].min() == pytest.approx(-b)
    assert rest["speed_mps"].iloc[-1] == 0.0
    assert (trace[trace["speed_mps"] == 0.0]["acceleration_mps2"].iloc[1:] == 0.0).all()
    needed = before["speed_mps"] ** 2 / (2.0 * b)
    # A law that drives each step at its new speed comes v·dt/2 short of that.
    short = 14.0 * FAIR.dt / 2.0 if MODELS[model].stepwise else 0.0
    driven = trace["s_m"].iloc[-1] - before["s_m"]
    assert driven == pytest.approx(needed - short, abs=0.05)


@pytest.mark.parametrize("model", LAWS)
def test_braking_ends_when_lifted_and_changes_nothing_else(model: str) -> None:
    free = braked(LAWS[model], {})
    lifted = braked(LAWS[model], {20.0: (Brake(0, 0.0),)})
    assert digest(lifted) == digest(free)
    slowed = braked(LAWS[model], {20.0: (Brake(0, 4.0),), 22.0: (Brake(0, 0.0),)})
    speeds = slowed.trajectories.set_index("time_s")["speed_mps"]
    assert speeds.loc[22.0] == pytest.approx(6.0, abs=0.3)
    assert speeds.loc[40.0] > 12.0


def test_the_harder_of_two_brakings_counts() -> None:
    """A vehicle held at its line at 4.5 m/s² is not braked more softly by a command of 1."""
    held = minisim.simulate(lone(), Fixed(Plan()), record="all").trace["a"].min()
    told = minisim.simulate(lone(), timed({33.0: (Brake(0, 1.0),)}, is_open=False), record="all")
    assert told.trace["a"].min() == pytest.approx(held) == pytest.approx(-4.5)


def test_braking_ends_when_the_vehicle_leaves_the_view() -> None:
    """No session sees it any more, so none could lift it."""
    free = braked(LAWS["idm"], {}, reach=0.0)
    soft = braked(LAWS["idm"], {35.0: (Brake(0, 1.0),)}, reach=0.0)
    assert soft.trace["v"].min() == pytest.approx(12.5, abs=0.7)
    assert soft.trace["v"][-1] > 13.9
    gone = braked(LAWS["idm"], {50.0: (Brake(0, 9.0),)}, reach=0.0)
    assert digest(gone) == digest(free)


@pytest.mark.parametrize(("profile", "error"), [(FAIR, 0.2), (KRAUSS, 0.01)])
def test_queue_stands_at_the_minimum_gap(profile: Profile, error: float) -> None:
    trips = [(10.0 * k, 0, 2) for k in range(4)]
    scenario = replayed(four_way(profile=profile), *trips, horizon=200.0)
    run = minisim.simulate(scenario, Fixed(), record="all")
    s = run.trajectories.groupby("vehicle")["s_m"].last().to_numpy()
    assert s[:-1] - 5.0 - s[1:] == pytest.approx(profile.vehicle.min_gap, abs=error)
    assert run.summary()["complete"]["waiting_time_s"] > 100.0


def test_insertion_is_fifo_and_delay_grows_when_the_road_is_full() -> None:
    """A closed lane of 100 m holds (100 − 7.2 − 0.25) / 7.5 cars of 5 + 2.5 m; the rest wait."""
    trips = [(float(k), 0, 2) for k in range(20)]
    scenario = replayed(four_way(profile="fair", arm_length=100.0), *trips, horizon=300.0)
    run = minisim.simulate(scenario, Fixed())
    departed = run.columns.departed
    assert departed.sum() in (11, 12, 13)
    assert departed[: departed.sum()].all(), "first come, first on the road"
    delay = run.columns.depart_delay
    assert delay[-1] == pytest.approx(300.0 - 19.0)
    assert (np.diff(delay[departed]) >= -1.0).all()
    assert run.summary()["unfinished"] == 20
    assert run.summary()["waiting_time_s"] is None
    assert run.trips["depart_s"].isna().sum() == 20 - departed.sum()


def test_go_releases_one_vehicle_and_open_a_lane() -> None:
    trips = [(0.0, 0, 2), (0.0, 2, 2), (5.0, 2, 2)]
    scenario = replayed(four_way(), *trips, horizon=200.0)
    run = minisim.simulate(scenario, Fixed(first=(Go(0), Open(2))))
    assert run.columns.arrived.tolist() == [True, True, True]
    run = minisim.simulate(scenario, Fixed(first=(Go(0), Hold(0), Open(2), Close(2))))
    assert run.columns.arrived.tolist() == [False, False, False]


def test_hold_after_the_hold_line_stops_before_the_junction() -> None:
    """Revoked inside the green zone: it stands there, and does not creep to the junction."""

    def revoke(view: View) -> list[Command]:
        if view.time == 0.0:
            return [Go(0)]
        return [Hold(0)] if view.vehicles[0].distance < 11.0 else []

    revoking = Scripted(revoke, Plan(hold_distance=20.0, marks=(20.0, 10.0), sight=60.0))
    slow = lone(dataclasses.replace(FAIR, speed_limit=6.0), 300.0)
    run = minisim.simulate(slow, revoking, record="all")
    distance = run.site.intersection.approach_length - run.trajectories["s_m"].iloc[-1]
    assert 10.0 - 6.0**2 / 9.0 - 0.6 - 0.3 < distance < 10.0 - 6.0**2 / 9.0 + 0.3
    assert run.trajectories["speed_mps"].iloc[-1] == 0.0


@pytest.mark.parametrize(
    ("plan", "answer", "step"),
    [(Plan(), lambda view: [Wake(view.time + 0.7)], 0.7), (Plan(period=0.5), lambda view: (), 0.5)],
    ids=["wake", "period"],
)
def test_wake_ups_come_on_the_tick(plan: Plan, answer: Any, step: float) -> None:
    times: list[float] = []

    def note(view: View) -> Any:
        times.append(view.time)
        return answer(view)

    minisim.simulate(replayed(four_way(), (6.0, 0, 1), horizon=7.0), Scripted(note, plan))
    assert times == pytest.approx(np.arange(0.0, 7.01, step))


def test_a_session_may_rest_while_the_junction_is_occupied() -> None:
    demanded = (0.0, 0, 2), (2.5, 0, 2), (2.5, 2, 1), (9.0, 0, 2)
    scenario = replayed(four_way(), *demanded, horizon=100.0)
    views: dict[bool, list[View]] = {False: [], True: []}
    for rests, seen in views.items():
        plan = Plan(marks=(20.0,), wake_on_clear=True, wake_when_empty=rests, lanes_open=True)
        noting = Scripted(lambda view, seen=seen: seen.append(view) or (), plan)  # type: ignore[misc]
        minisim.simulate(scenario, noting)
    empty = [it for it in views[False] if all(v.distance >= 0.0 for v in it.vehicles)]
    assert views[True] == empty
    assert 3 < len(empty) < len(views[False])


def test_collision_stops_the_run_with_a_replayable_report() -> None:
    scenario = replayed(four_way(), (0.0, 0, 2), (0.0, 1, 2), horizon=100.0)
    with pytest.raises(CollisionError) as caught:
        minisim.simulate(scenario, Unregulated(), seed=3)
    (collision,) = caught.value.collisions
    assert collision.vehicles == (0, 1)
    assert collision.movements == ("a2", "b2")
    assert "a2" in str(caught.value)
    assert "seed 3" in str(caught.value)
    again = caught.value.replay(seconds=5.0)
    assert again.collisions == (collision,)
    assert again.trajectories["time_s"].min() == pytest.approx(collision.time - 5.0, abs=0.11)
    run = minisim.simulate(scenario, Unregulated(), on_collision="record")
    assert len(run.collisions) == run.summary()["collisions"] == 1
    assert run.columns.arrived.all()


def test_overlap_in_a_lane_is_a_collision_that_no_floor_hides() -> None:
    """The law does not let it happen, so the follower is put into its leader."""
    scenario = replayed(four_way(), (0.0, 0, 2), (5.0, 0, 2), horizon=100.0)
    sim = Simulation(scenario, Unregulated())
    sim.advance(20.0)
    sim.result()  # brings the rows up to date
    sim._vehicles["s"][1] = sim._vehicles["s"][0] - 3.0
    rearranged(sim)
    with pytest.raises(CollisionError, match=r"vehicle 0 .* vehicle 1"):
        sim.advance(21.0)


def test_metrics_come_in_two_forms() -> None:
    """One trip ends, one is held until the horizon, one never gets on the road."""
    trips = [(0.0, 0, 2), (0.0, 1, 2), (99.95, 2, 2)]
    scenario = replayed(four_way(profile="fair"), *trips, horizon=100.0)
    summary = minisim.simulate(scenario, Fixed(first=(Open(0),))).summary()
    assert (summary["trips"], summary["unfinished"]) == (3, 2)
    arrived = summary["lanes"]["a"]["travel_time_s"]
    assert summary["travel_time_s"] == arrived
    assert summary["lanes"]["b"]["travel_time_s"] is None
    complete = summary["complete"]
    assert complete["travel_time_s"] == pytest.approx((arrived + 100.0) / 2, abs=0.11)
    assert complete["waiting_time_s"] > 20.0
    assert complete["depart_delay_s"] == pytest.approx(0.05 / 3, abs=0.05)
    assert set(MEANS) <= set(complete)


def test_a_run_has_the_documented_columns_and_keys() -> None:
    run = minisim.simulate(three_way(100, horizon=300.0), Dim(), seed=2)
    assert tuple(run.trips.columns) == TRIP_COLUMNS
    assert run.trips["demand_time_s"].is_monotonic_increasing
    assert run.trips["vehicle"].tolist() == list(range(len(run.trips)))
    ended = run.trips.dropna()
    travel = (ended["arrival_s"] - ended["depart_s"]).to_numpy()
    assert travel == pytest.approx(ended["travel_time_s"].to_numpy())
    documented = (
        "controller scenario profile density seed horizon_s trips unfinished waiting_time_s "
        "travel_time_s depart_delay_s lanes collisions complete"
    )
    assert set(documented.split()) <= set(run.summary())
    assert set(run.summary()["lanes"]) == set(run.trips["lane"]) == {"a", "b", "c"}


def test_a_seed_gives_the_same_bytes_in_two_processes_compiled_and_plain() -> None:
    assert _digest_elsewhere() == _digest_elsewhere(PYTHONHASHSEED="7", MINISIM_JIT="0")


def test_advancing_in_pieces_is_the_same_run() -> None:
    scenario = four_way(300, horizon=300.0)
    whole = minisim.simulate(scenario, Dim(), seed=6)
    sim = Simulation(scenario, Dim(), seed=6)
    for k in range(1, 301):
        sim.advance(float(k))
    assert sim.finished
    assert digest(sim.result()) == digest(whole)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scenario": "four-way"}, "scenario must be"),
        ({"controller": "dim"}, "is not a controller"),
        ({"controller": Dim}, "is not a controller"),
        ({"seed": -1}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"record": "everything"}, "record"),
        ({"record": "all", "record_window": (5, 1)}, "record_window"),
        ({"on_collision": "ignore"}, "on_collision"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, object], message: str) -> None:
    call = {"scenario": four_way(horizon=10.0), "controller": Dim(), **arguments}
    with pytest.raises(InputError, match=message):
        minisim.simulate(**call)


@pytest.mark.parametrize(
    "command",
    [
        Go(99), Hold(-1), Go("x"), Open(4), Close(-1), Advise(0, -1.0), Brake(0, -1.0),
        Brake(9, 1.0), Brake(0, math.inf), Accelerate(9, 1.0), Accelerate(0, math.nan),
        Accelerate(0, -math.inf), Wake(0.0), "go", None,
    ],
    ids=repr,
)  # fmt: skip
def test_bad_commands_are_named(command: object) -> None:
    with pytest.raises(ControllerError, match="fixed"):
        minisim.simulate(lone(horizon=10.0), Fixed(first=(command,)))


def test_trajectories_need_a_recording() -> None:
    with pytest.raises(InputError, match="record"):
        _ = minisim.simulate(four_way(horizon=10.0), Dim()).trajectories


def test_recording_the_junction_is_part_of_recording_all() -> None:
    scenario = four_way(200, horizon=200.0)
    whole = minisim.simulate(scenario, Dim(), seed=1, record="all").trajectories
    part = minisim.simulate(scenario, Dim(), seed=1, record="junction").trajectories
    merged = part.merge(whole, how="left", on=["time_s", "vehicle"], suffixes=("", "_all"))
    assert 0 < len(part) < len(whole)
    assert (merged["s_m"] == merged["s_m_all"]).all()


def _digest_elsewhere(**environment: str) -> str:
    """Digest of four short runs in a process of its own."""
    code = """
import minisim
from dim import Dim
from baselines import FixedTime
from scenarios import five_way, four_way, three_way
from tests.builders import digest
for scenario, controller in (
    (four_way(350, horizon=150.0, arm_length=200.0), Dim()),
    (five_way(300, horizon=120.0, arm_length=200.0, profile="fair"), Dim(gate="harmonious")),
    (three_way(350, horizon=120.0, arm_length=200.0), FixedTime()),
    (four_way(300, profile="as_run_signals", horizon=60.0), FixedTime(greens=7.0)),
):
    print(digest(minisim.simulate(scenario, controller, seed=11, record="all")))
"""
    told = python("-c", code, **environment).stdout
    assert len(told.split()) == 4
    return told


@pytest.mark.parametrize("model", ["idm", "iidm"])
def test_advised_to_stand_a_follower_still_brakes_for_its_leader(model: str) -> None:
    """Both are told to stand, the leader later: comfortable braking alone would run into it."""
    vehicle = VehicleType(deceleration=1.5, acceleration=3.0, max_deceleration=6.0, model=model)
    profile = Profile(name="test", vehicle=vehicle, speed_limit=14.0)
    scenario = replayed(four_way(100, profile=profile), (0.0, 0, 2), (0.0, 0, 2), horizon=120.0)
    simulation = Simulation(scenario, Fixed(Plan(lanes_open=True)), on_collision="record")
    simulation.advance(20.0)
    simulation.result()  # brings the rows up to date
    rows = simulation._vehicles
    rows["v"][0], rows["advice"][:] = 2.0, 0.0  # the leader, suddenly slow
    rows["s"][1] = rows["s"][0] - vehicle.length - 40.0
    rows["v"][1] = 12.0  # stops in 48 m when comfortable, the leader in 1.3 m
    rearranged(simulation)
    simulation.advance(60.0)
    simulation.result()
    assert simulation.collisions == ()
    assert rows["v"][1] == 0.0
