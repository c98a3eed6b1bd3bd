"""`minisim crossval` with the real SUMO, on short runs."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
from PIL import Image

from minisim.results.metrics import MEANS
from scenarios.cli import main
from tests.unit.scenarios.cli.test_cli import Captured


def crossval(folder: Path, *arguments: str) -> tuple[int, pd.DataFrame, str]:
    """Exit code, table and report."""
    code = main(["crossval", *arguments, "--jobs", "1", "--out", str(folder)])
    report = (folder / "crossval.md").read_text(encoding="utf-8")
    return code, pd.read_csv(folder / "crossval.csv"), report


def test_both_hosts_agree_in_a_short_run(capsys: Captured, tmp_path: Path) -> None:
    arguments = ("-d", "250", "--seeds", "2", "--horizon", "200")
    code, table, report = crossval(tmp_path / "new" / "out", *arguments)
    printed = capsys.readouterr().out
    assert code == 0
    assert printed.startswith("2 of 2 cells: both hosts agree within the tolerances\n")
    assert len(table) == 2 * 5 * len(MEANS), "two controllers, four lanes and all"
    assert table["error"].isna().all()
    assert (table["seeds"] == 2).all()
    travel = table[(table["metric"] == "travel_time_s") & (table["lane"] == "all")]
    assert (travel["ks"] < 0.2).all()
    assert travel["minisim"].between(70, 130).all()
    links = re.findall(r"\]\((.*?)\)", report)
    assert len(links) >= 2
    for link in links:
        with Image.open(tmp_path / "new" / "out" / link) as figure:
            assert min(figure.size) > 400
        assert (tmp_path / "new" / "out" / link).with_suffix(".svg").is_file()
    assert "minisim crossval --density 250 --seeds 2 --horizon 200" in report
    assert not [p for p in (tmp_path / "new" / "out").iterdir() if p.name.startswith(".")]


def test_hosts_agree_on_a_fleet(tmp_path: Path) -> None:
    arguments = ("-c", "dim", "-d", "200", "--seeds", "1", "--horizon", "120")
    code, table, report = crossval(tmp_path, *arguments, "--fleet", "car:0.8,truck:0.2")
    assert code == 0
    assert set(table["fleet"]) == {"car:0.8,truck:0.2"}
    assert table["error"].isna().all()
    assert "--fleet car:0.8,truck:0.2" in report


def test_the_same_law_gives_the_same_trips(tmp_path: Path) -> None:
    """The first three minutes of a published run, by minisim's engine and by SUMO's CC model."""
    arguments = ("--replay", "four-way", "-d", "150", "--split", "balanced", "--horizon", "180")
    code, table, report = crossval(tmp_path, *arguments)
    assert code == 0
    overall = table[table["lane"] == "all"].set_index("metric")
    assert overall.loc["travel_time_s", "trips_minisim"] > 10
    assert overall.loc["travel_time_s", "within"] >= 0.9
    assert overall["published"].isna().all(), "the published means are of an hour"
    assert "| four-way balanced 150 dim | 1 |" in report


def test_a_collision_is_a_row_and_exit_1(capsys: Captured, tmp_path: Path) -> None:
    arguments = ("-c", "unregulated", "-d", "350", "--seeds", "1", "--horizon", "240")
    code, table, report = crossval(tmp_path, *arguments)
    assert code == 1
    assert table["error"].str.contains("touched").all()
    assert table["host"].tolist() == ["minisim", "sumo"]
    assert "## Runs that failed" in report
    assert "2 runs failed" in capsys.readouterr().out
