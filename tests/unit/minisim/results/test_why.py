"""`Run.why`: what was written down, what the place in the lane tells, and clear errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from baselines import FixedTime
from dim import Dim
from minisim import Run, Simulation, simulate
from minisim.control import Hold
from minisim.errors import InputError
from scenarios import four_way
from scenarios.cli import main

SCENARIO = four_way(350, horizon=200.0)


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(SCENARIO, Dim(), 1)


def test_before_and_after_its_trip_a_vehicle_is_not_there(run: Run) -> None:
    comes = float(run.columns.demand_time[40])
    assert run.why(40, comes - 0.5).kind == "not there"
    assert f"it comes at {comes:.1f} s" in run.why(40, comes - 0.5).sentence
    left = float(run.columns.arrival[5])
    assert f"it left the road at {left:.1f} s" in run.why(5, left + 1.0).sentence


def test_a_vehicle_without_room_on_the_road_says_so() -> None:
    run = simulate(four_way(1500, horizon=300.0), FixedTime(), 1)
    late = int(run.columns.depart_delay.argmax())
    reason = run.why(late, float(run.columns.demand_time[late]) + 0.2)
    assert reason.kind == "no room"


def test_a_chain_leads_to_the_front_of_the_lane(run: Run) -> None:
    seen = 0
    for told in run.explained.run.reasons or ():
        chain = run.explained.chain(told.reason.vehicle, told.time)
        assert all(reason.kind == "behind" for reason in chain[:-1])
        assert chain[-1].kind != "behind"
        seen += len(chain) > 1
    assert seen


def test_a_run_that_recorded_all_is_not_run_again(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = simulate(SCENARIO, Dim(), 1, record="all", explain=True)
    monkeypatch.setattr("minisim.simulation.Simulation.__init__", lambda *_, **__: 1 / 0)
    assert whole.why(5, 150.0)
    with pytest.raises(ZeroDivisionError):
        simulate(SCENARIO, Dim(), 1).why(5, 150.0)


def test_a_run_again_gives_the_same_reasons(run: Run) -> None:
    whole = simulate(SCENARIO, Dim(), 1, record="all", explain=True)
    assert whole.reasons == run.explained.run.reasons


@pytest.mark.parametrize(
    ("vehicle", "time", "message"),
    [
        (-1, 1.0, "vehicle must be"),
        (10_000, 1.0, "vehicle must be an integer 0 …"),
        (2.5, 1.0, "vehicle must be"),
        (1, 200.5, "time .s. must be at least 0 and at most 200, got 200.5"),
        (1, float("nan"), "time .s. must be"),
    ],
)
def test_what_is_not_in_the_run_is_refused(
    run: Run, vehicle: Any, time: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        run.why(vehicle, time)


def test_saved_reasons_come_back(tmp_path: Path) -> None:
    whole = simulate(SCENARIO, FixedTime(), 1, record="all", explain=True)
    whole.save(tmp_path / "run.zip")
    back = Run.load(tmp_path / "run.zip")
    assert back.reasons == whole.reasons
    assert back.heads == whole.heads
    assert back.why(5, 150.0) == whole.why(5, 150.0)


def test_the_command_answers_for_the_run_that_run_makes(capsys: pytest.CaptureFixture[str]) -> None:
    given = ["four-way", "-c", "dim", "-d", "350", "--seed", "1", "--horizon", "200"]
    where = ["--vehicle", "26", "--at", "150"]
    assert main(["why", *given, *where]) == 0
    said = capsys.readouterr().out.splitlines()
    run = simulate(four_way(350, horizon=200.0), Dim(), 1)
    assert said == [reason.sentence for reason in run.explained.chain(26, 150.0)]
    assert main(["why", *given, *where, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["reasons"][0]["sentence"] == said[0]
    assert main(["why", *given, "--vehicle", "9999", "--at", "150"]) == 2
    assert "vehicle must be an integer 0 …" in capsys.readouterr().err
    for at in ("-1", "201"):
        assert main(["why", *given, "--vehicle", "26", f"--at={at}"]) == 2
        assert "--at [s] must be at least 0 and at most 200" in capsys.readouterr().err


def test_commands_from_outside_are_given_again() -> None:
    simulation = Simulation(SCENARIO, Dim(), seed=1)
    simulation.advance(100.0)
    inside = {vehicle.id for vehicle in simulation.view().vehicles}
    simulation.command(*map(Hold, inside))
    run = simulation.run()
    assert run.given
    again = run.explained.run
    assert again.columns.arrival.tobytes() == run.columns.arrival.tobytes()


def test_a_run_without_vehicles_says_so() -> None:
    run = simulate(four_way(density=0, horizon=10.0, warmup=0.0), Dim())
    with pytest.raises(InputError, match="the run has no vehicles"):
        run.why(0, 1.0)
