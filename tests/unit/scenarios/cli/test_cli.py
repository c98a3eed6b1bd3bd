"""The command line: every command, and every error as one line and exit code 2."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import inspect
import json
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import minisim.simulation
from dim import HarmonyMatrix
from figures import read_scene
from minisim.errors import InputError
from minisim.recorded import write_arrivals
from minisim.results.metrics import METRICS, SAFETY
from minisim.results.run import Run
from minisim.results.summary import TRIP_COLUMNS
from scenarios import four_way
from scenarios.cli import COMMANDS, app, main
from scenarios.cli.shared.proof import harmony_table
from scenarios.cli.shared.terminal import show
from scenarios.controllers import controller_named
from scenarios.demo import Tour
from tests import ROOT
from tests.builders import python

Captured = pytest.CaptureFixture[str]

SHORT = ("--horizon", "240", "--density", "300")

RUN_KEYS = {
    "controller", "scenario", "profile", "density", "seed", "horizon_s", "trips", "unfinished",
    "waiting_time_s", "travel_time_s", "depart_delay_s", "lanes", "collisions", "complete",
}  # fmt: skip


def ok(capsys: Captured, *arguments: str) -> str:
    code = main(arguments)
    captured = capsys.readouterr()
    assert (code, captured.err) == (0, "")
    return captured.out


def fails(capsys: Captured, *arguments: str, code: int = 2) -> str:
    returned = main(arguments)
    captured = capsys.readouterr()
    assert (returned, captured.out) == (code, "")
    assert captured.err.startswith("minisim: ")
    assert captured.err.count("\n") == 1, "one line"
    return captured.err


def answer(capsys: Captured, *arguments: str) -> Any:
    return json.loads(ok(capsys, *arguments, "--json"))


def lines_of(text: str) -> dict[str, list[str]]:
    """The first word of each line -> the others."""
    return {words[0]: words[1:] for line in text.splitlines() if (words := line.split())}


def shell(command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `minisim …` as a shell does, with its redirections."""
    return subprocess.run(
        ["sh", "-c", command.replace("minisim", '"$0" -m minisim', 1), sys.executable],
        cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_help_lists_every_command(capsys: Captured) -> None:
    text = ok(capsys, "--help")
    assert ok(capsys) == text
    assert all(f" {name} " in text for name in COMMANDS)
    assert all(f"minisim {name}" in ok(capsys, name, "--help") for name in COMMANDS)
    assert ok(capsys, "--version") == f"minisim {minisim.__version__}\n"
    assert {c.name or c.callback.__name__ for c in app.registered_commands} == set(COMMANDS)


@pytest.mark.parametrize("asked", [True, False])
def test_only_a_command_that_simulates_announces_compiling(
    asked: bool, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What counts is what `main` is given, not how this process was started."""
    told: list[str] = []
    monkeypatch.setattr(sys, "argv", ["minisim", "run", *(["--help"] * (not asked))])
    monkeypatch.setattr("scenarios.cli.shared.app.announce_if_new", lambda: told.append("new"))
    main(["run", "--help"] if asked else ["run", "nowhere"])
    assert told == ["new"] * (not asked)


def test_run_help_has_examples_that_work(capsys: Captured) -> None:
    lines = [" ".join(line.split()) for line in ok(capsys, "run", "--help").splitlines()]
    examples = [line for line in lines if line.startswith("minisim run ")]
    assert len(examples) == 2
    for example in examples:
        arguments = example.partition(" --trips ")[0].split()[1:]
        ok(capsys, *arguments, "--horizon", "60")


def test_run_help_fits_on_two_screens() -> None:
    lines = shell("minisim run --help", COLUMNS="80", TERMINAL_WIDTH="80").stdout.splitlines()
    assert len(lines) <= 2 * 30
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(("command", "heavy"), [
    (["--help"], {"numpy", "shapely", "pandas", "matplotlib", "numba", "networkx", "pymunk"}),
    (["run", "four-way", "--horizon", "5"], {"pandas", "matplotlib", "networkx", "scipy.linalg"}),
    (["run", "four-way", "--horizon", "5", "-p", "as_run"], {"scipy.linalg"}),  # makes arrays
])  # fmt: skip
def test_a_command_loads_what_it_uses(command: list[str], heavy: set[str]) -> None:
    """A run's measures take no pandas, and its kernel, once on disk, not numba's compiler."""
    script = (
        f"import sys; from scenarios.cli import main; main({command}); "
        f"print(*sorted({heavy} & set(sys.modules)))"
    )
    loaded = python("-c", script).stdout.splitlines()[-1]
    if loaded:  # it may have had to compile
        loaded = python("-c", script).stdout.splitlines()[-1]
    assert loaded == ""


def test_run_json_is_the_summary_and_safety(capsys: Captured) -> None:
    printed = answer(capsys, "run", "four-way", *SHORT, "--seed", "3")
    run = minisim.simulate(four_way(300, horizon=240), controller_named("dim"), seed=3)
    assert set(printed) >= RUN_KEYS
    safety = {name: printed.pop(name) for name in SAFETY}
    assert safety["min_ttc_s"] > 0 < safety["min_pet_s"]
    assert printed == run.summary()
    assert set(printed["lanes"]) == set("abcd")


def test_run_prints_every_lane_and_the_total(capsys: Captured) -> None:
    out = ok(capsys, "run", "five-way", *SHORT, "-c", "fixed-time", "-p", "fair")
    rows = lines_of(out)
    served = [int(rows[lane][0]) for lane in "abcde"]
    assert int(rows["all"][0]) == sum(served)
    assert rows["collisions"][0] == "0"
    heads = ("waiting [s]", "travel [s]", "departure delay [s]", "minimum TTC", "minimum PET")
    assert all(word in out for word in heads)


def test_run_counts_the_messages_that_get_lost(capsys: Captured) -> None:
    failing = ("--loss", "0.4", "--latency", "0.1", "--jitter", "0.1", "-c", "v2ic")
    arguments = ("run", "four-way", *SHORT, "-p", "fair", *failing)
    printed = answer(capsys, *arguments)
    assert printed["controller"] == "v2ic+latency=0.1+jitter=0.1+loss=0.4"
    sent = printed["states_sent"] + printed["orders_sent"]
    assert 0.35 < printed["messages_lost"] / sent < 0.45
    assert f"messages lost {printed['messages_lost']}" in ok(capsys, *arguments)


def test_run_tells_humans_from_the_others(capsys: Captured) -> None:
    arguments = ("run", "four-way", *SHORT, "-p", "fair", "--humans", "0.4")
    printed, rows = answer(capsys, *arguments), lines_of(ok(capsys, *arguments))
    assert printed["controller"] == "dim+humans=0.4"
    groups = printed["kinds"]
    assert groups["human"]["trips"] + groups["automated"]["trips"] == printed["trips"]
    for name in ("human", "automated"):
        assert int(rows[name][0]) == groups[name]["trips"] - groups[name]["unfinished"]


def test_run_counts_false_grants_where_perception_errs(capsys: Captured) -> None:
    run = ("run", "four-way", "-p", "fair", *SHORT, "--no-safety", "--on-collision", "record")
    told = ok(capsys, *run, "-c", "dim:perception=noisy(intent_error=0.15,kind=symmetric)")
    assert "false grants" in told
    summary = answer(capsys, *run, "-c", "dim:perception=noisy(unsignalled=(0.29,0.25))")
    assert summary["crossings"] >= summary["trips"] - summary["unfinished"]
    assert "false grants" not in ok(capsys, *run)


def test_run_without_vehicles(capsys: Captured) -> None:
    arguments = ("run", "three-way", "--density", "0", "--horizon", "60")
    assert answer(capsys, *arguments)["waiting_time_s"] is None
    assert "–" in ok(capsys, *arguments)


def test_run_writes_trips_trajectories_and_fcd(capsys: Captured, tmp_path: Path) -> None:
    trips, table, fcd = (tmp_path / name for name in ("trips.csv", "t.parquet", "fcd.xml"))
    plain = ok(capsys, "run", "four-way", *SHORT, "--json")
    full = ok(
        capsys, "run", "four-way", *SHORT, "--json", "--trips", str(trips),
        "--trajectories", str(table), "--fcd", str(fcd),
    )  # fmt: skip
    assert plain == full, "what is written changes no result"
    rows = pd.read_csv(trips)
    assert tuple(rows) == TRIP_COLUMNS
    assert len(rows) == json.loads(full)["trips"]
    assert pd.read_parquet(table)["time_s"].max() == pytest.approx(240.0)
    assert ET.parse(fcd).getroot().tag == "fcd-export"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["fcd.xml", "t.parquet", "trips.csv"]


def test_run_replays_recorded_arrivals(capsys: Captured, tmp_path: Path) -> None:
    arrivals = tmp_path / "arrivals.csv"
    arrivals.write_text("demand_time_s,lane,manoeuvre\n0,a,2\n3,c,1\n")
    printed = answer(capsys, "run", "four-way", "--horizon", "120", "--arrivals", str(arrivals))
    assert (printed["trips"], printed["unfinished"]) == (2, 0)
    assert printed["lanes"]["c"]["trips"] == 1
    arrivals.write_text("demand_time_s,lane,manoeuvre\n0,a,2\n3,e,1\n")
    assert "line 3" in fails(capsys, "run", "four-way", "--arrivals", str(arrivals))


def test_split_turns_and_side_reach_the_scenario(capsys: Captured) -> None:
    demand = ("--split", "1:0:0:0", "--turns", "0:1:0", "--side", "right", "--by", "movement")
    groups = answer(capsys, "run", "four-way", *SHORT, *demand)["movements"]
    assert [name for name, means in groups.items() if means["trips"]] == ["a2"]


def test_collision_stops_the_run_and_writes_nothing(capsys: Captured, tmp_path: Path) -> None:
    trips = tmp_path / "trips.csv"
    arguments = ("run", "four-way", *SHORT, "-c", "unregulated", "--trips", str(trips))
    advice = f"{trips} not written; --on-collision record notes collisions and goes on"
    assert advice in fails(capsys, *arguments, code=1)
    assert list(tmp_path.iterdir()) == []
    assert main([*arguments, "--json"]) == 1
    printed = capsys.readouterr()
    facts = json.loads(printed.out)
    assert (facts["controller"], facts["seed"], facts["collisions"]) == ("unregulated", 0, 1)
    assert len(facts["touched"][0]["vehicles"]) == 2
    assert f"minisim: {facts['error']}; {advice}" in printed.err
    assert " touched" in ok(capsys, *arguments, "--on-collision", "record")
    assert trips.exists()


def test_without_safety_no_recording(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    records, real = [], minisim.simulation.Simulation

    def spy(*arguments: Any, **options: Any) -> Any:
        records.append(options["record"])
        return real(*arguments, **options)

    monkeypatch.setattr("minisim.simulation.Simulation", spy)
    with_safety = answer(capsys, "run", "four-way", *SHORT)
    without = answer(capsys, "run", "four-way", *SHORT, "--no-safety")
    assert records == ["junction", None]
    assert without == {k: v for k, v in with_safety.items() if k not in SAFETY}


def test_metrics_that_were_asked_for_by_movement(capsys: Captured) -> None:
    asked = ("--metrics", "time_loss_s,max_drac_mps2,queue_growth", "--by", "movement")
    printed = answer(capsys, "run", "four-way", *SHORT, *asked)
    assert len(printed["movements"]) == 12
    assert printed["max_drac_mps2"] > 0.0
    out = ok(capsys, "run", "four-way", *SHORT, *asked)
    means = printed["movements"]["a1"]
    expected = [means[f"time_loss_s{what}"] for what in ("", "_p50", "_p95", "_max")]
    shown = [f"{value:.2f}" for value in (*expected, means["queue_growth"])]
    assert lines_of(out)["a1"][2:] == shown
    assert all(word in out for word in ("time loss [s]", "p95", "queue growth", "maximum DRAC"))


def test_grades_are_letters_and_queues_have_percentiles(capsys: Captured) -> None:
    asked = ("-c", "fixed-time", "--metrics", "level_of_service,queue")
    printed = answer(capsys, "run", "four-way", *SHORT, *asked)
    lanes, out = printed["lanes"], lines_of(ok(capsys, "run", "four-way", *SHORT, *asked))
    for lane in "abcd":
        spread = [lanes[lane][f"queue{what}"] for what in ("", "_p50", "_p95", "_max")]
        grade = "ABCDEF"[lanes[lane]["level_of_service"] - 1]
        assert out[lane][2:] == [grade, *(f"{value:.2f}" for value in spread)]
    assert out["all"][-1] == f"{printed['queue_max']:.2f}"


def test_each_number_is_printed_once(capsys: Captured) -> None:
    once = ("collisions", "min_ttc_s", "trips", "unfinished", "max_braking_mps2", "crossings")
    out = ok(capsys, "run", "four-way", *SHORT, "--metrics", ",".join(once))
    for word in ("collisions", "minimum TTC", "trips", "unfinished", "hardest braking"):
        assert out.replace("with unfinished", "").count(word) == 1, word
    assert "crossings – (counted only where perception errs)" in out
    noisy = ("-c", "dim:perception=noisy(unsignalled=(0.29,0.25))", "--metrics", "crossings")
    assert ok(capsys, "run", "four-way", "--horizon", "60", *noisy).count("crossings") == 1


def test_the_warmup_is_named_and_left_out(capsys: Captured, tmp_path: Path) -> None:
    file = tmp_path / "trips.csv"
    arguments = ("run", "four-way", *SHORT, "--warmup", "60", "--trips", str(file))
    assert "seed 0, 240 s (warm-up 60 s)" in ok(capsys, *arguments)
    trips = pd.read_csv(file)
    assert trips["demand_time_s"].min() >= 60.0
    assert trips["vehicle"][0] > 0
    assert len(trips) == answer(capsys, *arguments)["trips"]


OWN = """
from minisim.results.metric import Metric


def delay(trips):
    return trips.depart_delay


delay.unit, delay.per, delay.needs = "s", "trip", "trips"
twice = Metric("twice", lambda run: 2 * len(run.trips))


def broken(run):
    return run.trips["dely"].mean()
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_metrics_of_your_own(capsys: Captured, here: Path) -> None:
    (here / "own_metrics.py").write_text(OWN, encoding="utf-8")
    run = ("run", "four-way", *SHORT, "--no-safety", "--metrics")
    printed = answer(capsys, *run, "own_metrics:delay, own_metrics.py:twice")
    assert printed["delay"] == printed["depart_delay_s"]
    assert printed["twice"] == 2 * printed["trips"]
    assert "delay [s]" in ok(capsys, *run, "own_metrics:delay")
    said = fails(capsys, *run, "own_metrics:broken")
    assert "metric 'broken' raised KeyError: 'dely' (own_metrics.py, line 14)" in said
    assert "unknown metric of own_metrics 'dealy'" in fails(capsys, *run, "own_metrics:dealy")
    asked = 'metrics = ["own_metrics:delay", "own_metrics:twice"]\n'
    (here / "e.toml").write_text(f"horizon = 60\nseeds = 2\n{asked}")
    out = ok(capsys, "sweep", "e.toml", "--out", "s.db", "--jobs", "2")
    assert all(word in out for word in ("delay [s]", "p95", "twice"))
    del sys.modules["own_metrics"]


def test_metrics_lists_the_table(capsys: Captured) -> None:
    assert [metric["name"] for metric in answer(capsys, "metrics")] == list(METRICS)
    out = " ".join(ok(capsys, "metrics").split())
    assert all(metric.name in out and metric.meaning in out for metric in METRICS.values())


def test_harmony_csv_is_the_papers_file(capsys: Captured) -> None:
    published = (ROOT / "dim" / "data" / "harmony_4way.csv").read_text()
    assert ok(capsys, "harmony", "four-way", "--csv").split() == published.split()


def test_harmony_table_json_and_csv_agree(capsys: Captured) -> None:
    arguments = ("harmony", "custom", "--bearings", "0,80,190,260", "--side", "right")
    printed = answer(capsys, *arguments)
    header, *rows = (line.split(",") for line in ok(capsys, *arguments, "--csv").split())
    assert printed["movements"] == header[1:]
    assert [[str(v) for v in row] for row in printed["harmony"]] == [row[1:] for row in rows]
    table = ok(capsys, *arguments)
    assert table.count("●") - 1 == sum(map(sum, printed["harmony"])), "and one in the title"


def test_harmony_of_twelve_arms_is_not_cut(capsys: Captured) -> None:
    show(harmony_table(HarmonyMatrix(12, np.zeros((132, 132), dtype=bool))))
    lines = capsys.readouterr().out.splitlines()
    assert "l10 l11" in lines[1]
    assert [line.count("·") for line in lines if line.startswith((" a", " l"))] == [132] * 22


def test_clearance_only_removes_harmony(capsys: Captured) -> None:
    harmony = ("harmony", "five-way", "--clearance")
    found = [answer(capsys, *harmony, clearance)["harmony"] for clearance in ("0", "0.5", "3")]
    none, usual, wide = (sum(map(sum, values)) for values in found)
    assert none >= usual > wide


def test_longer_bodies_only_remove_harmony(capsys: Captured) -> None:
    wide = ("harmony", "four-way", "--lane-width", "3.5", "--fleet")
    cars, mixed = (answer(capsys, *wide, fleet) for fleet in ("car", "car:0.9,bus:0.1"))
    assert sum(map(sum, cars["harmony"])) > sum(map(sum, mixed["harmony"]))
    assert mixed["fleet"] == "car:0.9,bus:0.1"


def test_a_decision_is_drawn_with_what_a_type_sweeps(capsys: Captured, tmp_path: Path) -> None:
    decide, file = ("decide", "four-way", "a1", "b2", "--corridor"), tmp_path / "corridor.svg"
    assert main([*decide, "bus-offtracking", "--plot", str(file)]) == 0
    told = "minisim: decided for car; the corridors are of bus-offtracking"
    assert capsys.readouterr().err.strip() == told
    with_corridors = file.read_bytes()
    ok(capsys, *decide[:-1], "--plot", str(file))
    assert file.read_bytes() != with_corridors
    assert "needs --plot" in fails(capsys, *decide, "bus")
    assert "did you mean 'bus'" in fails(capsys, *decide, "buss", "--plot", str(file))


def test_decide_answers_as_the_paper(capsys: Captured) -> None:
    arguments = ("decide", "four-way", "a1", "b2", "c2", "d2")
    printed = answer(capsys, *arguments)
    assert printed["right_of_way"] == ["a1", "b2"]
    # Paper, section "Deadlock Analysis": (c2, a1), (a1, b2), (b2, d2).
    for pairs in (printed["tied"], printed["edges"]):
        assert sorted(map(sorted, pairs)) == [["a1", "b2"], ["a1", "c2"], ["b2", "d2"]]
    text = ok(capsys, *arguments)
    assert text.count("tied") == 3
    assert "{a1 b2}  tied  ← right of way" in text
    assert printed["reason"] in text


@pytest.mark.parametrize("command", ["decide three-way a1 c2", "verify three-way"])
def test_answers_are_drawn(capsys: Captured, tmp_path: Path, command: str) -> None:
    for suffix, magic in (("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")):
        file = tmp_path / f"decision.{suffix}"
        assert f"wrote {file}" in ok(capsys, *command.split(), "--plot", str(file))
        assert file.read_bytes().startswith(magic)


def test_a_run_begins_at_a_time_of_day(capsys: Captured, tmp_path: Path) -> None:
    morning = tmp_path / "morning.csv"
    morning.write_text("demand_time_s,lane,manoeuvre\n25205,a,2\n25207,b,1\n28900,c,3\n")
    run = ("run", "four-way", "--arrivals", str(morning), "--no-safety")
    assert "the first recorded arrival is at 25205 s (07:00:05)" in fails(capsys, *run)
    late = fails(capsys, *run, "--start", "07:00", "--horizon", "3")
    assert "first recorded arrival is at 25205 s (07:00:05)" in late
    for start, trips in (("07:00", 2), ("25205", 2), ("8:00", 1), ("7:00:06", 1)):
        assert answer(capsys, *run, "--start", start)["trips"] == trips
    assert "start must be a time of day" in fails(capsys, *run, "--start", "7h")
    assert "no vehicle comes from '09:00' on" in fails(capsys, *run, "--start", "09:00")
    film = ("-o", str(tmp_path / "film.gif"))
    for command in (("run", "four-way"), ("animate", "four-way", *film)):
        assert "--start needs --arrivals" in fails(capsys, *command, "--start", "07:00")


def test_a_run_draws_from_demand_by_time_of_day(capsys: Captured, tmp_path: Path) -> None:
    day = tmp_path / "day.toml"
    quarter = '[[period]]\nstart = "07:{}"\nend = "07:{}"\nrates = [{}, 0, 0]\nturns = "1:0"\n'
    day.write_text(quarter.format("00", "15", 800) + quarter.format("15", "20", 0))
    run = ("run", "three-way", "--demand", str(day), "--no-safety")
    whole = answer(capsys, *run, "--by", "movement")
    assert whole["horizon_s"] == 1200.0
    assert whole["density"] == pytest.approx(200)
    assert whole["trips"] == whole["movements"]["a1"]["trips"] == 206
    assert answer(capsys, *run, "--start", "07:15")["trips"] == 0
    assert answer(capsys, *run, "--horizon", "450")["trips"] == 95
    assert "before the run of 3600 s" in fails(capsys, *run, "--horizon", "3600")
    day.write_text('fleet = "lcv"\n' + day.read_text())
    assert answer(capsys, *run)["fleet"] == "lcv"
    assert main([*run, "--fleet", "car"]) == 0
    said = capsys.readouterr().err
    assert said == "minisim: the fleet car replaces that of the demand 'day'\n"
    assert "--demand replaces --density" in fails(capsys, *run, "-d", "350")
    assert "--arrivals replaces --demand" in fails(capsys, *run, "--arrivals", "x.csv")
    film = ("animate", "three-way", "--demand", str(day), "-o", str(tmp_path / "film.gif"))
    assert "--from [s] must be at least 0 and below 1200" in fails(capsys, *film, "--from", "1200")


def test_animate_writes_a_gif(capsys: Captured, tmp_path: Path) -> None:
    file = tmp_path / "film.gif"
    what = "animate four-way --from 60 --seconds 2 --fps 5 --density 400 -o"
    ok(capsys, *what.split(), str(file))
    with Image.open(file) as film:
        assert film.n_frames == 10
        assert film.info["duration"] == 200
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "more", [("-d", "300"), ("--arrivals", "{arrivals}"), ("-d", "300", "--humans", "0.4")]
)
def test_a_film_shows_the_run_of_the_same_options(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: tuple[str, ...]
) -> None:
    """To the last digit of a trip; the film just ends earlier."""
    recorded = tmp_path / "arrivals.csv"
    write_arrivals(four_way(300, split="4:3:2:1").arrivals(3), recorded)
    films: list[Run] = []
    writer = "figures.film.animate.write_animation"
    monkeypatch.setattr(writer, lambda run, *_, **__: films.append(run))
    what = ("four-way", "--seed", "3", *(text.format(arrivals=recorded) for text in more))
    for controller in ("fixed-time", "dim") if "--humans" not in what else ("dim",):
        options = (*what, "-c", controller)
        ok(capsys, "animate", *options, "-o", str(tmp_path / "x.gif"), "--from", "140")
        ok(capsys, "run", *options, "--trips", str(tmp_path / "trips.csv"), "--no-safety")
        film, whole = films.pop().trips, pd.read_csv(tmp_path / "trips.csv")
        over = film["arrival_s"] <= 200.0
        assert over.sum() > 20
        pd.testing.assert_frame_equal(film[over], whole[: len(film)][over], check_dtype=False)


def test_animate_plays_two_runs_of_the_same_arrivals(capsys: Captured, tmp_path: Path) -> None:
    page, file = tmp_path / "two.html", tmp_path / "one.json"
    what = ("animate", "four-way", "-d", "300", "--seed", "3", "--from", "40", "--seconds", "10")
    assert ok(capsys, *what, "--beside", "fixed-time", "-o", str(page)) == f"wrote {page}\n"
    ok(capsys, *what, "-o", str(file))
    (held,) = re.findall(r'"application/json">(.*?)</script>', page.read_text(encoding="utf-8"))
    one, other = json.loads(held)
    assert one == read_scene(file)
    assert [it["controller"] for it in (one, other)] == ["dim", "fixed-time"]
    assert one["reasons"]
    assert one["start"] == 40.0


#: Options of `run` that change no traffic: what is measured, written, or done in SUMO.
OF_RUN_ALONE = {
    "warmup", "on_collision", "no_safety", "metrics", "by", "as_json", "trips", "trajectories",
    "fcd", "host", "sumo_model", "gui", "keep_files", "sumo_fcd",
}  # fmt: skip


@pytest.mark.parametrize("command", ["animate", "why"])
def test_every_option_that_changes_the_traffic_is_there(command: str) -> None:
    """`run`, `animate` and `why` show the same run, with the same types and defaults."""
    of_run, of_other = (
        inspect.signature(getattr(importlib.import_module(f"scenarios.cli.{it}"), it)).parameters
        for it in ("run", command)
    )
    assert of_run.keys() - of_other.keys() <= OF_RUN_ALONE
    for name in of_run.keys() & of_other.keys() - OF_RUN_ALONE:
        assert of_run[name] == of_other[name]


def test_animate_checks(capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("minisim.simulation.Simulation", None)  # would be a TypeError
    monkeypatch.setenv("PATH", here := str(tmp_path))
    for file, more, said in (
        ("film.avi", (), ".html, .gif, .mp4, .json"), ("film.mp4", (), "ffmpeg"),
        ("no/film.gif", (), f"no folder {here}/no"), ("f.gif", ("--fps", "11"), "fps"),
        ("f.gif", ("--from", "280", "--seconds", "60", "--horizon", "300"), "--seconds must be"),
        ("f.gif", ("--from", "280", "--horizon", "200"), "--from [s] must be"),
    ):  # fmt: skip
        assert said in fails(capsys, "animate", "four-way", "-o", f"{here}/{file}", *more)
    recorded = tmp_path / "f.gif"
    recorded.write_text("demand_time_s,lane,manoeuvre\n0,a,2\n")
    twice = ("--arrivals", str(recorded), "-o", f"{here}/../{tmp_path.name}/f.gif")
    assert "--out name the same file" in fails(capsys, "animate", "four-way", *twice)


def test_demo_quick(capsys: Captured, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "out"
    out = ok(capsys, "demo", "--quick", "--out", str(folder), "--jobs", "1")
    names = ["demo.csv", "demo.gif", "demo.md", "demo.png"]
    assert sorted(p.name for p in folder.iterdir()) == names
    assert "DIM, harmonious gate" in out
    points = pd.read_csv(folder / "demo.csv")
    assert {*points["controller"]} == {"dim", "dim:gate=harmonious", "fixed-time"}
    assert {*points["density"]} == {150.0, 350.0}
    assert (points["waiting_time_s_ci95"] > 0).all()
    assert (points["collisions"] == 0).all()
    assert (folder / "demo.md").read_text().count("\n|") == 2 + len(points)
    with Image.open(folder / "demo.gif") as film:
        assert film.n_frames == 100


def test_demo_takes_the_seeds_it_is_given(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(tour: Tour) -> None:
        raise InputError(f"{tour.seeds} seeds")

    monkeypatch.setattr(Tour, "film", stop)
    for count, more in ((7, ("--quick", "--seeds", "7")), (2, ("--quick",)), (5, ())):
        assert f"{count} seeds" in fails(capsys, "demo", *more, "--out", str(tmp_path))


BAD = [
    (("rum",), "rum"),
    (("run",), "SCENARIO"),
    (("run", "four-way", "--fo"), "--fo"),
    (("run", "for-way"), "did you mean 'four-way'"),
    (("run", "custom", "--bearings", "0,x,90"), "0,x,90"),
    (("run", "custom", "--bearings", "0,nan,90"), "'nan' is not a finite number"),
    (("run", "four-way", "--arrivals", ""), "--arrivals': '' is not a file name"),
    (("run", "four-way", "--bearings", "0,90,180"), "custom"),
    (("run", "four-way", "-d", "many"), "many"),
    (("run", "four-way", "--arrivals", "missing.csv", "-d", "3"), "--density"),
    (("run", "four-way", "--trips", "/no/such/folder/t.csv"), "/no/such/folder"),
    (("run", "four-way", "--trips", "t.xlsx"), ".csv, .parquet"),
    (("run", "four-way", "--fcd", "fcd.csv"), "allowed: .xml"),
    (("run", "four-way", "--trips", "trips.csv", "--fcd", "none/fcd.xml"), "no folder"),
    (("harmony", "four-way", "--clearance", "-1"), "-1"),
    (("harmony", "four-way", "--csv", "--json"), "--json"),
    (("decide", "four-way", "a1", "--order", "sise"), "did you mean 'size'"),
    (("decide", "four-way", "a1", "--plot", "p.bmp"), ".png, .pdf, .svg"),
    (("animate", "four-way", "-o", "x.json", "--fps", "5"), "--fps is for a .gif or .mp4"),
    (("animate", "four-way", "-o", "x.gif", "--beside", "dim"), "--beside is for a .html"),
    (("animate", "four-way", "--beside", "dum"), "did you mean 'dim'"),
    (("run", "four-way", "--metrics", "pets,trips", "--no-safety"), "asks for pets, which --no"),
    (("run", "four-way", "--metrics", "own_none:delay"), "there is no own_none.py"),
    (("run", "four-way", "--by", "lan"), "did you mean 'lane'?"),
    (("controllers", "dum"), "did you mean 'dim'"),
    (("controllers", "baselines:Fixed"), "did you mean 'FixedTime'"),
    (("demo", "--seeds", "1"), "--seeds must be an integer 2 … 1000"),
    (("demo", "--out", f"{ROOT / 'pyproject.toml'}/out"), "pyproject.toml/out"),
    (("verify", "9-way"), "9 arms have 387420488 cases, too many to try all"),
    (("verify", "four-way", "--plot", "/nowhere/x.png"), "there is no folder /nowhere"),
    (("protocol", "five-way"), "searched for 3 and 4 arms; five-way has 5"),
    (("protocol", "three-way", "--counterexample", "x.txt"), "'.txt'; allowed: .csv"),
    (("protocol", "three-way", "--counterexample", "x.csv"), "there is no counterexample"),
    (("sweep", "paper", "--jobs", "0"), "--jobs must be an integer 1"),
    (("sweep", "paper", "--seeds", "0"), "--seeds must be an integer 1"),
    (("sweep", "paper", "--horizon", "inf"), "--horizon [s] must be a finite number, got inf"),
    (("sweep", "paper", "--jobs", "2", "--scheduler", "tcp://x:1"), "give one"),
    (("sweep", "paper", "--export", "rows.txt"), "suffix of rows.txt"),
    (("sweep", "capacity"), "earlier ones: use minisim reproduce --only capacity"),
    (("sweep", "x" * 300), "unknown study 'xxx"),
    (("sweep", "x" * 300 + ".toml"), "File name too long"),
    (("run", "four-way", "-c", f"{'x' * 300}.py:X"), "cannot read xxx"),
    (("sweep", "/dev/full"), "/dev/full: it is neither an ordinary file nor a pipe"),
    (("sweep", "/"), "cannot read experiments from /: Is a directory"),
    (("sweep", "fare"), "unknown study 'fare'; allowed: paper, text, as-run"),
    (("figures", "maps", "fairnes"), "did you mean 'fairness'"),
    (("figures", "webster", "gate"), "gate: drawn from results; give them with --store"),
    (("figures", "webster", "--store", "runs.sqlite"), "there is no store"),
    (("reproduce", "--seeds", "1"), "seeds must be an integer"),
    (("reproduce", "--only", "fare"), "did you mean 'fair'"),
    (("run", "four-way", "-c", "dim", "--controller=fixed-time"), "--controller is given twice"),
    (("run", "four-way", "-d300", "-d", "350"), "-d is given twice"),
    (("crossval", "-c", "dim", "-c", "fixed-time", "-c", "dim"), "--controller dim is given twice"),
    (("reproduce", "--only", "text", "--only", "text"), "--only text is given twice"),
    (("crossval", "--seeds", "0"), "--seeds"),
    (("crossval", "--replay", "--seeds", "2"), "--seeds does not go with --replay"),
    (("crossval", "--replay", "--lane-width", "3.5"), "--lane-width does not go with --replay"),
    (("crossval", "--replay", "6-way"), "unknown junction of a published run"),
    (("crossval", "--replay", "-d", "400"), "no dim run of 400 veh/h; it has 150, 200, 250, 300,"),
    (("crossval", "--replay", "--split", "1:1:1:1"), "unknown split of a published run"),
    (("crossval", "--replay", "-c", "reservation"), "unknown published controller 'reservation'"),
    (("crossval", "--replay", "five-way", "-c", "v2ic"), "on 3 and 5 arms, only dim and balanced"),
    (("crossval", "three-way", "-c", "v2ic-as-run"), "v2ic-as-run cannot serve three-way at 150"),
]


@pytest.mark.parametrize(("arguments", "named"), BAD, ids=[" ".join(a)[:50] for a, _ in BAD])
def test_bad_input_is_one_line_and_writes_nothing(
    capsys: Captured, here: Path, arguments: tuple[str, ...], named: str
) -> None:
    assert named in fails(capsys, *arguments)
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ("first", "second"),
    [("--trips", "--trajectories"), ("--trips", "--fcd"), ("--arrivals", "--trips")],
)
def test_no_file_is_written_twice_or_over_an_input(
    capsys: Captured, here: Path, monkeypatch: pytest.MonkeyPatch, first: str, second: str
) -> None:
    monkeypatch.setattr("minisim.simulation.Simulation", None)  # would be a TypeError
    file, link = here / "a.csv", here / "link.csv"
    file.write_text("demand_time_s,lane,manoeuvre\n0,a,2\n")
    link.symlink_to(file)
    before = file.read_text()
    for other in ("a.csv", "./a.csv", str(link)):
        message = fails(capsys, "run", "four-way", first, str(file), second, other)
        assert f"{first} and {second} name the same file" in message
    assert file.read_text() == before


def test_ctrl_c_is_130(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("scenarios.cli.shared.options.build_scenario", interrupted)
    assert main(["run", "four-way"]) == 130
    assert capsys.readouterr().err == "minisim: interrupted\n"


def test_a_reader_that_goes_away_is_not_an_error() -> None:
    assert shell("minisim harmony four-way | true").stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "command",
    ["run three-way --horizon 20", "run three-way --horizon 20 --json", "--help", "--version",
     "harmony five-way --csv"],
)  # fmt: skip
def test_a_full_disk_is_one_line(command: str) -> None:
    done = shell(f"minisim {command} > /dev/full")
    assert done.stderr == "minisim: cannot write to stdout: No space left on device\n"
    assert done.returncode == 1


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_are_not_an_error(closed: str) -> None:
    for command in ("harmony three-way --csv", "--help"):
        done = shell(f"minisim {command} {closed}")
        assert (done.returncode, done.stderr) == (0, "")
    assert shell(f"minisim harmony 2-way {closed}").returncode == 2


def test_a_terminal_without_unicode_gets_plain_characters() -> None:
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""}
    table = shell("minisim harmony three-way", **plain)
    decision = shell("minisim decide four-way a1 b2", PYTHONIOENCODING="ascii")
    for done, words in ((table, "x harmony, . conflict"), (decision, "a1-b2")):
        assert (done.returncode, done.stderr) == (0, "")
        assert words in done.stdout


def test_verify_tells_what_all_cases_showed_and_as_json(capsys: Captured) -> None:
    text = ok(capsys, "verify", "four-way")
    tie = "4 cliques tie (no graph of 4 nodes has more than 4)"
    for words in ("four-way, 4 arms: all 255 cases, order size", "130 (51%)", tie):
        assert words in text
    printed = answer(capsys, "verify", "three-way")
    assert (printed["arms"], printed["cases"], printed["most_cliques_tied"]) == (3, 26, 3)
    assert all(claim["holds"] for claim in printed["claims"])
    assert printed["cases_by_cliques_tied"] == {"1": 16, "2": 9, "3": 1}
    assert printed["worst_cases"] == [{"clique_size": 1, "cases": 1, "first": ["a2", "b2", "c2"]}]


def test_verify_shows_a_false_claim_and_exits_1(capsys: Captured) -> None:
    assert main(["verify", "three-way", "--order", "lanes", "--json"]) == 1
    printed = json.loads(capsys.readouterr().out)
    (false,) = [claim for claim in printed["claims"] if not claim["holds"]]
    assert (false["name"], false["failures"]) == ("largest", 1)
    assert false["smallest_counterexample"] == ["a2", "b1", "c2"]


def test_protocol_tells_what_it_visited_and_as_json(capsys: Captured) -> None:
    text = ok(capsys, "protocol", "three-way", "--order", "lanes")
    cycle = "lane c       starves: arrive a1, arrive c2; then again and again commit a1,"
    sizes = "872, with 3259 transitions\n"
    for words in (sizes, "safe         yes", "live         yes", "a       never starves", cycle):
        assert words in text
    rules = ("--order", "lanes", "--priorities", "waiting")
    printed = answer(capsys, "protocol", "three-way", *rules)
    assert printed["all_states"] is True
    assert (printed["unsafe"], printed["stuck"]) == ([], None)
    assert printed["starving"] == {"a": None, "b": None, "c": None}


def test_protocol_writes_a_counterexample_that_collides(capsys: Captured, tmp_path: Path) -> None:
    file = tmp_path / "two.csv"
    assert main(["protocol", "three-way", "--commit", "paper", "--counterexample", str(file)]) == 1
    text = capsys.readouterr().out
    assert "safe         no: arrive b1, look, roll b1, arrive a2, look," in text
    assert f"wrote {file}" in text
    run = ("run", "three-way", "--arrivals", str(file), "-c")
    assert "touched" in fails(capsys, *run, "dim:commit=paper", "--horizon", "120", code=1)
    assert "collisions 0" in ok(capsys, *run, "dim", "--horizon", "120")


def test_arrivals_of_a_smaller_junction_are_refused(capsys: Captured, tmp_path: Path) -> None:
    """They fit, but a 3-arm manoeuvre 2 would be read as straight on."""
    table = tmp_path / "three.csv"
    rows = [f"{k},{'abc'[k % 3]},{k % 2 + 1}" for k in range(40)]
    table.write_text("\n".join(["demand_time_s,lane,manoeuvre", *rows, ""]))
    assert "junction with 3 arms" in fails(capsys, "run", "four-way", "--arrivals", str(table))
    table.write_text("\n".join(["demand_time_s,lane,manoeuvre", *rows[:3], ""]))
    assert main(["run", "four-way", "--arrivals", str(table), "--horizon", "60"]) == 0


FAULTY = """
from dataclasses import dataclass
from minisim.control import Plan

@dataclass(frozen=True)
class Faulty:
    name: str = "faulty"
    plan: Plan = Plan(period=1.0)

    def start(self, site):
        return self

    def decide(self, view):
        return [] if view.time < 3 else 1 / 0
"""


@pytest.mark.usefixtures("here")
def test_a_faulty_controller_is_one_line(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("mine_faulty.py").write_text(FAULTY)
    run = ("run", "four-way", "--horizon", "10", "-c", "mine_faulty:Faulty")
    told = "controller 'faulty' at 3.0 s: mine_faulty.py, line 14: ZeroDivisionError: division by"
    assert told in fails(capsys, *run)
    Path("e.toml").write_text('seeds = 1\nhorizon = 10\ncontroller = "mine_faulty:Faulty"\n')
    assert main(["sweep", "e.toml", "--jobs", "1"]) == 1
    said = capsys.readouterr().out
    assert "the first (faulty, four-way, 350 veh/h/lane, seed 1): " + told in said
    monkeypatch.setenv("MINISIM_TRACEBACK", "1")
    assert main(list(run)) == 2
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("command", [
    ["--version"], pytest.param(["sweep", "e.toml", "--jobs", "2"], marks=pytest.mark.slow),
])  # fmt: skip
def test_files_of_the_working_directory_hide_no_library(command: list[str], tmp_path: Path) -> None:
    """Neither for the command nor for its workers, except those that `python -m` itself loads."""
    (tmp_path / "modules.py").write_text("import sys; print(*sys.modules)")
    loaded = python("-m", "modules", cwd=tmp_path).stdout.split()
    assert "collections" in loaded
    here = filter(importlib.util.find_spec, sys.stdlib_module_names)
    for name in {*here, "dim", "numpy", "scenarios", "typer"}.difference(loaded):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not this one')")
    (tmp_path / "e.toml").write_text("horizon = 5\nseeds = 2\n")
    done = python("-m", "minisim", *command, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


#: Runs `minisim reproduce`, and presses Ctrl-C when a module is looked for.
PRESSING = """
import os, runpy, signal, sys

wanted = sys.argv.pop()

class Presses:
    def find_spec(self, name, *_):
        if name == wanted:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Presses())
runpy.run_module("minisim", run_name="__main__", alter_sys=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize("module", ["scenarios.cli", "typer", "figures.reproduction_report"])
def test_ctrl_c_while_python_imports_shows_no_traceback(module: str, tmp_path: Path) -> None:
    done = python("-c", PRESSING, "reproduce", module, cwd=tmp_path)
    assert done.returncode in (130, -signal.SIGINT)
    assert done.stderr in ("", "minisim: interrupted\n")


#: Runs minisim; a signal comes in a callback, whose exceptions Python drops.
DROPPING = """
import os, runpy, signal, sys, weakref

number = int(sys.argv.pop())

class Dropped:
    pass

class Presses:
    def find_spec(self, name, *_):
        if name == "minisim.simulation":
            it = Dropped()
            self.ref = weakref.ref(it, lambda _: os.kill(os.getpid(), number))
            del it

sys.meta_path.insert(0, Presses())
runpy.run_module("minisim", run_name="__main__", alter_sys=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize(
    ("number", "code", "told"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_no_signal_is_lost_in_a_callback(number: int, code: int, told: str, tmp_path: Path) -> None:
    """Python's import system has such a callback after every import."""
    run = "run", "four-way", "--horizon", "60", str(int(number))
    done = python("-c", DROPPING, *run, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", f"minisim: {told}\n")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="process groups are POSIX's")
@pytest.mark.parametrize("seconds", [0.5 * k for k in range(1, 13)])
def test_ctrl_c_shows_no_traceback_at_any_moment(seconds: float, tmp_path: Path) -> None:
    """Not even of a worker that has just been started."""
    command = [sys.executable, "-m", "minisim", "reproduce", "--only", "text", "--jobs", "2"]
    with subprocess.Popen(
        command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    ) as process:  # fmt: skip
        time.sleep(seconds)
        told = None
        while told is None:  # a library may swallow the first one
            os.killpg(process.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                _, told = process.communicate(timeout=20)
    assert process.returncode in (130, -signal.SIGINT)
    assert "Traceback" not in told
    assert "KeyboardInterrupt" not in told


def test_counts_says_what_it_understood_and_saves_a_demand(
    capsys: Captured, tmp_path: Path
) -> None:
    sheet, day = tmp_path / "sheet.csv", tmp_path / "day.toml"
    rows = [f"7:{k},{arm},{turn},{12 + k},3" for k in (15, 30) for arm in "NES" for turn in "LR"]
    sheet.write_text("\n".join(["time,approach,turn,car,bicycle", *rows, "7:15,N,U,2,0"]))
    text = ok(capsys, "counts", str(sheet), "--save", str(day))
    assert "sheet: 414 vehicles, 07:15-07:45, 2 intervals" in text
    assert "left out: 36 bicycle (bicycles are not simulated)" in text
    assert "left out: 2 U-turns" in text
    facts = answer(capsys, "counts", str(sheet))
    assert facts["arms"] == {"a": "N", "b": "E", "c": "S"}
    assert facts["movements"]["a1"] == 69
    run = answer(capsys, "run", "three-way", "--demand", str(day), "--no-safety")
    assert run["horizon_s"] == 1800.0
    assert abs(run["trips"] - 414) < 5 * 414**0.5
    assert "the junction has 4" in fails(capsys, "run", "four-way", "--demand", str(day))
    sheet.write_text(sheet.read_text().replace("7:15,N,L", "7:15,N,X"))
    assert "unknown turn 'X'" in fails(capsys, "counts", str(sheet))


def test_the_head_of_a_run_has_its_fleet_and_the_unit_of_its_inflow(capsys: Captured) -> None:
    run = "run four-way --fleet motorcycle:0.5,car:0.5 --no-safety --horizon 20 -d 175"
    assert ": 175 veh/h/lane, profile paper, fleet motorcycle:0.5,car:0.5, seed 0" in ok(
        capsys, *run.split()
    )
    # A motorcycle counts 0.75: 175 units are 200 vehicles.
    assert ": 200 veh/h/lane (175 pcu/h/lane), profile paper, fleet" in ok(
        capsys, *run.split(), "--unit", "pcu"
    )


@pytest.mark.parametrize("horizon", ["200", "330"])
def test_animate_shows_what_there_is_of_a_short_run(
    capsys: Captured, tmp_path: Path, horizon: str
) -> None:
    """The 60 s from 300 s on are only a default."""
    out = tmp_path / "x.json"
    ok(capsys, "animate", "four-way", "--horizon", horizon, "--seed", "1", "-o", str(out))
    made = json.loads(out.read_text())
    assert (made["start"], made["steps"] * made["step"]) in ((0.0, 60.0), (300.0, 30.0))
