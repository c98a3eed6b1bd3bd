"""minisim's floating-car data and SUMO's of the same run, in one of SUMO's own tools."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd

from dim import Dim
from minisim.results.trajectories import write_fcd
from minisim.sumo import network, simulate
from scenarios import four_way


def as_table(file: Path) -> pd.DataFrame:
    """What SUMO's `xml2csv.py` makes of the file."""
    tool = network.sumo_home() / "tools" / "xml" / "xml2csv.py"
    table = file.with_suffix(".csv")
    subprocess.run(
        [sys.executable, str(tool), "-s", ",", "-o", str(table), str(file)],
        check=True, capture_output=True,
    )  # fmt: skip
    return pd.read_csv(table).dropna(subset=["vehicle_id"])


def test_both_load_in_sumos_tool_and_say_the_same(tmp_path: Path) -> None:
    ours, sumos = tmp_path / "ours.xml", tmp_path / "sumos.xml"
    scenario = four_way(300, profile="fair", horizon=90.0)
    run = simulate(scenario, Dim(), seed=1, record="all", fcd=sumos)
    write_fcd(run.trajectories, ours, run.site)
    mine, its = as_table(ours), as_table(sumos)
    columns = ["timestep_time", "vehicle_id", "vehicle_lane", "vehicle_type"]
    columns += [f"vehicle_{name}" for name in ("x", "y", "angle", "speed", "pos", "slope")]
    assert set(columns) <= set(mine) & set(its)
    key = ["timestep_time", "vehicle_id"]
    merged = mine.merge(its, on=key, suffixes=("", "_sumo"))
    assert len(merged) == len(mine) > 1000
    assert len(its) - len(mine) <= len(run.trips)  # a vehicle more in the very last step
    for name, tolerance in (("x", 0.02), ("y", 0.02), ("speed", 0.006), ("pos", 0.02)):
        apart = (merged[f"vehicle_{name}"] - merged[f"vehicle_{name}_sumo"]).abs()
        assert apart.max() <= tolerance, name
    outside = ~merged["vehicle_lane"].str.startswith(":")
    assert (merged["vehicle_lane"] == merged["vehicle_lane_sumo"])[outside].mean() > 0.999
    # SUMO gives a vehicle that is told a speed a type of its own: car@7
    types = merged["vehicle_type_sumo"].str.partition("@")[0]
    assert (merged["vehicle_type"] == types).all()
