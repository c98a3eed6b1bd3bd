"""`minisim sweep`: results, resuming, interruptions, and what it refuses."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from scenarios.cli import main
from scenarios.studies import text
from scenarios.studies.shared.archive import find_in
from scenarios.studies.shared.effort import Effort
from scenarios.sweep import keys
from scenarios.sweep.store import Store
from tests import ROOT
from tests.builders import stored
from tests.unit.scenarios.cli.test_cli import Captured, fails, ok

SMALL = 'horizon = 60\nseeds = 2\ndensity = 300\ncontroller = ["dim", "fixed-time"]\n'


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "e.toml"
    path.write_text(SMALL)
    return path


def test_a_sweep_and_the_same_again(
    file: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, table = tmp_path / "s.db", tmp_path / "rows.csv"
    arguments = ["sweep", str(file), "--jobs", "1", "--out", str(store), "--export", str(table)]
    said = ok(capsys, *arguments)
    for name in ("dim", "fixed-time"):
        assert any(f" {name} " in line and "too short" in line for line in said.splitlines())
    assert "4 runs in" in said
    first = pd.read_csv(table)
    assert first["controller"].tolist() == ["dim", "dim", "fixed-time", "fixed-time"]
    assert first["seed"].tolist() == [1, 2, 1, 2]
    table.unlink()
    assert "another version" not in ok(capsys, *arguments)
    again = pd.read_csv(table)
    pd.testing.assert_frame_equal(first, again)  # processor times too: nothing was run
    monkeypatch.setattr(keys, "RESULTS", keys.RESULTS + 1)
    few = ["--seeds", "1", "--horizon", "30", "--export", str(tmp_path / "rows.parquet")]
    said = ok(capsys, *arguments[:-2], *few)
    assert f"  {store} also keeps 4 rows of another version of minisim" in said
    rows = pd.read_parquet(tmp_path / "rows.parquet")
    assert (rows["seed"].tolist(), rows["horizon_s"].tolist()) == ([1, 1], [30.0, 30.0])


def swept(folder: Path, capsys: Captured, text: str, code: int = 0) -> str:
    """What a sweep of these lines prints."""
    (folder / "e.toml").write_text(text)
    store = str(folder / "s.db")
    assert main(["sweep", str(folder / "e.toml"), "--jobs", "1", "--out", store]) == code
    return capsys.readouterr().out


def test_the_table_shows_what_tells_cells_apart(tmp_path: Path, capsys: Captured) -> None:
    asked = 'metrics = ["time_loss_s", "trips", "collisions", "max_braking_mps2"]\n'
    text = f'horizon = 60\nseeds = 2\nturns = ["uniform", "1:2:1"]\n{asked}'
    lines = swept(tmp_path, capsys, text).splitlines()
    head = next(line for line in lines if "veh/h/lane" in line)
    for word in ("turns", "time loss [s]", "p95", "trips", "hardest braking [m/s²]", "collisions"):
        assert head.count(word) == 1
    assert "waiting" not in head
    cells = [line.split() for line in lines if " dim " in line]
    assert [cell[3] for cell in cells] == ["uniform", "1:2:1"]


def test_failures_are_rows_and_exit_code_1(tmp_path: Path, capsys: Captured) -> None:
    text = 'horizon = 300\nseeds = 2\ncontroller = ["dim", "unregulated"]\n'
    out = swept(tmp_path, capsys, text, code=1)
    assert "2 of 4 runs failed; the first (unregulated, four-way, 350 veh/h/lane, seed 1)" in out
    assert "(+2 failed)" in out
    with Store(tmp_path / "s.db") as kept:
        assert len(kept) == 4


def test_a_capped_signal_is_told(tmp_path: Path, capsys: Captured) -> None:
    text = 'horizon = 30\nseeds = 1\nscenario = "five-way"\ncontroller = "fixed-time"\n'
    said = swept(tmp_path, capsys, text)
    assert "over Webster's capacity; the cycle is capped at 180 s" in said


def test_the_papers_grid(tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    """The study `text`: what `minisim reproduce` needs of it is then in the store."""
    points = tuple(point for point in text.STUDY.points if point.density == 300)
    some = replace(text.STUDY, points=points)
    monkeypatch.setattr(text, "STUDY", some)
    store = tmp_path / "s.db"
    few = ["--seeds", "2", "--horizon", "5", "--jobs", "1", "--out", str(store)]
    assert "28 runs in" in ok(capsys, "sweep", "paper", *few)
    with Store(store) as kept:
        assert len(kept) == 28
        assert set(kept.frame()["profile"]) == {"paper"}
        effort = Effort(seeds=2, horizon=5.0, densities=(300.0,))
        assert all(n.made for n in some.collect(effort, find_in(kept)).runs.values())


def test_results_do_not_go_over_the_experiments(file: Path, capsys: Captured) -> None:
    said = fails(capsys, "sweep", str(file), "--out", str(file))
    assert "FILE.toml and --out name the same file" in said
    assert file.read_text() == SMALL


def test_the_extra_is_named_where_it_is_missing(
    file: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)  # Python's own way to block an import
    store = tmp_path / "s.db"
    said = fails(capsys, "sweep", str(file), "--scheduler", "tcp://x:1", "--out", str(store))
    assert "pip install 'minisim-traffic[dask]'" in said
    assert not store.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_an_ended_sweep_keeps_its_runs_and_says_how_to_continue(
    number: signal.Signals, code: int, word: str, tmp_path: Path
) -> None:
    file, path = tmp_path / "e.toml", tmp_path / "s.db"
    file.write_text("horizon = 600\nseeds = 1000\n")
    process = subprocess.Popen(
        [sys.executable, "-m", "minisim", "sweep", file, "--out", path, "--jobs", "1"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while not stored(path):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(number)
    out, error = process.communicate(timeout=30)
    assert (process.returncode, out) == (code, "")
    with Store(path) as store:
        assert 0 < len(store) < 1000
        kept = f"minisim: {len(store)} of 1000 runs are in {path}"
    assert error.splitlines() == [
        f"{kept}; repeat the command to continue", f"minisim: {word}",
    ]  # fmt: skip
