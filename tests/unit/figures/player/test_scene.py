"""Scenes: they hold what the run holds."""

from __future__ import annotations

import dataclasses
import json
import random
import time
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import minisim
from baselines import FixedTime
from dim import Dim, Mixed
from figures import read_scene, scene, write_scene
from figures.film.frames import Frames
from figures.player import vlq
from figures.player.scene import KEYS, dumped
from minisim.control import HALTING, Unregulated
from minisim.errors import FileError, InputError
from minisim.results.queues import QUEUE_END
from minisim.results.run import Run
from scenarios import four_way
from scenarios.profiles import FAIR
from tests.builders import replayed

START, SECONDS = 60.0, 30.0


@pytest.fixture(scope="module")
def run() -> Run:
    return minisim.simulate(
        four_way(350, horizon=100.0), Mixed(Dim(), 0.2), seed=1, record="all", explain=True
    )


@pytest.fixture(scope="module")
def made(run: Run) -> dict[str, Any]:
    return scene(run, start=START, seconds=SECONDS)


def positions(text: str) -> np.ndarray:
    first, *rest = vlq.decoded(text)
    return np.array([*accumulate([first, *accumulate(rest)])]) / 100.0


def test_a_scene_is_json_and_has_its_keys(made: dict[str, Any]) -> None:
    assert json.loads(dumped(made)) == made
    assert tuple(made) == KEYS


def test_positions_and_states_are_those_of_the_run(run: Run, made: dict[str, Any]) -> None:
    rows = {(row.vehicle, round(row.time_s / 0.1)): row for row in run.trajectories.itertuples()}
    seen = 0
    for track in made["tracks"]:
        exit_s = made["ways"][track["way"]]["exit"] + made["types"][track["type"]]["length"]
        states = dict(zip(track["states"][::2], track["states"][1::2], strict=True))
        state, queued = None, False
        for k, s in enumerate(positions(track["s"]), start=track["from"]):
            row = rows[track["id"], 600 + k]
            state = states.get(k, state)
            assert abs(row.s_m - s) <= 0.00501
            later = rows.get((track["id"], 601 + k), row)  # a row has what held before it
            goes = bool(later.right_of_way) and row.s_m <= exit_s + 1e-3
            queued = row.speed_mps <= (QUEUE_END if queued else HALTING)
            assert state == 2 * goes + queued
            seen += 1
    assert seen > 2000
    human = {track["id"] for track in made["tracks"] if track.get("human")}
    assert human == {t["id"] for t in made["tracks"] if run.kinds[t["id"]] == "human"} != set()


def test_every_vehicle_in_the_picture_is_in_the_scene(run: Run, made: dict[str, Any]) -> None:
    frame = run.trajectories
    reach = made["ground"]["reach"]
    shown = frame[(frame.time_s > START - 0.05) & (frame.time_s < START + SECONDS + 0.05)]
    shown = shown[np.maximum(shown.x_m.abs(), shown.y_m.abs()) <= reach]
    there = {
        (track["id"], k)
        for track in made["tracks"]
        for k in range(track["from"], track["from"] + len(positions(track["s"])))
    }
    wanted = set(zip(shown.vehicle, (shown.time_s / 0.1).round().astype(int) - 600, strict=True))
    assert len(wanted) > 1000
    assert wanted <= there


def test_reasons_are_those_of_the_run(run: Run, made: dict[str, Any]) -> None:
    draw = random.Random(1)
    for _ in range(400):
        track = draw.choice(made["tracks"])
        step = draw.randrange(track["from"], track["from"] + len(positions(track["s"])))
        at = START + 0.1 * step
        if at >= run.columns.arrival[track["id"]]:
            continue
        wanted = run.why(track["id"], at)
        told = [it for it in made["reasons"][str(track["id"])] if it[0] <= step]
        assert told[-1][1:] == [wanted.kind, wanted.sentence, list(wanted.vehicles)], at


@pytest.mark.parametrize("controller", [Dim(), FixedTime()])
def test_served_is_what_the_film_says(controller: Any) -> None:
    run = minisim.simulate(four_way(300, horizon=90.0), controller, record="all", explain=True)
    made, film = scene(run, start=50.0, seconds=40.0), Frames(run, 50.0)
    cleared = sorted(track["clear"] for track in made["tracks"] if "clear" in track)
    for step in range(0, 401, 10):
        assert sum(it <= step for it in cleared) == film.served(50.0 + 0.1 * step)
    for step in (0, 123, 400):
        heads = {lane: state for when, lane, state in made["heads"] if when <= step}
        assert heads == film.heads(50.0 + 0.1 * step)


def test_a_collision_is_marked_on_both_vehicles() -> None:
    crash = replayed(four_way(), (0.0, 0, 2), (0.0, 1, 2), horizon=60.0)
    run = minisim.simulate(crash, Unregulated(), record="all", on_collision="record")
    made = scene(run, start=20.0, seconds=35.0)
    ((step, *vehicles),) = made["collisions"]
    assert vehicles == [0, 1]
    assert {track["id"]: track["harmed"] for track in made["tracks"]} == {0: step, 1: step}
    assert made["demand"] == "2 recorded arrivals"


def test_what_was_not_recorded_is_run_again(made: dict[str, Any]) -> None:
    bare = minisim.simulate(four_way(350, horizon=100.0), Mixed(Dim(), 0.2), seed=1)
    assert scene(bare, start=START, seconds=SECONDS) == made
    quick = scene(bare, start=START, seconds=SECONDS, reasons=False)
    assert quick["reasons"] is None
    assert quick["tracks"] == made["tracks"]


def test_a_run_with_small_steps_is_thinned() -> None:
    profile = dataclasses.replace(FAIR, dt=0.02)
    run = minisim.simulate(four_way(400, profile=profile, horizon=60.0), Dim(), record="all")
    made = scene(run, start=50.0, seconds=5.0)
    assert (made["step"], made["steps"]) == (0.1, 50)
    rows = run.trajectories.set_index(["vehicle", "time_s"]).s_m
    track = made["tracks"][0]
    for k, s in enumerate(positions(track["s"]), start=track["from"]):
        assert abs(rows[track["id"], round(50.0 + 0.1 * k, 6)] - s) <= 0.00501


def test_an_empty_road_is_a_scene_too() -> None:
    run = minisim.simulate(four_way(0, horizon=20.0), Dim())
    assert scene(run, seconds=10.0)["tracks"] == []


@pytest.mark.parametrize(
    ("seconds", "most"),
    [(60.0, 150_000), pytest.param(600.0, 1_200_000, marks=pytest.mark.slow)],
)
@pytest.mark.parametrize("controller", [Dim(), FixedTime()])
def test_a_scene_is_small_and_quick(controller: Any, seconds: float, most: int) -> None:
    """Four arms at 350 vehicles per hour and lane, with reasons."""
    what = four_way(350, horizon=60.0 + seconds)
    run = minisim.simulate(what, controller, record="all", explain=True)
    begin = time.process_time()
    text = dumped(scene(run, start=60.0, seconds=seconds))
    assert time.process_time() - begin < 1.0
    assert len(text) < most


@pytest.mark.parametrize(
    ("start", "seconds", "said"),
    [(-1.0, 5.0, "start"), (0.0, 0.0, "seconds"), (90.0, 20.0, "but the run ended at 100 s")],
)
def test_times_that_a_run_does_not_have(run: Run, start: float, seconds: float, said: str) -> None:
    with pytest.raises(InputError, match=said):
        scene(run, start=start, seconds=seconds)


def test_a_scene_on_disk(made: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    write_scene(made, file)
    assert read_scene(file) == made
    for text, said in (
        ("[1]", "is not a scene of minisim"), ("{", "it is not JSON"), ("\xff", "not a scene"),
        (json.dumps(made | {"version": 9}), "of version 9; this minisim reads 1"),
        (json.dumps({"format": "minisim scene", "version": 1}), "a scene without title, cont"),
    ):  # fmt: skip
        file.write_text(text, encoding="latin-1")
        with pytest.raises(FileError, match=said):
            read_scene(file)
    with pytest.raises(FileError, match="cannot read scene from"):
        read_scene(tmp_path / "none.json")
