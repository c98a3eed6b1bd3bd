"""The store: what it keeps, what it refuses, and what a full disk does to it."""

from __future__ import annotations

import json
import sqlite3
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dim import Dim
from minisim.control import Plan, Site
from minisim.errors import FileError, InputError
from scenarios import four_way, three_way
from scenarios.recipe import Recipe
from scenarios.sweep import keys, sweep
from scenarios.sweep.keys import key_of
from scenarios.sweep.rows import Outcome, failed, outcome_of
from scenarios.sweep.store import APPLICATION, SCHEMA, Store
from tests.builders import Fixed, ScriptedSession, python
from tests.unit.scenarios.cli.test_cli import Captured, fails


def recipe_of(seed: int = 1) -> Recipe:
    return Recipe(three_way(200, horizon=60), Dim(), seed)


@pytest.fixture(scope="module")
def outcome() -> Outcome:
    return outcome_of(recipe_of())


def test_a_row_comes_back_as_it_was(tmp_path: Path, outcome: Outcome) -> None:
    with Store(tmp_path / "s.db") as store:
        store.put(recipe_of(), outcome)
    with Store(tmp_path / "s.db", create=False) as store:
        assert store.valid([key_of(recipe_of())]) == {key_of(recipe_of()): outcome.row}
        assert store.valid([key_of(recipe_of(2))]) == {}
        pd.testing.assert_frame_equal(store.frame(), pd.DataFrame([outcome.row]))
    assert [file.name for file in tmp_path.iterdir()] == ["s.db"], "one file"


def test_the_file_tells_how_to_run_it_again(tmp_path: Path, outcome: Outcome) -> None:
    with Store(tmp_path / "s.db") as store:
        store.put(recipe_of(), outcome)
        ((description, provenance),) = store._select("experiment, provenance", "")
    recipe = json.loads(description)
    assert recipe["scenario"]["demand"]["density"] == 200.0
    assert recipe["controller"]["class"] == "dim.controller.Dim"
    assert recipe["controller"]["zones"]["red"] == 30.0
    assert set(json.loads(provenance)) >= {"minisim", "python", "numpy"}


def test_only_what_is_missing_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran: list[int] = []

    def watched(wanted: Recipe) -> Outcome:
        if wanted.scenario.horizon > 1:  # not the one that compiles
            ran.append(wanted.seed)
        return outcome_of(wanted)

    monkeypatch.setattr("scenarios.sweep.runner.outcome_of", watched)
    with Store(tmp_path / "s.db") as store:
        first = sweep([recipe_of(2), recipe_of(1)], jobs=1, store=store)
        again = sweep([recipe_of(2), recipe_of(1)], jobs=1, store=store)
        pd.testing.assert_frame_equal(first, again)
        assert ran == [2, 1]
        assert store.frame()["seed"].tolist() == [1, 2], "by what was run"
        store.put(recipe_of(2), failed(recipe_of(2), MemoryError()))
        sweep([recipe_of(1), recipe_of(2), recipe_of(3)], jobs=1, store=store)
        assert ran == [2, 1, 2, 3], "what failed, and what is new"
        monkeypatch.setattr(keys, "RESULTS", keys.RESULTS + 1)
        sweep([recipe_of(1)], jobs=1, store=store)
        assert ran == [2, 1, 2, 3, 1], "what another version computed"
        assert len(store) == 3
        assert store.frame()["seed"].tolist() == [1]
        assert "also keeps 2 rows of another version of minisim, not used" in store.outdated


def run_sql(path: Path, script: str) -> None:
    database = sqlite3.connect(path)
    database.executescript(script)
    database.close()


def made(path: Path, script: str) -> None:
    """An empty store that another program has changed."""
    Store(path).close()
    run_sql(path, script)


def spoilt(path: Path, change: Callable[[bytes], bytes]) -> None:
    """A store of 40 rows whose bytes are changed."""
    result = outcome_of(recipe_of())
    with Store(path) as store:
        for seed in range(40):
            store.put(recipe_of(seed), result)
    path.write_bytes(change(path.read_bytes()))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            lambda path: made(path, f"PRAGMA user_version = {SCHEMA + 1}"),
            "has layout 2, this version of minisim reads layout 1",
        ),
        (lambda path: run_sql(path, "CREATE TABLE mine (x)"), "is not a store of minisim"),
        (lambda path: path.write_text("controller,seed\ndim,1\n"), "is not a store of minisim"),
        (
            lambda path: made(path, "DROP TABLE runs; CREATE TABLE runs (key, row)"),
            "is not a store of minisim",
        ),
        (lambda path: spoilt(path, lambda data: data[:60]), "is not a store of minisim"),
        (lambda path: spoilt(path, lambda data: data[:-20_000]), "malformed|damaged"),
        (
            lambda path: spoilt(path, lambda data: data[:4096] + b"x" * 8192 + data[12288:]),
            "malformed|damaged",
        ),
    ],
    ids=["newer", "foreign", "text", "other columns", "beheaded", "truncated", "scribbled"],
)
def test_a_bad_store_is_told_and_left_alone(
    spoil: Callable[[Path], object], message: str, tmp_path: Path, capsys: Captured
) -> None:
    path, file = tmp_path / "s.db", tmp_path / "e.toml"
    spoil(path)
    file.write_text("seeds = 1\nhorizon = 10\n")
    before = path.read_bytes()
    with pytest.raises(FileError, match=message):
        Store(path)
    fails(capsys, "sweep", str(file), "--out", str(path))
    assert path.read_bytes() == before
    assert sorted(f.name for f in tmp_path.iterdir()) == ["e.toml", "s.db"]


@pytest.mark.parametrize("name", ["", "missing/s.db", "nul\0l.db"])
def test_a_place_for_no_store(name: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot open store"):
        Store(f"{tmp_path}/{name}")
    with pytest.raises(FileError, match="there is no store"):
        Store(tmp_path / "s.db", create=False)
    assert not list(tmp_path.iterdir())


def test_an_empty_file_becomes_a_store(tmp_path: Path) -> None:
    """What is left of a store whose maker was killed in its first moment."""
    path = tmp_path / "s.db"
    path.touch()
    with Store(path) as store:
        assert len(store) == 0
    assert int.from_bytes(path.read_bytes()[68:72], "big") == APPLICATION


@pytest.mark.parametrize("text", ["{", "[1,2]", "{}", "null"])
def test_a_broken_row_is_told(text: str, tmp_path: Path, outcome: Outcome) -> None:
    with Store(tmp_path / "s.db") as store:
        store.put(recipe_of(), outcome)
        store._database.execute("UPDATE runs SET row = ?", (text,))
        with pytest.raises(FileError, match="damaged"):
            store.frame()
        with pytest.raises(FileError, match="damaged"):
            sweep([recipe_of()], jobs=1, store=store)


def test_what_has_no_description_cannot_be_stored(tmp_path: Path) -> None:
    class Odd(Dim):
        pass

    odd = Odd()
    object.__setattr__(odd, "period", object())
    with Store(tmp_path / "s.db") as store, pytest.raises(InputError, match="cannot be stored"):
        sweep([replace(recipe_of(), controller=odd)], jobs=1, store=store)


class Plain:
    """A controller that is no dataclass."""

    name = "plain"
    version: Any = 1

    def __init__(self, sight: float = 30.0) -> None:
        self.sight = sight

    def start(self, site: Site) -> Any:
        return ScriptedSession(Plan(sight=self.sight, lanes_open=True), lambda view: ())


def test_a_plain_class_with_a_version_is_known_by_it_and_its_attributes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def recipe(sight: float = 30.0) -> Recipe:
        return Recipe(four_way(50, horizon=5), Plain(sight), on_collision="record")

    with Store(tmp_path / "s.db") as store:
        rows = sweep([recipe(), recipe(31.0), recipe()], jobs=1, store=store)
        assert rows["error"].isna().all()
        assert len(store) == 2
    first = key_of(recipe())
    monkeypatch.setattr(Plain, "version", 2)
    keys._code.cache_clear()
    assert key_of(recipe()) != first
    monkeypatch.setattr(Plain, "version", None)
    with pytest.raises(InputError, match=r"Plain is not a dataclass.*or give it a `version`"):
        key_of(recipe())


def test_writers_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, outcome: Outcome) -> None:
    monkeypatch.setattr("scenarios.sweep.store.PATIENCE", 0.2)
    with Store(tmp_path / "s.db") as ours, Store(tmp_path / "s.db") as theirs:
        ours.put(recipe_of(1), outcome)
        theirs.put(recipe_of(2), outcome)
        theirs.put(recipe_of(1), outcome)  # what both computed is one row
        assert len(ours) == len(theirs) == 2
        theirs._database.execute("BEGIN IMMEDIATE")
        with pytest.raises(FileError, match=r"cannot write store .* locked; what was stored"):
            ours.put(recipe_of(3), outcome)
        theirs._database.execute("ROLLBACK")
        ours.put(recipe_of(3), outcome)
        assert len(ours) == 3


def test_a_store_in_use_is_told_soon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("scenarios.sweep.store.OPENING", 0.1)
    with Store(tmp_path / "s.db") as theirs:
        theirs._database.executescript("PRAGMA locking_mode = EXCLUSIVE; BEGIN EXCLUSIVE")
        began = time.monotonic()
        with pytest.raises(FileError, match=r"cannot open store .* locked"):
            Store(tmp_path / "s.db")
        assert time.monotonic() - began < 5.0


FULL_DISK = """
import resource, sys
from dim import Dim
from minisim.errors import FileError
from scenarios import three_way
from scenarios.recipe import Recipe
from scenarios.sweep.store import Store
from scenarios.sweep import sweep
from minisim.simulation import simulate

simulate(three_way(200, horizon=1), Dim())  # compile, and write what that writes, before the limit
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    with Store(sys.argv[1]) as store:
        todo = [Recipe(three_way(200, horizon=20), Dim(), seed) for seed in range(60)]
        sweep(todo, jobs=1, store=store)
except FileError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of file sizes are POSIX's")
@pytest.mark.parametrize("limit", [100, 40_000, 150_000])
def test_a_full_disk_is_told_and_what_was_stored_stays(tmp_path: Path, limit: int) -> None:
    path = tmp_path / "s.db"
    done = python("-c", FULL_DISK, str(path), str(limit))
    assert "cannot" in done.stdout
    assert str(path) in done.stdout
    assert done.stderr == ""
    with Store(path) as store:  # there is room again
        kept = len(store)
        assert kept == len(store.frame())
        assert int(limit == 150_000) <= kept < 60
        todo = [Recipe(three_way(200, horizon=20), Dim(), seed) for seed in range(5)]
        assert sweep(todo, jobs=1, store=store)["error"].isna().all()
        assert len(store) == max(kept, 5)


def test_every_part_of_a_recipe_is_in_its_key() -> None:
    base = recipe_of()
    plain = base.scenario
    scenarios = [
        four_way(200, horizon=60),
        three_way(200, horizon=60, profile="fair"),
        three_way(200, horizon=60, turns=(1, 2)),
        three_way(200, horizon=60, split=(2, 1, 1)),
        *(replace(plain, recorded=plain.arrivals(seed)) for seed in (1, 2)),
    ]
    changes: list[dict[str, Any]] = [
        {}, {"seed": 2}, {"label": "x"}, {"on_collision": "record"}, {"metrics": ("pets",)},
        {"humans": 0.1}, {"controller": Dim(gate="harmonious")},
        *({"scenario": other} for other in scenarios),
    ]  # fmt: skip
    assert len({key_of(replace(base, **change)) for change in changes}) == len(changes)


def test_a_class_that_a_function_makes_has_no_key_of_its_own() -> None:
    def local(k: int) -> Any:
        @dataclass(frozen=True)
        class Local(Fixed):
            def start(self, site: Site) -> Any:
                return ScriptedSession(Plan(period=float(k)), lambda view: ())

        return Local

    with pytest.raises(InputError, match=r"local.<locals>.Local cannot be stored: a function make"):
        key_of(Recipe(four_way(), local(1)()))
    kinds = local(1), local(2)
    for k, kind in enumerate(kinds):
        kind.version = k
    assert len({key_of(Recipe(four_way(), kind())) for kind in kinds}) == 2
