"""SUMO's CC model in the host: the vehicle and the junctions of the published runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import minisim
from baselines import FixedTime
from dim import AsRunDim
from minisim.control import Accelerate, Advise, Brake, Command, Controller, Plan, Unregulated
from minisim.errors import InputError, SumoError
from minisim.simulation import Run
from minisim.sumo import simulate
from minisim.testing import check_controller
from minisim.vehicle import VehicleType
from scenarios import five_way, four_way
from scenarios.paper import Cell, controller_of, replay
from scenarios.profiles import AS_RUN, FAIR
from scenarios.scenario import Scenario
from tests.builders import Fixed, Scripted, as_run, replayed
from tests.sumo.conftest import both
from tests.sumo.test_host import PLATOON, furthest_apart


def hosted(scenario: Scenario) -> Scenario:
    """With the vehicle of the SUMO that is installed, not of the published runs."""
    vehicle = replace(AS_RUN.vehicle, sumo="1.28")
    return replace(scenario, profile=replace(AS_RUN, vehicle=vehicle))


RELEASED = Accelerate(0, np.inf)
AS_RUN_FOUR = hosted(four_way(profile="as_run"))


@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
@pytest.mark.parametrize("controller", [Unregulated(), AsRunDim()], ids=lambda c: c.name)
def test_a_vehicle_alone_drives_alike(controller: Controller, manoeuvre: int) -> None:
    """as_run.md: DIM left, straight and right 63.99, 64.26 and 64.24 s."""
    scenario = replayed(AS_RUN_FOUR, (0.0, 0, manoeuvre), horizon=80.0)
    ours, theirs = both(scenario, controller, record="all", on_collision="record")
    a, b = ours.trace, theirs.trace
    assert len(a) == pytest.approx(len(b), abs=1)  # minisim has no line of the insertion itself
    b = b[b["tick"] > 0][: len(a)]
    for column in ("tick", "s", "v"):
        assert b[column] == pytest.approx(a[column][: len(b)], abs=1e-4)
    for column in ("travel_time_s", "waiting_time_s"):
        assert theirs.trips[column].tolist() == pytest.approx(ours.trips[column].tolist())
    assert theirs.columns.time_loss == pytest.approx(ours.columns.time_loss, abs=0.1)
    if isinstance(controller, AsRunDim):
        published = {1: 63.99, 2: 64.26, 3: 64.24}[manoeuvre]
        assert theirs.columns.travel_time == pytest.approx([published], abs=0.011)


def test_ways_that_are_not_netconverts_are_refused() -> None:
    junction = AS_RUN_FOUR.intersection
    assert junction.ways is not None
    longer = (junction.ways[0]._replace(length=9.5), *junction.ways[1:])
    scenario = replace(AS_RUN_FOUR, intersection=replace(junction, ways=longer))
    with pytest.raises(SumoError, match=r"way of a1 9.03 m long, the intersection has 9.50 m"):
        simulate(scenario, Unregulated())


#: Share of the trips whose waiting and travel times are both within 0.1 s in the two hosts, at
#: least. The issue asks for 0.9; five arms part late in the hour (docs/background/fidelity.md).
SHARES = [
    (Cell("balanced", 150, 3), 3600.0, 1.0),
    (Cell("balanced", 350, 3), 3600.0, 0.99),
    *((Cell("balanced", density, 4), 3600.0, 1.0) for density in (150, 200, 250, 300)),
    *((Cell(split, 350, 4), 3600.0, 0.99) for split in ("balanced", "4:3:2:1", "4:1:4:1")),
    (Cell("balanced", 350, 5), 3600.0, 0.95),
]


@pytest.mark.parametrize(
    ("cell", "horizon", "share"),
    [
        (Cell("balanced", 350, 4), 240.0, 1.0),
        (Cell("balanced", 150, 3), 240.0, 1.0),
        *(pytest.param(*it, marks=pytest.mark.slow) for it in SHARES),
    ],
    ids=str,
)
def test_replays_are_minisims_trip_by_trip(cell: Cell, horizon: float, share: float) -> None:
    scenario = replace(replay(*cell, sumo="1.28"), horizon=horizon)
    ours, theirs = both(scenario, controller_of(*cell), on_collision="record")
    a, b = ours.columns, theirs.columns
    ended = a.arrived & b.arrived
    assert ended.sum() > 10
    travel, waiting = a.travel_time - b.travel_time, a.waiting_time - b.waiting_time
    close = np.maximum(np.abs(travel), np.abs(waiting))[ended] <= 0.1 + 1e-9
    assert close.mean() >= share
    assert (a.arrived == b.arrived).mean() >= 0.99


@pytest.mark.parametrize("controller", [FixedTime(), AsRunDim()], ids=lambda c: c.name)
def test_the_contract_holds_with_the_vehicle_of_the_published_runs(controller: Controller) -> None:
    """`check_controller` has vehicles of its own; here they are those of the profile."""

    def run(scenario: Any, controller: Controller, seed: int = 0, **options: Any) -> Run:
        return simulate(as_run(scenario), controller, seed, **options)

    check_controller(
        controller, arms=(4,), density=150.0, horizon=20.0, collision_free=False, host=run
    )


def test_the_same_replay_gives_the_same_trips_twice() -> None:
    scenario = replace(replay("balanced", 150, 4, sumo="1.28"), horizon=100.0)
    first, second = (
        simulate(scenario, AsRunDim(), on_collision="record", record=kind)
        for kind in (None, "junction")
    )
    assert first.trips.drop(columns="time_loss_s").equals(second.trips.drop(columns="time_loss_s"))
    # Without a recording, vehicles past the junction are only looked at now and then.
    loss = (first.columns.time_loss - second.columns.time_loss)[first.columns.departed]
    assert np.abs(loss).max() < 0.05


@pytest.mark.parametrize("hold_distance", [0.0, 20.0])
def test_a_held_vehicle_stops_at_its_line(hold_distance: float) -> None:
    scenario = replayed(AS_RUN_FOUR, (0.0, 0, 2), (4.0, 0, 1), horizon=70.0)
    ours, theirs = both(scenario, Fixed(Plan(hold_distance=hold_distance)), record="all")
    line = theirs.site.intersection.approach_length - hold_distance
    for run in (ours, theirs):
        last = run.trace[run.trace["tick"] == 7000]
        front, behind = last["s"].max(), last["s"].min()
        assert 0.0 <= line - front <= 0.3
        assert front - 4.0 - behind >= 2.0
        assert not run.columns.arrived.any()
    assert theirs.columns.waiting_time[0] == pytest.approx(ours.columns.waiting_time[0], abs=0.3)


def test_advice_comes_before_and_after_insertion() -> None:
    scenario = replayed(AS_RUN_FOUR, (2.0, 0, 2), horizon=90.0)
    early = Fixed(Plan(lanes_open=True), (Advise(0, 8.0),))
    ours, theirs = both(scenario, early, on_collision="record")
    assert ours.columns.travel_time[0] > 80.0 or not ours.columns.arrived[0]
    assert theirs.columns.travel_time == pytest.approx(ours.columns.travel_time, abs=0.02)


@pytest.mark.parametrize(
    "script",
    [
        {10.0: (Brake(0, 3.0),), 12.0: (Brake(0, 0.0),)},
        {10.0: (Accelerate(0, -1.0),), 14.0: (Accelerate(0, 1.0),), 16.0: (RELEASED,)},
    ],
    ids=["brake", "accelerate"],
)
def test_commands_do_the_same_out_of_sight(script: dict[float, tuple[Command, ...]]) -> None:
    scenario = replayed(AS_RUN_FOUR, (0.0, 0, 2), horizon=80.0)
    plan = Plan(period=1.0, sight=0.0, lanes_open=True)
    controller = Scripted(lambda view: script.get(view.time, ()), plan)
    ours, theirs = both(scenario, controller, record="junction")
    assert theirs.columns.travel_time == pytest.approx(ours.columns.travel_time, abs=0.02)
    assert ours.columns.travel_time[0] > 74.0, "73.3 without a command"


def test_a_platoon_obeys_alike() -> None:
    """To a millimetre: told to brake hard, to creep and to catch up, as in `test_host.py`."""
    trips = tuple((3.0 * k, 0, 2) for k in range(4))
    scenario = replayed(AS_RUN_FOUR, *trips, horizon=100.0)
    controller = Scripted(lambda view: PLATOON.get(view.time, ()), Plan(period=1.0, sight=400.0))
    ours, theirs = both(scenario, controller, record="all")
    assert max(furthest_apart(ours, theirs, k)[0] for k in range(4)) < 0.001
    assert ours.columns.arrived.all()


def test_teleporting_is_sumos_default(tmp_path: Path) -> None:
    scenario = replayed(AS_RUN_FOUR, (0.0, 0, 2), horizon=2.0)
    for reaction, kept in (("teleport", False), ("record", True)):
        folder = tmp_path / reaction
        simulate(scenario, AsRunDim(), on_collision=reaction, keep_files=folder)
        text = (folder / "minisim.sumocfg").read_text()
        for option in ("time-to-teleport", "collision.action", "collision.check-junctions"):
            assert (option in text) is kept


def test_teleport_takes_a_vehicle_that_runs_into_another_off_the_road() -> None:
    """4:3:2:1 at 350: in SUMO 1.28 b2 of 148 s runs into a3 of 153 s."""
    scenario = replace(replay("4:3:2:1", 350, 4, sumo="1.28"), horizon=200.0)
    run = simulate(scenario, AsRunDim(), on_collision="teleport")
    (collision,) = run.collisions
    assert collision.time == pytest.approx(194.84)
    assert collision.movements in (("a3", "b2"), ("b2", "a3"))
    hit = collision.vehicles[collision.movements.index("b2")]
    assert run.columns.arrival[hit] == pytest.approx(194.84, abs=0.011)
    # In minisim they touch too, and a3 has touched d2 before: SUMO does not look for that.
    ours = minisim.simulate(scenario, AsRunDim(), on_collision="record")
    assert [it.movements for it in ours.collisions] == [("d2", "a3"), ("b2", "a3")]
    assert set(ours.collisions[1].vehicles) == set(collision.vehicles)


@pytest.mark.parametrize(
    ("profile", "model", "message"),
    [
        (FAIR, "CC", "CC does not .* 'idm'; choose IDM or Krauss, .*: use --profile as_run"),
        (AS_RUN, "IDM", "model IDM does not drive vehicles of the model 'cc'; choose CC"),
        (replace(FAIR, vehicle=VehicleType(model="krauss")), "IDM", "'krauss'; choose Krauss, or"),
        (replace(AS_RUN, vehicle=replace(AS_RUN.vehicle, radar=100.0)), None,
         "CC has spacing 2 m and radar 250 m, but the vehicles have 2 m and 100 m"),
    ],
)  # fmt: skip
def test_models_that_do_not_fit_are_told(profile: Any, model: str | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        simulate(replace(AS_RUN_FOUR, profile=profile), Unregulated(), model=model)


@pytest.mark.parametrize(
    ("pair", "controller", "sumo_sees"),
    [
        # Ways that cross, for netconvert foes.
        (((0, 2), (1, 3)), Unregulated(), 1),
        # In harmony by the paper's table, and no foes: they pass 1.48 m apart, a car is 1.8 m wide.
        (((1, 4), (4, 3)), AsRunDim(), 0),
    ],
    ids=["crossing", "passing"],
)
def test_sumo_looks_for_collisions_between_foes_only(
    pair: tuple[tuple[int, int], ...], controller: Controller, sumo_sees: int
) -> None:
    """Why minisim counts more touches in the published run of 5 arms at 350 veh/h."""
    five = hosted(five_way(profile="as_run"))
    scenario = replayed(five, *((0.0, *movement) for movement in pair), horizon=70.0)
    ours, theirs = both(scenario, controller, record="all", on_collision="record")
    assert len(ours.collisions) == 1
    assert len(theirs.collisions) == sumo_sees
    touch = ours.collisions[0]
    there = theirs.trajectories[np.isclose(theirs.trajectories["time_s"], touch.time)]
    assert there["s_m"].tolist() == pytest.approx(list(touch.positions), abs=0.01)
