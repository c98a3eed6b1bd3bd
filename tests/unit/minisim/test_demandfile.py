"""Demand by time of day as a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from minisim.demandfile import read_demand, write_demand
from minisim.errors import FileError, InputError
from minisim.vehicle import VehicleType

DAY = """
[[period]]
start = "07:00"
end = "07:15"
rates = [120, 340, 96, 280]
turns = ["1:2:1", "uniform", [0, 1, 1], "1:0:0"]

[[period]]
start = 26100
end = "09:00"
rates = [60, 170, 48, 140.5]
"""


def saved(folder: Path, text: str = DAY) -> Path:
    path = folder / "day.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_says_what_its_example_says(tmp_path: Path) -> None:
    demand = read_demand(saved(tmp_path), start="07:10")
    assert demand.name == "day"
    assert (demand.start, demand.duration) == (25_800, 6600.0)
    first, second = demand.periods
    assert first.turns == ((1, 2, 1), None, (0, 1, 1), (1, 0, 0))
    assert second.rates == (60, 170, 48, 140.5)
    assert second.turns is None
    write_demand(demand, tmp_path / "again.toml")
    assert read_demand(tmp_path / "again.toml") == demand


@pytest.mark.parametrize(
    "given", ["[fleet]\ncar = 0.9\nbus = [0.1, 0.1, 0.1, 0.1]", 'fleet = "car:0.9,bus:0.1"']
)
def test_a_file_brings_its_fleet(tmp_path: Path, given: str) -> None:
    demand = read_demand(saved(tmp_path, f"{given}\n{DAY}"))
    assert demand.fleet is not None
    assert demand.fleet.names == ("car", "bus")
    assert demand.fleet.of_lane(3) == (0.9, 0.1)
    write_demand(demand, tmp_path / "again.toml")
    assert read_demand(tmp_path / "again.toml") == demand


def test_vehicle_types_of_ones_own_are_not_written(tmp_path: Path) -> None:
    mine = replace(read_demand(saved(tmp_path)), fleet=VehicleType(name="car", length=5.0))
    with pytest.raises(InputError, match="only the ready vehicle types, not your own 'car'"):
        write_demand(mine, tmp_path / "mine.toml")
    assert not (tmp_path / "mine.toml").exists()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("rates = [120", "rate = [120", r"day.toml: period 1: .* 'rate'.*did you mean 'rates'"),
        ("[120, 340", '["120", 340', r"period 1: rates \[veh/h\]\[0\] must be a number, got '120'"),
        ("start = 26100", "start = 26000", "day.toml: the period 07:00-07:15 overlaps the next"),
        ("start = 26100", 'start = "07:30"', "the period 07:00-07:15 leaves a hole before"),
        ("start = 26100", 'start = "25"', "overlaps"),
        ('"07:15"', '"seven"', "period 1: end must be a time of day such as 07:00 or seconds"),
        ("\n[[period]]", "rates = [1]\n[[period]]", "unknown key 'rates'; it belongs to a period"),
        ("[[period]]", "[period]", "(not valid TOML|periods are written)"),
        ("[[period]]", "[[periods]]", "day.toml: unknown key 'periods'.*did you mean 'period'"),
        ("\n[[period]]", 'model = "gamma"\n[[period]]', "unknown arrival model 'gamma'"),
        (
            "\n[[period]]",
            "density = 3\n[[period]]",
            "unknown key 'density'; allowed: period, model",
        ),
        (DAY, "", r"periods are written \[\[period\]\]"),
        (DAY, "]", "not valid TOML"),
        (
            DAY,
            f"[fleet]\ncra = 1\n{DAY}",
            "unknown vehicle type 'cra'.*did you mean 'car'",
        ),
        (
            DAY,
            f"[fleet]\ncar = 0.4\n{DAY}",
            r"toml: shares must sum to 1, got 0.4 \(car",
        ),
        (DAY, f"[fleet]\ncar = [1, 1, 1]\n{DAY}", "has shares for 3 lanes, the junction has 4"),
    ],
)
def test_a_file_that_is_wrong_is_refused_with_the_place(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(FileError, match=message):
        read_demand(saved(tmp_path, DAY.replace(old, new, 1)))


def test_a_start_outside_the_demand_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="start is 09:00, but the demand is from 07:00 to 09:00"):
        read_demand(saved(tmp_path), start="09:00")
    with pytest.raises(FileError, match=r"cannot read demand from .*none\.toml"):
        read_demand(tmp_path / "none.toml")
