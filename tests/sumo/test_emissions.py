"""Fuel and carbon dioxide against SUMO's own model, on the same speeds and accelerations."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

import minisim
from baselines import FixedTime
from minisim.results.driving import co2, fuel
from minisim.results.emissions import CLASSES, rate
from minisim.results.run import Run
from minisim.results.trips import Floats
from minisim.sumo.network import sumo_home
from scenarios import four_way


@pytest.fixture(scope="module")
def run() -> Run:
    scenario = four_way(300, profile="fair", horizon=400.0)
    return minisim.simulate(scenario, FixedTime(), 4, record="all")


def rates_of_sumo(folder: Path, emission_class: str, v: Floats, a: Floats) -> tuple[Floats, Floats]:
    """Fuel and CO₂ [mg/s] of each row, as `emissionsDrivingCycle` has them."""
    cycle = zip(range(len(v)), v.tolist(), a.tolist(), strict=True)
    (folder / "cycle.csv").write_text("".join(f"{t};{x!r};{y!r}\n" for t, x, y in cycle))
    tool = sumo_home() / "bin" / "emissionsDrivingCycle"
    subprocess.run(
        [tool, "-t", "cycle.csv", "-e", f"HBEFA3/{emission_class}", "-o", "out.csv", "-q",
         "--precision", "9"],
        check=True, cwd=folder,
    )  # fmt: skip
    lines = (folder / "out.csv").read_text().splitlines()
    table = np.array([line.split(";") for line in lines if line[:1].isdigit()], dtype=float)
    assert len(table) == len(v)
    return table[:, 9], table[:, 5]


def test_fifty_random_trips_burn_what_sumo_says(run: Run, tmp_path: Path) -> None:
    arrived = np.flatnonzero(run.columns.arrived)
    assert len(arrived) >= 50
    tracks, ours = run.tracks, (fuel(run), co2(run))
    theirs = rates_of_sumo(tmp_path, "PC_G_EU4", tracks.v, tracks.a)
    for trip in np.random.default_rng(0).choice(arrived, 50, replace=False).tolist():
        here = tracks.trip == trip
        for mine, rates in zip(ours, theirs, strict=True):
            assert mine[trip] == pytest.approx(rates[here].sum() * run.site.dt / 1000, rel=1e-4)


@pytest.mark.parametrize("name", CLASSES)
def test_every_class_at_random_speeds(name: str, tmp_path: Path) -> None:
    draw = np.random.default_rng(1)
    v, a = draw.uniform(0.0, 20.0, 2000), draw.uniform(-1.0, 3.0, 2000)
    theirs = rates_of_sumo(tmp_path, name, v, a)
    for what, rates in zip(("fuel", "co2"), theirs, strict=True):
        np.testing.assert_allclose(rate(v, a, getattr(CLASSES[name], what)), rates, rtol=1e-4)
