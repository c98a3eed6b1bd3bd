"""SUMO as a host: the same controllers, commands and errors as in minisim."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from hypothesis import given

import minisim
from baselines import (
    V2IC,
    Actuated,
    Adaptive,
    AllWayStop,
    FixedTime,
    MaxPressure,
    Platoons,
    Reservation,
    Slots,
)
from dim import Dim, Mixed, NoisyPerception
from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Command,
    Controller,
    Go,
    Hold,
    Open,
    Plan,
    Site,
    Unregulated,
    View,
    Wake,
)
from minisim.errors import CollisionError, ControllerError, FileError, InputError, SumoError
from minisim.junction.geometry import Intersection
from minisim.results.driving import stops
from minisim.results.run import Run
from minisim.sumo import network, prepare, process, simulate, simulation
from minisim.testing import check_controller, small_scenario
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.profiles import FAIR
from scenarios.scenario import Scenario
from scenarios.strategies import intersections
from tests import ROOT
from tests.builders import Fixed, Greens, Pedals, Scripted, hardest_braking, queues, replayed, share
from tests.sumo.conftest import both
from tests.unit.scenarios.cli.test_cli import Captured, answer, fails, ok

FAIR_FOUR = four_way(100, profile="fair")


def single(manoeuvre: int = 2, horizon: float = 120.0, scenario: Scenario = FAIR_FOUR) -> Scenario:
    """One vehicle on lane a."""
    return replayed(scenario, (0.0, 0, manoeuvre), horizon=horizon)


def states(run: Run, vehicle: int) -> dict[int, tuple[float, float]]:
    """Position [m] and speed [m/s] of a vehicle at each tick."""
    lines = run.trace[run.rows["id"][run.trace["row"]] == vehicle].tolist()
    return {tick: (s, v) for tick, _, s, v, *_ in lines}


def furthest_apart(first: Run, second: Run, vehicle: int = 0) -> tuple[float, float]:
    """Largest difference of a vehicle's position [m] and speed [m/s] over common ticks."""
    a, b = states(first, vehicle), states(second, vehicle)
    common = sorted(a.keys() & b.keys())
    assert len(common) >= 0.95 * len(a)
    difference = np.abs([np.subtract(a[tick], b[tick]) for tick in common])
    return tuple(difference.max(axis=0).tolist())


CONTROLLERS: tuple[Controller, ...] = (
    Dim(), Dim(gate="harmonious"), FixedTime(), FixedTime(facing=True), Adaptive(), AllWayStop(),
    MaxPressure(facing=True), V2IC(), Reservation(), Slots(),
    Platoons(service="gated"), Mixed(share=0.5), Mixed(Dim(gate="harmonious"), 1.0),
)  # fmt: skip


@pytest.mark.parametrize(
    "controller", [*CONTROLLERS, pytest.param(Dim(gate="passed"), marks=pytest.mark.slow)],
    ids=lambda c: c.name,
)  # fmt: skip
@pytest.mark.parametrize(
    ("arms", "horizon"), [((4,), 60.0), pytest.param((3, 5), 120.0, marks=pytest.mark.slow)]
)
def test_contracts_in_sumo(controller: Controller, arms: tuple[int, ...], horizon: float) -> None:
    check_controller(controller, arms=arms, horizon=horizon, host="sumo")


def test_the_horizon_is_exclusive() -> None:
    scenario = replayed(FAIR_FOUR, *((t, 0, 2) for t in (0.0, 90.0, 90.0, 91.0)), horizon=90.0)
    summary = simulate(scenario, Unregulated()).summary()
    assert (summary["trips"], summary["unfinished"]) == (1, 0)


def test_what_happens_does_not_depend_on_the_horizon() -> None:
    profile = replace(FAIR, vehicle=replace(FAIR.vehicle, speed_deviation=0.1))
    road = four_way(300, profile=profile, arm_length=200.0)
    roads = (replace(road, horizon=t) for t in (80.0, 110.0))
    short, long = (simulate(road, Mixed(share=0.5), 3).trips for road in roads)
    over = short["arrival_s"] < 80.0
    assert over.sum() > 5
    assert short[over].equals(long[: len(short)][over])


@pytest.mark.parametrize("controller", [Unregulated(), Dim()], ids=lambda c: c.name)
@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
def test_a_vehicle_alone_drives_alike(controller: Controller, manoeuvre: int) -> None:
    """Markings, turns and free acceleration: one law in both hosts, to 2 mm.

    SUMO's way through the junction is the polyline, minisim's the arc: 1.4 mm at the exit.
    """
    ours, theirs = both(single(manoeuvre), controller, record="all")
    assert np.less(furthest_apart(ours, theirs), (0.002, 0.001)).all()
    assert theirs.columns.travel_time == pytest.approx(ours.columns.travel_time)
    assert theirs.columns.time_loss == pytest.approx(ours.columns.time_loss, abs=0.1)


@pytest.mark.parametrize("hold_distance", [0.0, 2.0, 40.0])
def test_a_held_vehicle_stops_at_its_line(hold_distance: float) -> None:
    ours, theirs = both(single(), Fixed(Plan(hold_distance=hold_distance)), record="all")
    position, speed = furthest_apart(ours, theirs)
    assert position < 0.03  # SUMO ends a step at standstill, minisim stops within it
    assert speed < 0.2
    (s, v) = states(theirs, 0)[1200]
    line = theirs.site.intersection.approach_length - hold_distance
    assert v == 0.0
    assert 0.0 <= line - s <= 0.3
    assert theirs.columns.waiting_time == pytest.approx(ours.columns.waiting_time, abs=0.3)
    assert not theirs.columns.arrived.any()


def timed(
    script: Mapping[float, tuple[Command, ...]] = MappingProxyType({}),
    plan: Plan = Plan(period=1.0, sight=400.0),  # noqa: B008  (a constant)
    seen: list[View] | None = None,
) -> Scripted:
    """Commands at set times, on a period of a second by default; notes the views in `seen`."""

    def answer(view: View) -> Iterable[Command]:
        if seen is not None:
            seen.append(view)
        return script.get(view.time, ())

    return Scripted(answer, plan)


@pytest.mark.parametrize(
    "script",
    [
        {0.0: (Go(0),)},
        {0.0: (Go(0),), 10.0: (Advise(0, 6.0),), 20.0: (Advise(0, math.inf),)},
        {0.0: (Go(0),), 10.0: (Advise(0, 0.0),), 30.0: (Advise(0, 9.0),)},
        {0.0: (Go(0),), 34.0: (Hold(0),), 60.0: (Open(0),)},
        {50.0: (Open(0),)},
        {0.0: (Go(0),), 20.0: (Brake(0, 6.0),), 30.0: (Brake(0, 0.0),)},
        {0.0: (Go(0),), 35.0: (Brake(0, 20.0),), 40.0: (Brake(0, 0.0),)},
        {
            0.0: (Go(0), Accelerate(0, 0.5)), 12.0: (Accelerate(0, -1.0),),
            16.0: (Accelerate(0, 9.0), Advise(0, 12.0)), 34.0: (Accelerate(0, -2.0),),
            36.0: (Accelerate(0, math.inf), Advise(0, math.inf)),
        },
        {10.0: (Accelerate(0, 1.0),), 60.0: (Go(0),)},
    ],
    ids=[
        "go", "advise", "stand", "revoke, hard braking", "open", "brake", "brake in the junction",
        "accelerate", "accelerate, held",
    ],
)  # fmt: skip
def test_commands_do_the_same(script: dict[float, tuple[Command, ...]]) -> None:
    ours, theirs = both(single(), timed(script), record="all")
    position, _ = furthest_apart(ours, theirs)
    assert position < 0.1
    assert theirs.columns.travel_time == pytest.approx(ours.columns.travel_time, abs=0.2)


#: Four vehicles in one lane are told to brake hard, to creep, to catch up, and to drive by the law.
PLATOON: dict[float, tuple[Command, ...]] = {
    0.0: (Open(0),),
    12.0: (Accelerate(0, -3.0), Accelerate(2, 9.0)),
    15.0: (Accelerate(0, 0.0), Accelerate(1, 0.5)),
    20.0: (Accelerate(0, 2.0), Accelerate(3, -1.0)),
    25.0: (Accelerate(0, math.inf), Accelerate(1, -9.0)),
    28.0: (Accelerate(1, 9.0), Accelerate(3, 9.0)),
    36.0: (Accelerate(2, -2.0),),
    40.0: tuple(Accelerate(vehicle, math.inf) for vehicle in (1, 2, 3)),
}


#: One crawls through the junction and on its exit; one behind is told to accelerate at any rate.
CRAWL: dict[float, tuple[Command, ...]] = {
    0.0: (Open(0), Accelerate(1, 9.0)), 25.0: (Advise(0, 2.0),),
}  # fmt: skip


@pytest.mark.parametrize("model", ["idm", "krauss"])
def test_one_that_is_told_keeps_behind_one_that_has_left(model: str) -> None:
    profile = replace(FAIR, vehicle=VehicleType(model=model))
    scenario = replayed(four_way(100, profile=profile), (0.0, 0, 2), (4.0, 0, 2), horizon=140.0)
    ours, theirs = both(scenario, timed(CRAWL), record="all")
    assert max(furthest_apart(ours, theirs, k)[0] for k in range(2)) < 0.3
    assert hardest_braking(theirs) < 6.0


@pytest.mark.parametrize(("model", "tolerance"), [("idm", 0.02), ("krauss", 0.5)])
def test_a_platoon_obeys_alike(model: str, tolerance: float) -> None:
    """To 2 cm, or half a metre where SUMO's own Krauss follows one that brakes hard."""
    profile = replace(FAIR, vehicle=VehicleType(model=model))
    trips = (0.0, 0, 2), (3.0, 0, 2), (6.0, 0, 1), (9.0, 0, 2)
    scenario = replayed(four_way(100, profile=profile), *trips, horizon=120.0)
    ours, theirs = both(scenario, timed(PLATOON), record="all")
    assert max(furthest_apart(ours, theirs, k)[0] for k in range(4)) < tolerance
    assert theirs.columns.travel_time == pytest.approx(ours.columns.travel_time, abs=0.1)
    assert hardest_braking(theirs) == pytest.approx(profile.vehicle.max_deceleration)


def brake(vehicle: int, acceleration: float) -> Brake:
    return Brake(vehicle, max(-acceleration, 0.0))


@pytest.mark.parametrize("press", [Accelerate, brake])
@pytest.mark.parametrize("model", ["IDM", "Krauss"])
def test_no_sequence_of_commands_is_beyond_a_vehicle_or_makes_two_touch(
    model: str, press: Callable[[int, float], Command]
) -> None:
    """Vehicles brake three times as hard as Krauss expects of those ahead of them."""
    vehicle = VehicleType(acceleration=4.0, deceleration=3.0, headway=0.5, min_gap=1.0)
    scenario = small_scenario(
        4, density=1200.0, demand_time=30.0, drain=40.0, dt=0.5, vehicle=vehicle
    )
    run = simulate(scenario, Pedals(Dim(), 1, 0.3, press), 1, model=model, record="all")
    assert hardest_braking(run) <= vehicle.max_deceleration + 1e-6
    assert run.trace["a"].max() <= vehicle.acceleration + 1e-6


@pytest.mark.parametrize(
    ("controller", "model"),
    [(Unregulated(), "IDM"), (Unregulated(), "Krauss"), (Reservation(), "IDM")],
)
def test_no_vehicle_brakes_beyond_its_brakes(controller: Controller, model: str) -> None:
    """SUMO's safe gap made vehicles brake at 72 m/s² for one that leaves by the same exit."""
    merging = [(0.0, 2, 3), (0.0, 0, 1)]  # alone, and then among others
    busy = small_scenario(4, density=500.0, demand_time=20.0, drain=40.0)
    for scenario in (replayed(FAIR_FOUR, *merging, horizon=100.0), busy):
        run = simulate(scenario, controller, 1, model=model, record="all", on_collision="record")
        assert hardest_braking(run) <= run.site.vehicle.max_deceleration + 1e-6


@pytest.mark.parametrize("rests", [False, True])
def test_sessions_see_the_same(rests: bool) -> None:
    """Marks, clearing, order, ids and numbers of the views; SUMO rounds nothing."""
    plan = Plan(
        marks=(100.0, 30.0, 0.0), wake_on_clear=True, wake_when_empty=rests, sight=120,
        lanes_open=True, period=7.3,
    )  # fmt: skip
    scenario = replayed(
        FAIR_FOUR, (0.0, 0, 2), (2.0, 1, 2), (4.0, 2, 2), (6.0, 3, 2), (18.0, 3, 1), horizon=120.0
    )
    views = []
    for run in (minisim.simulate, simulate):
        seen: list[View] = []
        run(scenario, timed(plan=plan, seen=seen))
        views.append(seen)
    ours, theirs = views
    assert [view.time for view in theirs] == [view.time for view in ours]
    assert any(len(view.vehicles) > 2 for view in ours)
    for mine, its in zip(ours, theirs, strict=True):
        assert [v[:3] for v in its.vehicles] == [v[:3] for v in mine.vehicles]
        for a, b in zip(mine.vehicles, its.vehicles, strict=True):
            assert b.distance == pytest.approx(a.distance, abs=0.01)
            assert b.speed == pytest.approx(a.speed, abs=0.01)


def test_what_a_session_counts_is_in_the_summary() -> None:
    """The same misread vehicles in both hosts: readings belong to vehicles, not to calls."""
    scenario = small_scenario(4, density=350.0, demand_time=150.0)
    dim = Dim(perception=NoisyPerception(0.5, "symmetric"))
    ours, theirs = both(scenario, dim, seed=1, on_collision="record")
    assert theirs.counts == {key: theirs.summary()[key] for key in ours.counts}
    assert theirs.counts["crossings"] == pytest.approx(ours.counts["crossings"], abs=2)
    assert theirs.counts["false_grants"] > 0


def test_wake_rings_once() -> None:
    seen: list[View] = []
    simulate(single(horizon=20.0), timed({0.0: (Wake(3.14),)}, Plan(lanes_open=True), seen))
    assert [view.time for view in seen] == [0.0, 3.2]


def test_vehicles_do_not_disturb_a_session_before_it_wants() -> None:
    """From the very step on that it names, they do."""
    scenario = replayed(FAIR_FOUR, (0.0, 0, 2), (0.0, 1, 1), (4.0, 2, 2), horizon=100.0)
    plan = Plan(marks=(100.0, 30.0, 0.0), wake_on_clear=True, lanes_open=True)
    for run in (minisim.simulate, simulate):
        every: list[View] = []
        run(scenario, timed({0.0: (Wake(90.0),)}, plan, every), on_collision="record")
        times = [view.time for view in every]
        assert len(times) > 8
        for until in (times[4], times[4] + 0.05):
            seen: list[View] = []
            script = {0.0: (Wake(90.0, undisturbed=until),)}
            run(scenario, timed(script, plan, seen), on_collision="record")
            assert [view.time for view in seen] == [0.0, *(t for t in times if t >= until)]


@pytest.fixture(scope="module")
def busy(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Run, Path]:
    """A queue that reaches back to the road entries, with unfinished and undeparted vehicles."""
    folder = tmp_path_factory.mktemp("kept")
    scenario = small_scenario(
        4, density=900.0, demand_time=240.0, arm_length=150.0,
        vehicle=VehicleType(speed_deviation=0.1),
    )  # fmt: skip
    ours = minisim.simulate(scenario, Dim(), seed=2, record="all")
    theirs = simulate(scenario, Dim(), seed=2, record="all", keep_files=folder)
    return ours, theirs, folder


def test_trips_are_sumos(busy: tuple[Run, Run, Path]) -> None:
    _, run, folder = busy
    trips = run.trips
    written = list(ET.parse(folder / "tripinfo.xml").getroot().iter("tripinfo"))
    assert len(written) == len(trips)
    undeparted = 0
    for trip in written:
        row = trips.loc[int(trip.attrib["id"])]
        if float(trip.attrib["depart"]) < 0.0:
            undeparted += 1
            assert math.isnan(row["depart_s"])
            continue
        assert row["depart_s"] == pytest.approx(float(trip.attrib["depart"]))
        assert row["depart_delay_s"] == pytest.approx(row["depart_s"] - row["demand_time_s"])
        measured = row[["arrival_s", "travel_time_s", "waiting_time_s"]].astype(float)
        if float(trip.attrib["arrival"]) < 0.0:
            assert measured.isna().all()
        else:
            said = [float(trip.attrib[key]) for key in ("arrival", "duration", "waitingTime")]
            assert measured.tolist() == pytest.approx(said)
    assert undeparted > 0
    assert run.summary()["unfinished"] > undeparted


def test_stops_are_sumos(busy: tuple[Run, Run, Path]) -> None:
    _, run, folder = busy
    written = ET.parse(folder / "tripinfo.xml").getroot().iter("tripinfo")
    counts = {int(trip.attrib["id"]): int(trip.attrib["waitingCount"]) for trip in written}
    assert stops(run).tolist() == [counts[vehicle] for vehicle in run.columns.vehicle.tolist()]
    assert max(counts.values()) > 2


def test_waiting_is_time_at_a_tenth_of_a_metre_a_second_or_less() -> None:
    run = simulate(small_scenario(4, demand_time=90.0, drain=300.0), Dim(), record="all")
    assert run.columns.waiting_time.max() > 5.0
    for vehicle, waited in enumerate(run.columns.waiting_time):
        after_insertion = sorted(states(run, vehicle).items())[1:]
        slow = sum(v <= 0.1 for _, (_, v) in after_insertion)
        assert waited == pytest.approx(0.1 * slow, abs=1e-6)


def test_tables_and_complete_means_are_as_minisims(busy: tuple[Run, Run, Path]) -> None:
    ours, theirs, _ = busy
    columns = ["demand_time_s", "lane", "manoeuvre", "exit_lane"]
    assert theirs.trips[columns].equals(ours.trips[columns])
    assert theirs.trips.dtypes.equals(ours.trips.dtypes)
    for name in ("waiting_time_s", "travel_time_s", "depart_delay_s"):
        mine, its = (run.summary()["complete"][name] for run in (ours, theirs))
        assert its == pytest.approx(mine, rel=0.15)
    assert list(theirs.trajectories) == list(ours.trajectories)
    mine, its = (run.trajectories[["s_m", "x_m", "y_m"]] for run in (ours, theirs))
    for end in ("min", "max"):
        assert its.agg(end).tolist() == pytest.approx(mine.agg(end).tolist(), abs=1.5)
    assert 0.0 < theirs.trajectories["right_of_way"].mean() < 1.0


def test_krauss_brakes_and_waits_too() -> None:
    ours, theirs = both(small_scenario(4, demand_time=90.0, drain=300.0), FixedTime())
    krauss = simulate(ours.scenario, FixedTime(), model="Krauss")
    assert krauss.provenance["host"] == krauss.summary()["host"] == "sumo"
    assert krauss.provenance["sumo"].startswith("SUMO 1.")
    assert krauss.provenance["sumo_model"] == "Krauss"
    assert not krauss.collisions
    assert krauss.columns.arrived.all()
    mine, *others = (run.summary()["waiting_time_s"] for run in (ours, theirs, krauss))
    assert others == pytest.approx([mine] * 2, rel=0.15)


#: Straight on from a and b at the same time: they meet in the middle.
CROSSING = replayed(FAIR_FOUR, (0.0, 0, 2), (0.0, 1, 2), horizon=120.0)


def test_sumo_obeys_a_controller_that_lets_collide() -> None:
    ours, theirs = both(CROSSING, Unregulated(), on_collision="record")
    (mine,), (its,) = ours.collisions, theirs.collisions
    assert (its.vehicles, its.movements) == (mine.vehicles, mine.movements)
    assert its.time == pytest.approx(mine.time, abs=0.31)
    assert its.positions == pytest.approx(mine.positions, abs=4.5)
    assert its.speeds == pytest.approx((14.0, 14.0))
    assert theirs.columns.travel_time == pytest.approx([71.1, 71.1])


def test_a_collision_stops_the_run_with_a_replay() -> None:
    with pytest.raises(CollisionError, match=r"vehicle 0 .a2.* and vehicle 1 .b2.*touched") as info:
        simulate(CROSSING, Unregulated())
    run = info.value.replay(3.0)
    assert run.collisions == info.value.collisions
    times = run.trajectories["time_s"]
    (collision,) = run.collisions
    assert times.min() == pytest.approx(collision.time - 3.0, abs=0.11)
    assert times.max() == pytest.approx(collision.time + 2.0, abs=0.11)


@share(1 / 6)
@given(intersections())
def test_any_geometry_becomes_the_same_network(intersection: Intersection) -> None:
    with tempfile.TemporaryDirectory() as folder:
        made = network.build_network(
            Site(intersection, VehicleType(), 14.0, (0.0,) * intersection.n),
            Path(folder),
            network.sumo_home(),
        )
        root = ET.parse(Path(folder) / network.NETWORK).getroot()
    arcs = [path.crossing for path in intersection.paths]
    assert made.approach == pytest.approx([intersection.approach_length] * len(arcs), abs=1e-4)
    # An inscribed polyline of 32 chords is shorter by (θ/32)²/24, at most 0.04 % (θ = π).
    assert made.inside == pytest.approx(arcs, rel=1e-3, abs=1e-3)
    requests = list(root.iter("request"))
    assert len(requests) == len(arcs)
    assert all(set(request.attrib["response"]) == {"0"} for request in requests)


@pytest.mark.parametrize("arms", [3, 5, 6])
@pytest.mark.parametrize("side", ["left", "right"])
def test_other_junctions_run(arms: int, side: str) -> None:
    scenario = small_scenario(arms, demand_time=30.0, drain=300.0, side=side)
    ours, theirs = both(scenario, Dim(gate="harmonious"))
    assert theirs.columns.arrived.all()
    mine, its = (run.summary()["travel_time_s"] for run in (ours, theirs))
    assert its == pytest.approx(mine, rel=0.03)


def test_what_netconvert_says_is_passed_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(network, "_outline", lambda intersection: "here and there")
    with pytest.raises(SumoError, match=r"netconvert failed \(exit code 1\): .*shape.*node 'C'"):
        simulate(single(), Unregulated(), keep_files=tmp_path / "new" / "folder")
    with pytest.raises(SumoError) as caught:
        simulate(single(), Unregulated(), keep_files=tmp_path / "other")
    assert caught.value.__notes__ == [f"SUMO's files up to there are in {tmp_path / 'other'}"]
    kept = {file.name for file in (tmp_path / "new" / "folder").iterdir()}
    assert kept == {f"minisim.{what}.xml" for what in ("rou", "nod", "edg", "con")}


def test_a_missing_program_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(simulation, "sumo_home", lambda: tmp_path)
    with pytest.raises(SumoError, match="cannot start netconvert: No such file"):
        simulate(single(), Unregulated())


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch, started: None) -> list[subprocess.Popen[bytes]]:
    """The worker processes that a test starts."""
    started: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen

    def starting(*arguments: Any, **options: Any) -> subprocess.Popen[bytes]:
        child = popen(*arguments, **options)
        started.append(child)
        return child

    monkeypatch.setattr(process.subprocess, "Popen", starting)
    return started


def saboteur(act: Callable[[], Any]) -> Scripted:
    """A controller that calls something at 10 s."""
    return Scripted(
        lambda view: (act() or ()) if view.time >= 10.0 else (),
        Plan(period=1.0, lanes_open=True), name="saboteur",
    )  # fmt: skip


@pytest.mark.parametrize("death", [signal.SIGKILL, signal.SIGSEGV])
def test_when_sumo_dies_the_caller_lives(
    children: list[subprocess.Popen[bytes]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    death: signal.Signals,
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    killer = saboteur(lambda: os.kill(children[-1].pid, death))
    with pytest.raises(
        SumoError, match=rf"SUMO's process died after 10.0 s of simulated time \({death.name}\)"
    ):
        simulate(single(), killer)
    assert children[-1].poll() == -death
    assert not list(tmp_path.iterdir()), "nothing is left behind"
    assert simulate(single(), Unregulated()).columns.arrived.all()


@pytest.mark.parametrize(
    ("act", "message"),
    [
        (lambda: 1 / 0, "'saboteur' at 10.0 s: .*ZeroDivisionError: division by zero"),
        (lambda: (Go(7),), r"'saboteur' at 10.0 s: vehicle must be .* 0 … 0"),
        (lambda: (Wake(10.0),), "wake-up time 10 s is not after 10 s"),
    ],
    ids=["exception", "vehicle", "wake"],
)
def test_a_broken_controller_is_told_as_in_minisim(
    children: list[subprocess.Popen[bytes]], act: Any, message: str
) -> None:
    for run in (minisim.simulate, simulate):
        with pytest.raises(ControllerError, match=message):
            run(single(), saboteur(act))
    assert children[-1].poll() is not None, "no process is left behind"


def test_what_sumo_refuses_is_passed_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "_command", lambda gui: ("sumo", "--no-such-option"))
    with pytest.raises(SumoError, match=r"before the first step: .*no-such-option"):
        simulate(single(), Unregulated())


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="how Linux finds displays")
def test_the_gui_needs_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(SumoError, match="sumo-gui needs a display, and there is none"):
        simulate(single(), Unregulated(), gui=True)
    monkeypatch.setenv("DISPLAY", ":4711")
    with pytest.raises(SumoError, match="unable to open display :4711"):
        simulate(single(), Unregulated(), gui=True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model": "idm"}, "unknown SUMO model 'idm'; allowed: IDM, Krauss, CC"),
        ({"on_collision": "explode"}, "unknown on_collision"),
        ({"keep_files": 3}, "keep_files must be a text or a PathLike"),
    ],
)
def test_wrong_arguments_are_told(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(single(), Unregulated(), **options)


def test_sumo_has_no_improved_idm() -> None:
    profile = replace(FAIR, vehicle=VehicleType(model="iidm"))
    scenario = single(scenario=replace(FAIR_FOUR, profile=profile), horizon=90.0)
    with pytest.raises(InputError, match=r"SUMO has no model of the law 'iidm'; choose Krauss"):
        simulate(scenario, Unregulated())
    assert simulate(scenario, Unregulated(), model="Krauss").columns.arrived.all()


def test_sumos_bodies_drag_no_rear_axle() -> None:
    profile = replace(FAIR, vehicle=VehicleType(rear_axle=3.7))
    scenario = single(scenario=replace(FAIR_FOUR, profile=profile), horizon=90.0)
    with pytest.raises(InputError, match=r"but car has one at 3\.7 m: leave out rear_axle"):
        simulate(scenario, Unregulated())


def test_sumo_steps_in_whole_milliseconds() -> None:
    with pytest.raises(InputError, match=r"SUMO counts in milliseconds; it cannot step 0\.0333"):
        simulate(small_scenario(dt=0.0333), Unregulated())


@pytest.mark.parametrize("dt", [0.05, 0.25])
def test_other_steps_drive_alike(dt: float) -> None:
    """Above 0.37 s SUMO's IDM cuts a step into several."""
    scenario = single(scenario=replace(FAIR_FOUR, profile=replace(FAIR, dt=dt)))
    assert max(furthest_apart(*both(scenario, Dim(), record="all"))) < 0.01


def test_a_folder_that_cannot_be_made_or_is_in_use_is_told(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    for folder, message in (
        (file / "folder", "cannot write to folder"),
        (tmp_path, "is not empty: give SUMO's files a new or an empty one"),
    ):
        with pytest.raises(FileError, match=message):
            simulate(single(), Unregulated(), keep_files=folder)
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.skipif(sys.platform == "win32", reason="SIGTERM is POSIX's")
@pytest.mark.parametrize(
    ("command", "death"),
    [
        (("run", "four-way"), signal.SIGTERM),
        (("run", "four-way"), signal.SIGKILL),
        (("crossval", "four-way", "-c", "fixed-time", "-d", "900", "--seeds", "3", "--jobs", "1"),
         signal.SIGTERM),
    ],
    ids=["run, terminated", "run, killed", "crossval, terminated"],
)  # fmt: skip
def test_an_ended_command_leaves_nothing_behind(
    tmp_path: Path, command: tuple[str, ...], death: signal.Signals
) -> None:
    """SUMO's process removes the files of a caller that was killed."""
    files = tmp_path / "files"
    files.mkdir()
    options = ("--out", str(tmp_path / "out"))
    if command[0] == "run":
        options = ("--host", "sumo", "-c", "all-way-stop", "-d", "900")
    process = subprocess.Popen(
        [sys.executable, "-c", "import sys; from scenarios.cli import main; sys.exit(main())",
         *command, "-p", "fair", *options],
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(files)},
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while not list(files.glob("minisim-sumo-*/sumo.log")):  # SUMO has started
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(death)
    _, said = process.communicate(timeout=30)
    if death == signal.SIGTERM:
        assert process.returncode == 143
        assert said == "minisim: terminated\n"
    while list(files.glob("minisim-sumo-*")):
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.usefixtures("started")
def test_no_environment_variable_is_needed_or_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SUMO_HOME", raising=False)
    before = dict(os.environ)
    assert simulate(single(), Unregulated()).columns.arrived.all()
    assert dict(os.environ) == before
    assert "libsumo" not in sys.modules


RUN = ("run", "four-way", "-p", "fair", "-d", "300", "--horizon", "120")


@pytest.mark.usefixtures("started")
def test_the_command_line_hosts_in_sumo(capsys: Captured, tmp_path: Path) -> None:
    printed = answer(capsys, *RUN, "--host", "sumo", "--keep-files", str(tmp_path / "kept"))
    assert (tmp_path / "kept" / "minisim.net.xml").is_file()
    ours = answer(capsys, *RUN)
    assert (ours["host"], printed["host"]) == ("minisim", "sumo")
    assert printed.keys() == ours.keys()
    assert printed["trips"] == ours["trips"]
    assert printed["travel_time_s"] == pytest.approx(ours["travel_time_s"], rel=0.03)


def test_the_command_line_prints_a_table_of_sumos_run(capsys: Captured, tmp_path: Path) -> None:
    kept = str(tmp_path / "kept")
    fcd = tmp_path / "sumo.xml"
    options = ("-c", "fixed-time", "--host", "sumo", "--sumo-model", "Krauss", "--keep-files", kept)
    said = ok(capsys, *RUN, *options, "--sumo-fcd", str(fcd))
    assert f"wrote {fcd}" in said.replace("\n", "")
    assert fcd.read_text().count("<timestep") == 1201  # 0 … 120 s
    assert "host sumo" in said
    assert f"  SUMO's files are in {kept}\n" in said


def test_a_collision_names_what_is_there_and_what_is_not(capsys: Captured, tmp_path: Path) -> None:
    fcd, kept = tmp_path / "fcd.xml", tmp_path / "kept"
    options = ("-c", "unregulated", "--host", "sumo", "--sumo-fcd", str(fcd))
    said = fails(capsys, *RUN, *options, "--keep-files", str(kept), code=1)
    assert f"SUMO's files up to there are in {kept}; {fcd} not written; --on-collision" in said
    assert not fcd.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--host", "vissim"), "unknown host 'vissim'; allowed: minisim, sumo"),
        (("--gui",), "minisim: --gui needs --host sumo"),
        (("--on-collision", "teleport"), "minisim: --on-collision teleport needs --host sumo"),
        (("--sumo-model", "IDM", "--gui"), "minisim: --sumo-model and --gui need --host sumo"),
        (("--host", "sumo", "--sumo-model", "CACC"), "unknown SUMO model 'CACC'"),
    ],
)
def test_wrong_options_are_told(capsys: Captured, options: tuple[str, ...], message: str) -> None:
    assert message in fails(capsys, *RUN, *options)


def test_a_crossed_vehicle_still_follows_into_its_exit() -> None:
    """While one vehicle crosses, SUMO ignores all in the junction, even the one to merge behind.

    Vehicle 24 holds a reservation right behind another into the same exit, while a third drives
    across. It did not see the other in time and ran into it.
    """
    scene = (  # second, lane and manoeuvre of each vehicle
        "4a2 8d1 18a3 30d3 33b2 39b2 67a3 74a1 75c2 77a3 84d1 85c3 87d2 88b1 92d1 102a1 103d3 "
        "108c3 114c2 121b2 125c1 143a3 154b2 162a3 162a2 164d3 165b3 167c1 169b2 174c1 186d2 203d1"
    )
    trips = [(float(it[:-2]), "abcd".index(it[-2]), int(it[-1])) for it in scene.split()]
    scenario = replayed(FAIR_FOUR, *trips, horizon=205.0)
    ours, theirs = both(scenario, Reservation(), record="all", record_window=(175.0, 205.0))
    assert theirs.collisions == ()
    for run in (ours, theirs):
        assert run.trajectories.set_index("vehicle").loc[24, "speed_mps"].min() < 1.0


@pytest.mark.parametrize("signal", [Actuated(), Adaptive()])
def test_no_green_ends_in_sumo_while_its_queue_stands(signal: Controller) -> None:
    watched = Greens(signal)
    simulate(queues(VehicleType(length=6.0)), watched)
    assert watched.left
    assert not any(watched.left)


def test_a_departure_speed_that_a_driver_cannot_have_is_capped() -> None:
    """SUMO raises at a speed above the driver's own, and inserts no vehicle where it is unsafe."""
    slow = VehicleType(speed_deviation=0.3)
    what = small_scenario(4, demand_time=60.0, depart_speed=10.0, vehicle=slow)
    run = simulate(what, FixedTime(), seed=1, record="all")
    assert run.columns.departed.all()
    first = run.trajectories.groupby("vehicle")["speed_mps"].first()
    assert first.max() == pytest.approx(10.0)
    assert first.min() < 9.0
