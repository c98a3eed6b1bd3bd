"""Writers: what is written reads back, and a failure leaves no trace."""

from __future__ import annotations

import importlib.util
import os
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import minisim
from baselines import FixedTime
from minisim.errors import FileError, InputError, MissingExtraError
from minisim.results import trajectories as recording
from minisim.results.run import Run
from minisim.results.summary import TRIP_COLUMNS
from minisim.results.trajectories import (
    TRAJECTORY_COLUMNS,
    write_fcd,
    write_trajectories,
    write_trips,
)
from minisim.testing import small_scenario


@pytest.fixture(scope="module")
def run() -> Run:
    scenario = small_scenario(4, density=300, demand_time=90.0)
    return minisim.simulate(scenario, FixedTime(), seed=1, record="all")


def frame_of(*rows: tuple[float, int, str, int, float]) -> pd.DataFrame:
    """A trajectory frame from (time, vehicle, lane, manoeuvre, s)."""
    frame = pd.DataFrame(rows, columns=["time_s", "vehicle", "lane", "manoeuvre", "s_m"])
    for column in TRAJECTORY_COLUMNS[5:10]:
        frame[column] = 0.0
    return frame.assign(right_of_way=True)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".CSV"])
def test_trajectories_read_back(run: Run, tmp_path: Path, suffix: str) -> None:
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"trajectories{suffix}"
    write_trajectories(run.trajectories, path)
    read = pd.read_parquet(path) if suffix == ".parquet" else pd.read_csv(path)
    assert tuple(read.columns) == TRAJECTORY_COLUMNS
    read, written = (frame.astype({"lane": object}) for frame in (read, run.trajectories))
    pd.testing.assert_frame_equal(read, written, check_dtype=False, rtol=0, atol=1e-6)
    assert os.listdir(tmp_path) == [path.name]


def test_trips_read_back_with_empty_cells_for_what_has_not_ended(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "trips.csv"
    write_trips(run.trips, path)
    read = pd.read_csv(path)
    assert tuple(read.columns) == TRIP_COLUMNS
    pd.testing.assert_frame_equal(read, run.trips, check_dtype=False, rtol=0, atol=1e-6)
    assert run.trips["arrival_s"].isna().any()
    assert "nan" not in path.read_text(encoding="utf-8").lower()


def test_parquet_needs_pyarrow(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'minisim-traffic\[parquet\]'"):
        write_trips(run.trips, tmp_path / "trips.parquet")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("write", [write_trips, write_trajectories])
def test_a_frame_without_the_columns_is_an_error(tmp_path: Path, write: Any) -> None:
    for frame, message in ((5, "DataFrame"), (pd.DataFrame(), "no column (time_s|vehicle)")):
        with pytest.raises(InputError, match=message):
            write(frame, tmp_path / "out.csv")


def test_fcd_follows_sumos_schema_and_says_what_the_frame_says(run: Run, tmp_path: Path) -> None:
    """Element and attribute names and kinds of SUMO's fcd_file.xsd."""
    path = tmp_path / "fcd.xml"
    write_fcd(run.trajectories, path, run.site)
    root = ET.parse(path).getroot()
    assert root.tag == "fcd-export"
    assert {(step.tag, *step.attrib) for step in root} == {("timestep", "time")}
    vehicles = [vehicle for step in root for vehicle in step]
    assert {" ".join((vehicle.tag, *vehicle.attrib)) for vehicle in vehicles} == {
        "vehicle id x y angle type speed pos lane slope"
    }
    times = [float(step.attrib["time"]) for step in root for _ in step]
    columns = ([float(v.attrib[k]) for v in vehicles] for k in ("id", "x", "y", "speed"))
    frame = run.trajectories[["time_s", "vehicle", "x_m", "y_m", "speed_mps"]]
    rows = np.array([times, *columns]).T
    np.testing.assert_allclose(rows, frame.to_numpy(), rtol=0, atol=0.005 + 1e-9)
    for vehicle in vehicles:
        assert float(vehicle.attrib["pos"]) >= 0.0
        assert 0.0 <= float(vehicle.attrib["angle"]) < 360.0


def test_fcd_positions_are_measured_from_the_start_of_the_lane(run: Run, tmp_path: Path) -> None:
    path = run.site.intersection.paths[0]  # a1: from a to b
    places = (5.0, path.entry - 0.01, path.entry + 0.01, path.exit - 0.01, path.exit + 3.0)
    frame = frame_of(*((float(i), 7, "a", 1, s) for i, s in enumerate(places)))
    write_fcd(frame, tmp_path / "fcd.xml", run.site)
    read = [v.attrib for step in ET.parse(tmp_path / "fcd.xml").getroot() for v in step]
    assert [v["lane"] for v in read] == ["a_in_0", "a_in_0", ":C_a1_0", ":C_a1_0", "b_out_0"]
    arc = path.exit - path.entry
    expected = [5.0, path.entry - 0.01, 0.01, arc - 0.01, 3.0]
    assert [float(v["pos"]) for v in read] == pytest.approx(expected, abs=0.006)


def test_fcd_rounds_angles_and_positions_as_sumo_does(run: Run, tmp_path: Path) -> None:
    frame = frame_of((0.0, 1, "a", 1, 5.0)).assign(angle_deg=359.999, x_m=-0.001)
    write_fcd(frame, tmp_path / "fcd.xml", run.site)
    text = (tmp_path / "fcd.xml").read_text(encoding="utf-8")
    assert 'x="0.00" y="0.00" angle="0.00"' in text


def test_fcd_of_nothing_is_an_empty_export(run: Run, tmp_path: Path) -> None:
    write_fcd(run.trajectories.iloc[:0], tmp_path / "fcd.xml", run.site)
    assert len(ET.parse(tmp_path / "fcd.xml").getroot()) == 0


@pytest.mark.parametrize(
    ("lane", "manoeuvre", "message"),
    [("e", 1, "lane e"), (None, 1, "lane"), ("a", 4, "manoeuvre 4"), ("a", 0, "manoeuvre 0")],
)
def test_a_movement_that_the_site_does_not_have_is_an_error(
    run: Run, tmp_path: Path, lane: str, manoeuvre: int, message: str
) -> None:
    frame = frame_of((0.0, 1, "a", 1, 5.0), (0.0, 2, lane, manoeuvre, 5.0))
    with pytest.raises(InputError, match=message):
        write_fcd(frame, tmp_path / "fcd.xml", run.site)
    assert os.listdir(tmp_path) == []


def test_the_old_file_stays(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "fcd.xml"
    path.write_text("old", encoding="utf-8")

    def fail(*_: object) -> Any:
        yield "    <timestep"
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recording, "_fcd_lines", fail)
    with pytest.raises(FileError, match="No space left"):
        write_fcd(run.trajectories, path, run.site)
    assert path.read_text(encoding="utf-8") == "old"
    assert os.listdir(tmp_path) == ["fcd.xml"]
