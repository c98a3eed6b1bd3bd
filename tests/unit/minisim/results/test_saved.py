"""Runs on disk: what is saved comes back, and what is damaged is one sentence."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import math
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import minisim
from dim import Dim, Mixed, NoisyPerception
from minisim.arrivals import Arrivals
from minisim.control import Session, Site, Unregulated
from minisim.errors import FileError, InputError, MinisimError, MissingExtraError
from minisim.results.run import Run
from minisim.results.saved import _signed, made, written
from scenarios import four_way
from scenarios.strategies import scenarios


@pytest.fixture(scope="module")
def run() -> Run:
    scenario = four_way(250, profile="fair", horizon=120.0)
    return minisim.simulate(scenario, Mixed(Dim(), 0.4), 3, record="junction")


@pytest.fixture
def file(run: Run, tmp_path: Path) -> Path:
    path = tmp_path / "run.zip"
    run.save(path)
    return path


def check_same(ours: Run, theirs: Run) -> None:
    pd.testing.assert_frame_equal(theirs.trips, ours.trips, check_exact=True)
    metrics = []
    if ours.record is not None:
        pd.testing.assert_frame_equal(theirs.trajectories, ours.trajectories, check_exact=True)
        metrics = ["min_ttc_s", "max_braking_mps2"]
    assert theirs.summary(metrics, ["movement"]) == ours.summary(metrics, ["movement"])
    for name in ("provenance", "collisions", "counts", "kinds", "record", "seed", "site", "plan"):
        assert getattr(theirs, name) == getattr(ours, name)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=15)
@given(
    scenario=scenarios(),
    controller=st.sampled_from([
        Dim(gate="harmonious"), Mixed(share=0.5), Unregulated(),
        Dim(perception=NoisyPerception(0.2)),
    ]),
    seed=st.integers(0, 2**63),
    record=st.sampled_from([None, "junction", "all"]),
)  # fmt: skip
def test_what_is_saved_comes_back(
    scenario: Any, controller: Any, seed: int, record: str | None, tmp_path: Path
) -> None:
    recorded = Arrivals(np.array([6.0, 13.0]), np.array([0, 2]), np.array([1, 1]))
    scenario = dataclasses.replace(
        scenario, horizon=30.0, warmup=5.0, recorded=recorded if seed % 4 == 0 else None
    )
    run = minisim.simulate(scenario, controller, seed, record=record, on_collision="record")
    run.save(tmp_path / "run")
    loaded = Run.load(tmp_path / "run")
    check_same(run, loaded)
    assert loaded.controller == controller
    assert repr(loaded.scenario) == repr(scenario)
    check_same(run, minisim.simulate(
        loaded.scenario, loaded.controller, seed, record=record, on_collision="record"
    ))  # fmt: skip


@dataclass(frozen=True)
class Others:
    """A controller of others' making."""

    name: str = "others"

    def start(self, site: Site) -> Session:
        return Unregulated().start(site)


@dataclass(frozen=True, kw_only=True)
class OthersScenario(type(four_way())):  # type: ignore[misc]
    """A scenario of others' making."""


def test_what_is_not_ours_comes_back_as_a_stand_in(tmp_path: Path) -> None:
    plain = four_way(50, horizon=30.0)
    fields = {field.name: getattr(plain, field.name) for field in dataclasses.fields(plain)}
    run = minisim.simulate(OthersScenario(**fields), Others(), on_collision="record")
    run.save(tmp_path / "run")
    loaded = Run.load(tmp_path / "run")
    check_same(run, loaded)
    assert repr(loaded.controller) == "Others(name='others')"
    with pytest.raises(InputError, match="'others' was saved as a text and cannot be run again: O"):
        minisim.simulate(plain, loaded.controller)
    with pytest.raises(InputError, match="'four-way' was saved as a text and cannot be run again"):
        minisim.simulate(loaded.scenario, Dim())


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_file_is_one_sentence(file: Path, data: st.DataObject) -> None:
    whole = file.read_bytes()
    at = data.draw(st.integers(0, len(whole) - 1))
    broken = data.draw(st.sampled_from([
        whole[:at], whole[:at] + bytes([whole[at] ^ 0x5A]) + whole[at + 1 :],
    ]))  # fmt: skip
    path = file.with_name("broken.zip")
    path.write_bytes(broken)
    place = re.escape(str(path))
    with pytest.raises(FileError, match=rf"^{place} is (damaged|not a saved)[^\n]*$"):
        Run.load(path)


def rewritten(file: Path, *, digested: bool = True, **changes: Any) -> Path:
    """The file with other entries in its JSON, and perhaps a digest of them."""
    with zipfile.ZipFile(file) as old:
        entries = {name: old.read(name) for name in old.namelist()}
    entries["run.json"] = json.dumps({**json.loads(entries["run.json"]), **changes}).encode()
    with zipfile.ZipFile(file, "w") as new:
        for name, content in entries.items():
            new.writestr(name, content)
        new.comment = bytes(64)
    if digested:
        file.write_bytes(_signed(file.read_bytes()))
    return file


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"layout": 1}, "has layout 1, this version of minisim reads layout 4"),
        ({"mark": "cake"}, "is not a saved run of minisim"),
        ({"controller": {"class": "os:system", "fields": {}}}, "'os:system' is not a class"),
        ({"controller": {"class": "dim.controller:np", "fields": {}}}, "by this .*is not a class"),
        ({"controller": {"class": "dim.nothing:Dim", "fields": {}}}, "is damaged"),
        ({"controller": {"class": "minisim.errors:show", "fields": {}}}, "is not a class"),
        ({"controller": {"class": "dim.controller:Dim", "fields": {}}}, "Dim has other fields"),
        ({"scenario": {"tuple": 5}}, "is not a value of a run"),
    ],
)
def test_foreign_content(file: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(FileError, match=message):
        Run.load(rewritten(file, **changes))


@pytest.mark.parametrize("name", ["seed", "site"])
def test_a_field_that_was_changed(file: Path, name: str) -> None:
    with pytest.raises(FileError, match=r"run\.zip is damaged: it is not what was saved$"):
        Run.load(rewritten(file, digested=False, **{name: None}))


def test_bytes_that_were_added(file: Path) -> None:
    whole = file.read_bytes()
    for broken in (whole + b"x", whole + whole):
        file.write_bytes(broken)
        with pytest.raises(FileError, match=r"run\.zip is damaged"):
            Run.load(file)


def test_files_that_are_none(tmp_path: Path) -> None:
    text, zipped = tmp_path / "a.txt", tmp_path / "b.zip"
    text.write_text("hello")
    with zipfile.ZipFile(zipped, "w") as file:
        file.writestr("other", "x")
    for path in (text, zipped):
        with pytest.raises(FileError, match="is not a saved run of minisim"):
            Run.load(path)
    for path in (tmp_path / "missing", tmp_path):
        with pytest.raises(FileError, match="cannot read"):
            Run.load(path)


def test_a_run_is_saved_whole(run: Run, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = file.read_bytes()

    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("minisim.results.saved._parquet", fail)
    with pytest.raises(FileError, match="No space left"):
        run.save(file)
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_without_pyarrow(run: Run, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for action in (lambda: run.save(file), lambda: Run.load(file)):
        with pytest.raises(MissingExtraError, match=r"minisim-traffic\[parquet\]"):
            action()


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.lists(inner).map(tuple) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@settings(max_examples=50)
@given(value=values)
def test_values_come_back(value: Any) -> None:
    back = made(json.loads(json.dumps(written(value), allow_nan=False)))
    assert repr(back) == repr(value)


def test_what_cannot_be_written_or_made() -> None:
    for odd in (object(), len, 1j, Others(), {1: object()}):
        with pytest.raises(InputError, match="cannot be saved"):
            written(odd)
    for odd in ({"float": "1"}, {"a": 1}, [{}], {"class": "dim.controller:Dim"}):
        with pytest.raises(MinisimError, match="not a value of a run"):
            made(odd)
    assert math.isnan(made(written(math.nan)))
