"""The table of metrics, summaries by group, warm-up, and how a run shows itself."""

from __future__ import annotations

import math
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from baselines import V2IC
from dim import Dim, NoisyPerception
from dim.humans.mixed import Mixed
from minisim.control import Command, Go, Plan, Radio, Unregulated, View
from minisim.errors import InputError
from minisim.laws import RECORD_BEFORE, RECORD_PAST
from minisim.results.metric import Metric
from minisim.results.metrics import MEANS, METRICS, SAFETY, TABLE, heading
from minisim.results.run import Run
from minisim.results.safety import safety_summary
from minisim.results.trajectories import movement_index
from minisim.results.trips import Floats, Trips
from minisim.testing import small_scenario
from scenarios import four_way
from tests.builders import Scripted, replayed


@pytest.fixture(scope="module")
def run() -> Run:
    scenario = four_way(250, profile="fair", horizon=300.0)
    return minisim.simulate(scenario, Mixed(Dim(), 0.4), 3, record="all", timed=True)


def test_every_metric_can_be_asked_for_and_says_what_it_is(run: Run) -> None:
    summary = run.summary(metrics=list(METRICS), by=["lane", "movement", "kind"])
    for metric in TABLE:
        assert metric.meaning
        assert metric.title
        assert metric.name in summary
        assert metric.grouped == (metric.name in summary["lanes"]["a"])
    assert {f"{name}_p95" for name in MEANS} < set(summary["complete"])


def test_percentiles_are_numpys_linear_ones(run: Run) -> None:
    summary = run.summary(["waiting_time_s"])
    trips = run.columns
    for form, chosen in ((summary, trips.arrived), (summary["complete"], trips.departed)):
        values = trips.waiting_time[chosen]
        for name, share in (("p50", 50), ("p95", 95), ("max", 100)):
            assert form[f"waiting_time_s_{name}"] == np.percentile(values, share)
    assert "waiting_time_s_p95" not in run.summary(), "only where it is asked for"


@pytest.mark.parametrize("key", ["lanes", "movements", "kinds"])
def test_groups_make_up_the_whole(run: Run, key: str) -> None:
    summary = run.summary(by=["movement", "kind"])
    groups = summary[key].values()
    for name in ("trips", "unfinished"):
        assert sum(group[name] for group in groups) == summary[name]
    total = math.fsum(
        (group["waiting_time_s"] or 0.0) * (group["trips"] - group["unfinished"])
        for group in groups
    )
    ended = summary["trips"] - summary["unfinished"]
    assert total / ended == pytest.approx(summary["waiting_time_s"])


def test_a_group_is_of_its_trips(run: Run) -> None:
    group = run.summary(by=["movement"])["movements"]["b3"]
    trips = run.trips[(run.trips["lane"] == "b") & (run.trips["manoeuvre"] == 3)]
    assert group["trips"] == len(trips)
    assert group["travel_time_s"] == pytest.approx(trips["travel_time_s"].mean())


def test_own_metrics_get_the_run_or_its_trips(run: Run) -> None:
    late = Metric("late", lambda trips: float((trips.depart_delay > 0.0).sum()), needs="trips")
    speed = Metric("mean_speed", lambda run: float(run.trajectories["speed_mps"].mean()), "m/s")
    odd = Metric("odd", lambda run: np.where(run.columns.lane == 0, np.nan, 1.0), per="trip")
    summary = run.summary([late, speed, odd])
    assert summary["late"] == sum(lane["late"] for lane in summary["lanes"].values())
    assert summary["mean_speed"] == pytest.approx(run.trajectories["speed_mps"].mean())
    assert (summary["lanes"]["a"]["odd"], summary["odd"], summary["odd_max"]) == (None, 1.0, 1.0)
    assert run.summary([Metric("none", lambda run: math.nan)])["none"] is None


@pytest.mark.parametrize(
    ("metric", "message"),
    [
        (Metric("m", lambda run: "5"), "metric 'm' must give one finite number or None, got '5'"),
        (Metric("m", lambda run: math.inf), "metric 'm' must give one finite number"),
        (Metric("m", lambda run: np.zeros(3)), 'got array.*; per="trip" takes an array'),
        (Metric("m", lambda run: 1.0, per="trip"), "must give one finite number per trip, an arr"),
        (Metric("m", lambda run: run.trips, per="trip"), "metric 'm' must give one finite number"),
        (
            Metric("m", lambda run: np.full(len(run.columns.lane), np.inf), per="trip"),
            "metric 'm' must give one finite number per trip",
        ),
    ],
)
def test_what_is_no_metric(run: Run, metric: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        run.summary([metric])


def test_other_wrong_questions(run: Run) -> None:
    with pytest.raises(InputError, match="did you mean 'lane'"):
        run.summary(by=["lanee"])
    for name in ("two words", "", "seed", "recipe", 3):
        with pytest.raises(InputError, match="name of a metric must"):
            Metric(name, len)  # type: ignore[arg-type]
    for name in ("complete_m", "lanes_a_m", "movements_m", "kinds_m", "m_p95", "m_max", "m_ci95"):
        with pytest.raises(InputError, match=f"must not be a column of runs, got '{name}"):
            Metric(name, len)
    with pytest.raises(InputError, match="must be a function"):
        Metric("m", 5)  # type: ignore[arg-type]


def test_an_error_in_a_metric_tells_which_and_where(run: Run) -> None:
    for of, what in (
        (lambda run: 1 / 0, r"ZeroDivisionError: division by zero \(test_metrics.py, line \d+\)"),
        (lambda run: run.trips["dely"], r"KeyError: 'dely' \(test_metrics.py, line \d+\)"),
        (lambda run: sys.exit("enough"), r"SystemExit: enough \(test_metrics.py, line \d+\)"),
        (math.sqrt, "TypeError: must be real number, not Run"),
    ):
        with pytest.raises(InputError, match=f"^metric 'broken' raised {what}$"):
            run.summary([Metric("broken", of)])


def test_a_function_is_a_metric_too(run: Run) -> None:
    def delays(trips: Trips) -> Floats:
        return trips.depart_delay

    delays.unit, delays.per, delays.needs = "s", "trip", "trips"  # type: ignore[attr-defined]
    summary = run.summary([delays, "depart_delay_s"])
    assert summary["delays_p95"] == summary["depart_delay_s_p95"]


def test_a_count_of_the_controller_hides_no_metric(run: Run) -> None:
    counting = replace(run, counts={"honks": 3, "crossings": 2})
    summary = counting.summary(["crossings"])
    assert (summary["honks"], summary["crossings"]) == (3, 2)
    for name, asked in (("honks", [Metric("honks", lambda run: 1)]), ("trips", [])):
        with pytest.raises(InputError, match=f"count {name!r} has the name of another number"):
            replace(run, counts={name: 3}).summary(asked)


def test_safety_needs_trajectories() -> None:
    run = minisim.simulate(small_scenario(demand_time=20.0), Dim())
    assert not set(SAFETY) & set(run.summary())
    with pytest.raises(InputError, match="metric 'min_pet_s': no trajectories: simulate with rec"):
        run.summary(["min_pet_s"])


def test_safety_is_that_of_the_junction_whatever_was_recorded() -> None:
    scenario = four_way(300, profile="fair", horizon=120.0)
    near, everything = (
        minisim.simulate(scenario, Dim(), 1, record=record) for record in ("junction", "all")
    )
    assert len(near.trajectories) < len(everything.trajectories)
    assert near.safety == everything.safety


def test_throughput_counts_from_the_first_that_left(run: Run) -> None:
    trips = run.columns.taken(np.arange(4))
    times = np.array([100.0, 160.0, 130.0, np.nan])
    left = trips._replace(arrival=times, arrived=~np.isnan(times), end=220.0)
    throughput = METRICS["throughput_vph"]
    assert throughput.number(left) == pytest.approx(2 / 120 * 3600)
    assert throughput.number(left.taken(np.array([0, 3]))) is None


def test_a_metric_per_lane_is_a_series_over_time(run: Run) -> None:
    waves = Metric("waves", lambda run: np.arange(8).reshape(2, 4), per="lane")
    summary = run.summary([waves])
    assert [lane["waves"] for lane in summary["lanes"].values()] == [2, 3, 4, 5]
    assert (summary["waves"], summary["waves_max"]) == (14, 22)
    for wrong in (np.zeros(4), np.zeros((2, 3)), 5):
        bad = Metric("bad", lambda run, wrong=wrong: wrong, per="lane")  # type: ignore[misc]
        with pytest.raises(InputError, match=r"one number per time and lane.* shape \(k, 4\), got"):
            run.summary([bad])


def test_a_metric_of_a_group_gets_the_run_with_its_trips(run: Run) -> None:
    size = Metric("size", lambda run: len(run.columns.lane) + run.seed, needs="run and trips")
    summary = run.summary([size], by=["movement"])
    assert summary["size"] == summary["trips"] + 3
    assert all(it["size"] == it["trips"] + 3 for it in summary["movements"].values())


def test_messages_are_those_seen_and_those_told() -> None:
    """One vehicle, asked every second: it is shown until it has left, and told to go once."""
    scenario = replayed(four_way(0, profile="fair"), (0.0, 0, 2), horizon=120.0)
    shown = [0]

    def answer(view: View) -> list[Command]:
        shown[0] += len(view.vehicles)
        return [Go(0)] if len(view.vehicles) and shown[0] == 1 else []

    silent = Scripted(answer, Plan(period=1.0))
    told = ["messages", "message_bytes", "decisions"]
    run = minisim.simulate(scenario, silent)
    assert run.exchange == {"decisions": run.exchange["decisions"], "shown": shown[0], "Go": 1}
    quiet = run.summary(told)
    assert (quiet["messages"], quiet["message_bytes"]) == (0, 0)
    assert quiet["decisions"] > run.columns.arrival[0]
    loud = replace(run, controller=replace(silent, radio=Radio(state=100, command=7)))
    assert loud.summary(told)["messages"] == shown[0] + 1
    assert loud.summary(told)["message_bytes"] == 100 * shown[0] + 7


def test_what_passed_before_the_end_of_the_warmup_does_not_count() -> None:
    every = minisim.simulate(four_way(250, horizon=120.0), V2IC(), timed=True)
    late = minisim.simulate(four_way(250, horizon=120.0, warmup=80.0), V2IC(), timed=True)
    assert every.decision_times is not None
    assert late.decision_times is not None
    assert len(every.decision_times) == every.exchange["decisions"] > 100
    assert len(late.decision_times) == late.exchange["decisions"]
    for what in ("decisions", "shown", "Advise"):
        assert 0 < late.exchange[what] < 0.6 * every.exchange[what]
    summary = every.summary(["median_decision_us", "p99_decision_us", "messages"])
    assert 0.0 < summary["median_decision_us"] <= summary["p99_decision_us"]
    assert summary["messages"] > every.exchange["shown"]


def test_decisions_are_timed_only_when_asked() -> None:
    run = minisim.simulate(small_scenario(demand_time=20.0), Dim())
    assert run.decision_times is None
    with pytest.raises(InputError, match="decisions were not timed: simulate with timed=True"):
        run.summary(["p99_decision_us"])
    with pytest.raises(InputError, match="timed must be"):
        minisim.simulate(small_scenario(), Dim(), timed="yes")  # type: ignore[arg-type]


def test_headings() -> None:
    columns = "waiting_time_s", "complete_waiting_time_s", "trips", "mine"
    expected = "waiting [s]", "waiting, with unfinished [s]", "trips", "mine"
    assert tuple(map(heading, columns)) == expected


@given(warmup=st.floats(0.0, 119.0))
def test_trips_demanded_in_the_warmup_do_not_count(warmup: float) -> None:
    scenario = four_way(300, horizon=120.0)
    every = minisim.simulate(scenario, Dim(), 2).trips
    run = minisim.simulate(replace(scenario, warmup=warmup), Dim(), 2)
    summary, trips = run.summary(), run.trips
    kept = every[every["demand_time_s"] >= warmup].reset_index(drop=True)
    pd.testing.assert_frame_equal(trips, kept)
    assert summary["trips"] == len(kept) == sum(x["trips"] for x in summary["lanes"].values())
    assert summary["unfinished"] == kept["arrival_s"].isna().sum()
    for name in ("waiting_time_s", "depart_delay_s"):
        mean = kept.loc[kept["arrival_s"].notna(), name].mean()
        assert summary[name] == (pytest.approx(mean) if mean == mean else None)
    assert len(run.columns.lane) == len(every), "the arrays have them all"
    assert f"warmup={warmup}" in run.provenance["scenario"]
    assert summary["warmup_s"] == warmup


@pytest.fixture(scope="module")
def erring() -> tuple[Run, Run, Run]:
    """One run without a warm-up, one with 90 s, and the first one until then."""
    scenario = four_way(300, profile="fair", horizon=200.0)
    controller = Mixed(Dim(perception=NoisyPerception(intent_error=0.25)), 0.3)
    every, warm, early = (
        minisim.Simulation(made, controller, seed=3, record="all", on_collision="record")
        for made in (scenario, replace(scenario, warmup=90.0), scenario)
    )
    early.advance(90.0)
    return every.run(), warm.run(), early.result()


def test_nothing_else_in_the_warmup_is_measured(erring: tuple[Run, Run, Run]) -> None:
    every, warm, early = erring
    pd.testing.assert_frame_equal(every.trajectories, warm.trajectories)
    frame = every.trajectories[every.trajectories["time_s"] >= 90.0]
    exits = np.array([path.exit for path in every.site.intersection.paths])
    last = exits[movement_index(frame, every.site)] + RECORD_PAST
    entry = every.site.intersection.paths[0].entry
    frame = frame[(frame["s_m"] >= entry - RECORD_BEFORE) & (frame["s_m"] <= last)]
    assert warm.safety == safety_summary(frame, every.site)
    assert warm.safety["pets"] < every.safety["pets"]  # type: ignore[operator]  # both are numbers
    assert early.counts["crossings"] > 0
    for name, count in warm.counts.items():
        assert count == pytest.approx(every.counts[name] - early.counts[name], abs=0.11)
    assert warm.collisions == every.collisions, "they always count"


def test_own_metrics_get_no_warmup_either(erring: tuple[Run, Run, Run]) -> None:
    every, warm, _ = erring
    first = Metric("first", lambda run: run.trajectories["time_s"].min(), needs="trajectories")
    rows = Metric("rows", lambda run: len(run.trips))
    ids = Metric("ids", lambda run: run.columns.vehicle.astype(float), per="trip")
    kinds = Metric("kind_count", lambda run: len(run.kinds))
    summary = warm.summary([first, rows, ids, kinds])
    kept = every.columns.vehicle[every.columns.demand_time >= 90.0]
    assert summary["first"] == 90.0
    assert summary["rows"] == summary["kind_count"] == summary["trips"] == len(kept)
    assert warm.trips["vehicle"].tolist() == kept.tolist()
    assert summary["ids_max"] <= kept[-1]
    assert warm.counted.counted is warm.counted
    assert every.counted is every


def test_a_run_in_a_notebook_is_valid_html_with_escaped_names() -> None:
    scenario = replace(small_scenario(demand_time=60.0), name="<script>a&b")
    run = minisim.simulate(scenario, Unregulated(), on_collision="record")
    page = ET.fromstring(run._repr_html_().replace("<br>", "<br/>"))
    assert not any(element.attrib for element in page.iter()), "no colours, no styles"
    cells = list(page.itertext())
    assert cells[0].startswith("<script>a&b, unregulated: ")
    for lane, means in run.summary()["lanes"].items():
        assert cells[cells.index(lane) + 1] == str(means["trips"])


def test_a_repr_is_short_and_has_the_means(run: Run) -> None:
    lines = repr(run).splitlines()
    assert len(lines) <= 5
    assert (
        "four-way, dim+humans=0.4: 250 veh/h/lane, profile fair, fleet car, seed 3, 300 s"
        in lines[0]
    )
    assert f"waiting {run.summary()['waiting_time_s']:.2f} s" in repr(run)
    warm = replace(run, scenario=replace(four_way(horizon=300.0), warmup=60.0))
    for text in (repr(warm).splitlines()[0], warm._repr_html_()):
        assert "seed 3, 300 s (warm-up 60 s)" in text
    odd = replace(run, scenario=replace(small_scenario(), name="a " * 500))
    assert len(repr(odd).splitlines()) <= 5
    empty = minisim.simulate(small_scenario(density=0), Dim())
    assert "waiting – s" in repr(empty)
