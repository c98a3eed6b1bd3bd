"""`minisim figures` and `minisim reproduce`: what they write, and what they refuse."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from figures import gallery
from figures import reproduction_report as report
from figures.gallery import GALLERY
from figures.tables import WRITERS
from scenarios.cli import main
from scenarios.cli.shared import terminal
from scenarios.studies import NAMES, capacity
from scenarios.studies.shared.archive import Archive, MissingRunsError, find_in
from scenarios.studies.shared.effort import Effort, Search
from scenarios.studies.shared.reproduction import reproduce
from scenarios.sweep.store import Store
from tests.unit.scenarios.cli.test_cli import Captured, fails, ok


def test_list_names_everything(capsys: Captured) -> None:
    assert {*GALLERY} <= {*ok(capsys, "figures", "--list").split()}


def test_what_needs_no_run_needs_no_store(tmp_path: Path) -> None:
    assert main(["figures", "webster", "harmony-3way", "--out", str(tmp_path / "new")]) == 0
    names = {f"{name}.{suffix}" for name in ("webster", "harmony-3way") for suffix in WRITERS}
    assert {file.name for file in (tmp_path / "new").iterdir()} == names


def test_without_a_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    few = {name: GALLERY[name] for name in ("webster", "gate", "fair")}
    monkeypatch.setattr(gallery, "GALLERY", few)
    assert main(["figures", "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("wrote 1 figure or table")
    assert captured.err == "  not 2 others, which need runs: name a store with --store\n"


def test_a_wrong_store_is_refused_before_a_folder_is_made(tmp_path: Path, capsys: Captured) -> None:
    notes, folder = tmp_path / "notes.txt", tmp_path / "out"
    notes.write_text("mine")
    said = fails(capsys, "reproduce", "--store", str(notes), "--out", str(folder))
    assert "is not a store of minisim" in said
    assert not folder.exists()
    assert "it is a file" in fails(capsys, "figures", "webster", "--out", str(notes))


def test_an_empty_store_says_what_makes_its_runs(tmp_path: Path, capsys: Captured) -> None:
    store = tmp_path / "runs.sqlite"
    Store(store).close()
    said = fails(capsys, "figures", "gate", "--store", str(store), "--out", str(tmp_path))
    assert "minisim reproduce --only gate --seeds 10" in said


TINY = Effort(
    seeds=2, horizon=100.0, densities=(350.0,),
    search=Search(step=400.0, steps=2, seeds=1, horizon=100.0),
)  # fmt: skip


@pytest.fixture
def small_search(monkeypatch: pytest.MonkeyPatch) -> None:
    few = replace(capacity.STUDY, points=capacity.STUDY.points[:2])
    monkeypatch.setattr(capacity, "STUDY", few)


@pytest.mark.usefixtures("small_search")
def test_reproduce_computes_what_is_missing(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    with Store(tmp_path / "runs.sqlite") as store:
        first, again = (
            [reproduce(name, TINY, store, 1, show) for name in ("fairness", "capacity")]
            for show in (lambda *counts: seen.append(counts), lambda *counts: None)
        )
        archive = Archive(find_in(store), TINY)
        assert all(n.made for n in archive.study("fairness").runs.values())
        assert len(capacity.capacities(archive.study("capacity"))) == 2
        with pytest.raises(MissingRunsError):
            archive.need("text")
    assert [(made.name, made.runs, made.computed) for made in first] == [
        ("fairness", 6, 6), ("capacity", 2, 2),
    ]  # fmt: skip
    assert [made.computed for made in again] == [0, 0]
    assert (seen[5], seen[-1]) == ((6, 6), (2, 2))
    assert [made.hours for made in first] == pytest.approx([600 / 3600, 200 / 3600])
    assert not any(made.failed for made in first)


def test_progress_without_a_terminal(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 5.0, 25.0, 30.0, 50.0])
    monkeypatch.setattr(terminal, "SILENCE", 20.0)
    monkeypatch.setattr(terminal.time, "monotonic", lambda: next(clock))
    with terminal.bar("simulating text") as progress:
        for done in (1, 2, 3):
            progress(done, 9)
        progress.label("still")
        progress(4, 9)
    assert capsys.readouterr().err == "simulating text: 2 of 9\nstill: 4 of 9\n"


@pytest.mark.usefixtures("small_search")
def test_reproduce_says_what_each_study_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(Effort, "of", lambda **_: TINY)
    monkeypatch.setattr(report, "write_report", lambda *_, parts: len(parts))
    only = ("--only", "fairness", "--only", "capacity")
    assert main(["reproduce", "--jobs", "1", "--out", str(tmp_path), *only]) == 0
    captured = capsys.readouterr()
    took = captured.err.splitlines()
    assert [line.rpartition(" in ")[0] for line in took] == [
        "fairness: 6 of 6 runs computed", "capacity: 2 of 2 runs computed",
    ]  # fmt: skip
    assert "wrote 2 figures and tables" in captured.out


@pytest.mark.parametrize("command", ["reproduce", "sweep"])
def test_help_names_every_study(command: str, capsys: Captured) -> None:
    words = re.findall(r"[\w-]+", ok(capsys, command, "--help"))
    assert {*NAMES} - {"capacity"} <= {*words}


@pytest.mark.slow
def test_reproduce_quick_from_nothing(tmp_path: Path) -> None:
    """The same code path as the full run; every figure, and a report that links them."""
    assert main(["reproduce", "--quick", "--jobs", "2", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "A smoke test" in text
    assert "## Failed runs\n\nNone." in text
    assert {*GALLERY} <= {file.stem for file in (tmp_path / "figures").iterdir()}
    store, again = str(tmp_path / "runs.sqlite"), str(tmp_path / "again")
    assert main(["figures", "gate", "--quick", "--store", store, "--out", again]) == 0
    for suffix in ("png", "pdf", "svg"):
        one, two = (tmp_path / folder / f"gate.{suffix}" for folder in ("figures", "again"))
        assert one.read_bytes() == two.read_bytes()
