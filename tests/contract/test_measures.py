"""Every measure under every controller: each can be taken, and they agree with each other."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import minisim
from minisim.channel import Channel
from minisim.control import HALTING
from minisim.link import Linked
from minisim.results.driving import co2, fuel, stops
from minisim.results.fairness import order_reversals
from minisim.results.metrics import METRICS
from minisim.results.queues import queue_table
from minisim.results.run import Run
from scenarios import four_way
from scenarios.cli import main
from scenarios.controllers import controller_named, safe

#: Vehicles that send each other nothing, or whose controllers only show lights.
SILENT = ("dim", "fixed-time", "adaptive", "actuated", "max-pressure", "all-way-stop")


@pytest.fixture(scope="module", params=safe())
def run(request: pytest.FixtureRequest) -> Run:
    scenario = four_way(400, profile="fair", arm_length=150.0, horizon=100.0)
    return minisim.simulate(scenario, controller_named(request.param), 1, record="all", timed=True)


def test_all_metrics_can_be_taken(run: Run) -> None:
    summary = run.summary(list(METRICS), by=["movement"])
    numbers = {name: summary[name] for name in METRICS}
    assert {name for name, value in numbers.items() if value is None} <= {
        "saturation_headway_s", "crossings", "false_grants", "disagreement_s", "deadlock_s",
        "min_ttc_s", "min_pet_s", "max_drac_mps2",
    }  # fmt: skip
    assert all(value is None or np.isfinite(value) for value in numbers.values())
    talks = not summary["controller"].startswith(SILENT)
    assert (numbers["messages"] > 0) is (numbers["message_bytes"] > 0) is talks


def test_they_agree_with_each_other(run: Run) -> None:
    trips, tracks = run.columns, run.tracks
    waited = np.bincount(tracks.trip, tracks.v <= HALTING, len(trips.lane)) * run.site.dt
    np.testing.assert_allclose(waited, trips.waiting_time, atol=1e-9)
    np.testing.assert_array_equal(stops(run) > 0, trips.waiting_time > 0.0)
    assert (fuel(run)[trips.arrived] > 0.0).all()
    ratio = co2(run)[trips.arrived] / fuel(run)[trips.arrived]
    assert ((ratio > 3.0) & (ratio < 3.3)).all(), "3.1 kg of CO₂ per kg of petrol"
    table = queue_table(run)
    outside = table["before_road"].sum() * run.site.dt
    assert outside == pytest.approx(trips.depart_delay.sum(), abs=len(trips.lane) * run.site.dt)
    assert (table["on_road"].sum() > 0) or trips.waiting_time.max() < 1.0
    assert order_reversals(run).sum() <= len(trips.lane) ** 2 / 2


def flat(summary: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """The numbers of a summary, named as the columns of a sweep; NaN for none."""
    for key, value in summary.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}_")
        elif value is None or isinstance(value, int | float):
            yield f"{prefix}{key}", math.nan if value is None else float(value)


@pytest.mark.parametrize(
    ("spec", "loss"),
    [("dim:perception=noisy(intent_error=0.15)", 0.0), ("reservation", 0.2)],
    ids=["misread", "messages lost"],
)
def test_command_line_file_and_python_give_the_same_numbers(
    spec: str, loss: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every measure, by lane too, to the last digit; processor times are only there in each."""
    scenario = four_way(300, profile="fair", horizon=200.0, warmup=20.0)
    controller = controller_named(spec)
    if loss:
        controller = Linked(controller, Channel(loss=loss))
    run = minisim.simulate(scenario, controller, 3, record="all", timed=True, on_collision="record")
    python = dict(flat(run.summary(list(METRICS))))

    arguments = ["-c", spec, "-d", "300", "-p", "fair", "-s", "3", "--loss", str(loss)]
    arguments += ["--horizon", "200", "--warmup", "20", "--on-collision", "record"]
    arguments += ["--metrics", ",".join(METRICS), "--json"]
    assert main(["run", "four-way", *arguments]) == 0
    said = dict(flat(json.loads(capsys.readouterr().out)))

    file, table = tmp_path / "one.toml", tmp_path / "rows.parquet"
    file.write_text(
        f'controller = "{spec}"\nloss = {loss}\ndensity = 300\nprofile = "fair"\nseeds = [3]\n'
        f'horizon = 200\nwarmup = 20\non_collision = "record"\nmetrics = {[*METRICS]}\n'
    )
    out = ["--out", str(tmp_path / "s.db"), "--export", str(table), "--jobs", "1"]
    assert main(["sweep", str(file), *out]) == 0
    (kept,) = pd.read_parquet(table).to_dict("records")
    row = dict(flat(kept))

    assert {*METRICS} <= python.keys()
    timed = {"median_decision_us", "p99_decision_us"}
    for name, value in python.items():
        for other in (said[name], row[name]):
            equal = other > 0.0 if name in timed else np.array_equal(other, value, equal_nan=True)
            assert equal, (name, value, other)
