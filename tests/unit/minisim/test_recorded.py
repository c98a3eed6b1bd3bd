"""Recorded arrival tables as files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from minisim.arrivals import Arrivals
from minisim.demand import Demand
from minisim.errors import FileError, InputError
from minisim.recorded import read_arrivals, write_arrivals

GOOD = "demand_time_s,lane,manoeuvre\n0.01,c,2\n2.01,a,1\n"


@pytest.fixture
def csv_file(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "arrivals.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,  # as spreadsheets save it
        "manoeuvre,lane,demand_time_s\n2,c,0.01\n1,a,2.01\n",
        GOOD.replace("0.01,c,2", " 0.01 , c , 2 "),
        "\n" + GOOD.replace("\n", "\n \n,,\n\n"),
    ],
    ids=["plain", "windows", "byte-order mark", "order of columns", "blanks", "blank lines"],
)
def test_harmless_variants_are_read_alike(csv_file: Callable[[str], Path], text: str) -> None:
    arrivals = read_arrivals(csv_file(text), n=4)
    assert arrivals.time.tolist() == [0.01, 2.01]
    assert arrivals.lane.tolist() == [2, 0]
    assert arrivals.manoeuvre.tolist() == [2, 1]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("x,a,1", "demand_time_s must be a number 0 … 1e.07, got 'x'"),
        ("-1,a,1", "demand_time_s"),
        ("1e999,a,1", "demand_time_s"),
        ("1e300,a,1", r"demand_time_s must be a number 0 … 1e\+07"),
        (",a,1", "demand_time_s"),
        ("3,e,1", "lane must be one of a, b, c, d, got 'e'"),
        ("3,ab,1", "lane"),
        ("3,0,1", "lane"),
        ("3,a,0", "manoeuvre must be a number 1 … 3, got '0'"),
        ("3,a,4", "manoeuvre"),
        ("3,a,1.0", "manoeuvre"),
        ("3,a,", "manoeuvre"),
        ("3,a," + "9" * 5000, "manoeuvre"),
        ("3,a", "expected 3 values"),
        ("3", "expected 3 values"),
        ("3,a,1,5", "expected 3 values"),
        ('"3,a,1', "expected 3 values"),
        ("0,5,a,1", "; write decimals with a point$"),
        ('"0,5",a,1', "; write decimals with a point$"),
    ],
)
def test_a_broken_line_is_named(csv_file: Callable[[str], Path], line: str, message: str) -> None:
    path = csv_file(GOOD + line + "\n")
    with pytest.raises(FileError, match=message) as caught:
        read_arrivals(path, n=4)
    assert f"{path}, line 4: " in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"arrivals.csv is empty; it needs the columns demand_time_s, lane, manoeuvre$"),
        ("\n \n", "is empty"),
        ("demand_time_s,manoeuvre\n1,2\n", "line 1: column lane missing$"),
        ("demand_time_s,lane,lane,manoeuvre\n", "line 1: there is more than one column lane$"),
        (GOOD.replace(",", ";"), "line 1: separate columns by commas, not by ';'$"),
        (GOOD.replace(",", "\t"), r"line 1: separate columns by commas, not by '\\t'$"),
        (GOOD.replace("manoeuvre", "manoeuver"),
         "line 1: unknown column 'manoeuver'; allowed: .*; did you mean 'manoeuvre'"),
        ("demand_time_s,lane,manoeuvre,note\n1,a,1,x\n", "unknown column 'note'; allowed: "),
        ("0,a,1\n2,b,1\n", "line 1: unknown column '0'"),
    ],
)  # fmt: skip
def test_odd_headers_are_refused(csv_file: Callable[[str], Path], text: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_arrivals(csv_file(text))


def test_utf16_is_named(tmp_path: Path) -> None:
    path = tmp_path / "unicode.csv"
    path.write_text(GOOD, encoding="utf-16")
    with pytest.raises(FileError, match=r"it is not UTF-8 text \(it looks like UTF-16\)"):
        read_arrivals(path)


def test_a_table_may_have_speed_factors(csv_file: Callable[[str], Path]) -> None:
    columns = "demand_time_s,lane,manoeuvre,speed_factor\n"
    path = csv_file(columns + "2,b,1,0.9\n1,a,2,1.1\n")
    table = read_arrivals(path)
    write_arrivals(table, path)
    for factors in (table.speed_factor, read_arrivals(path).speed_factor):
        assert factors is not None
        assert factors.tolist() == [1.1, 0.9]  # in order of demand
    assert table.between(2.0, 3.0).speed_factor == [0.9]
    with pytest.raises(FileError, match=r"line 2: speed_factor must be a number 0.2 … 2, got '3'"):
        read_arrivals(csv_file(columns + "2,b,1,3\n"))
    with pytest.raises(InputError, match=r"speed_factor must be 0.2 … 2"):
        Arrivals(np.zeros(1), np.zeros(1, int), np.ones(1, int), np.array([0.1]))


MORNING = "demand_time_s,lane,manoeuvre\n25100,c,2\n25205.5,a,2\n25207,b,1\n28000,c,3\n"


@pytest.mark.parametrize("start", ["07:00", "7:00", "07:00:00", 25200, 25200.0, "25200"])
def test_a_run_begins_at_a_time_of_day(csv_file: Callable[[str], Path], start: float | str) -> None:
    arrivals = read_arrivals(csv_file(MORNING), 4, start)
    assert arrivals.time.tolist() == [5.5, 7.0, 2800.0]
    assert arrivals.lane.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("7 am", "start must be a time of day such as 07:00 or seconds, got '7 am'"),
        ("07:60", "start must be a time of day"),
        ("nan", r"start \[s\] must be"),
        (-1.0, r"start \[s\] must be at least 0"),
        (None, r"start \[s\] must be a number"),
        ("08:00", r"no vehicle comes from '08:00' on; the last .* at 28000 s \(07:46:40\)"),
    ],
)
def test_a_start_is_checked(csv_file: Callable[[str], Path], start: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_arrivals(csv_file(MORNING), 4, start)  # type: ignore[arg-type]  # wrong on purpose


def test_unreadable_files_are_reported(tmp_path: Path) -> None:
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"demand_time_s,lane,manoeuvre\n\xff\xfe,a,1\n")
    for path in (tmp_path / "none.csv", tmp_path, binary, "a\0b"):
        with pytest.raises(FileError, match="cannot read arrivals from"):
            read_arrivals(path)
    with pytest.raises(FileError, match=r"arrivals from \S*none.csv: No such file or directory$"):
        read_arrivals(tmp_path / "none.csv")
    wrong: Any = 3
    with pytest.raises(InputError, match="arrivals file must be"):
        read_arrivals(wrong)
    with pytest.raises(InputError, match="number of arms"):
        read_arrivals(binary, "x")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="arrivals must be"):
        write_arrivals(wrong, binary)


def test_unwritable_files_are_reported(tmp_path: Path) -> None:
    arrivals = Demand(density=350.0).draw(4, 60.0, seed=1)
    for path in (tmp_path / "none" / "x.csv", tmp_path, "a\0b"):
        with pytest.raises(FileError, match="cannot write "):
            write_arrivals(arrivals, path)


def test_a_table_without_letters_for_its_lanes_is_not_half_written(tmp_path: Path) -> None:
    path = tmp_path / "arrivals.csv"
    table = Arrivals(np.array([0.0, 1.0]), np.array([0, 12]), np.array([1, 1]))
    with pytest.raises(InputError, match="lane 12"):
        write_arrivals(table, path)
    assert not path.exists()
