"""Recorded arrival tables as CSV: reading, counting from a time of day, and writing."""

from __future__ import annotations

import csv
import io
import math
import re

import numpy as np

from minisim.arrivals import LEAST_FACTOR, MOST_FACTOR, Arrivals
from minisim.clock import clock, seconds_of
from minisim.errors import FileError, InputError, choice, instance, integer, number, show
from minisim.files import AnyPath, read_file, write_text
from minisim.inflow import MAX_TIME
from minisim.junction.movements import ARM_NAMES

COLUMNS = ("demand_time_s", "lane", "manoeuvre")
#: Optional: the drivers' factors on the speed limit, and the names of the vehicles' types.
FACTORS, TYPES = "speed_factor", "type"
#: So many arrivals use the last lane or the last manoeuvre: with equal shares on 4 arms, the chance
#: that none does is (1/2)^30, one in 10^9.
ENOUGH = 30


def read_arrivals(path: AnyPath, n: int | None = None, start: float | str = 0.0) -> Arrivals:
    """Read an arrival table from a CSV file: `COLUMNS`, lanes by letter, perhaps `FACTORS`
    and `TYPES`.

    Args:
        path: the file.
        n: number of arms; None allows as many as there are letters.
        start: where the run begins in the recorded time, in seconds or as a time of day such as
            "07:00". Vehicles that come earlier are left out.

    Raises:
        InputError: a start that is not a time, or is later than every vehicle; or `ENOUGH`
            arrivals that look like those of a junction with fewer than n arms.
        FileError: unreadable, a column that is missing or unknown, a broken line (named by its
            number), or a lane or manoeuvre that does not exist with n arms.
    """
    arms = len(ARM_NAMES) if n is None else integer("number of arms", n, low=3, high=len(ARM_NAMES))
    begin = seconds_of(start)
    header, *lines = _lines(path)
    columns = _header(*header)
    rows = [_row(where, columns, cells, arms) for where, cells in lines]
    table = dict(zip(columns, zip(*rows, strict=True), strict=True)) if rows else {}
    time, lane, manoeuvre = (np.array(table.get(column, ()), float) for column in COLUMNS)
    factors = np.array(table.get(FACTORS, ()), float) if FACTORS in columns else None
    types = np.array(table.get(TYPES, ()), str) if TYPES in columns else None
    arrivals = Arrivals(time, lane, manoeuvre, factors, types)
    if begin and len(time) and time.max() < begin:
        last = f"the last vehicle comes at {clock(time.max())}"
        raise InputError(f"{path}: no vehicle comes from {show(start)} on; {last}")
    used = 1 + int(max(arrivals.lane.max(initial=0), arrivals.manoeuvre.max(initial=0)))
    if n is not None and len(time) >= ENOUGH and used < n:  # manoeuvres would mean other exits
        raise InputError(
            f"{path} looks like arrivals of a junction with {used} arms: none comes from lane "
            f"{ARM_NAMES[n - 1]} or takes manoeuvre {n - 1}; the scenario has {n} arms"
        )
    return arrivals.between(begin, math.inf) if begin else arrivals


def write_arrivals(arrivals: Arrivals, path: AnyPath) -> None:
    """Write an arrival table in the form that `read_arrivals` reads; raises `FileError`."""
    instance("arrivals", arrivals, Arrivals)
    arrivals.check(len(ARM_NAMES))
    lanes = [ARM_NAMES[lane] for lane in arrivals.lane]
    columns = dict(zip(COLUMNS, (arrivals.time.tolist(), lanes, arrivals.manoeuvre), strict=True))
    if arrivals.speed_factor is not None:
        columns[FACTORS] = arrivals.speed_factor.tolist()
    if arrivals.type is not None:
        columns[TYPES] = arrivals.type.tolist()
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    write_text(path, text.getvalue())


def _lines(path: AnyPath) -> list[tuple[str, list[str]]]:
    """The cells of each line that is not blank, and where it is."""
    data = read_file("arrivals", path)
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""))
        lines = [(f"{path}, line {reader.line_num}", [c.strip() for c in row]) for row in reader]
    except (UnicodeDecodeError, csv.Error) as error:
        why = str(error)
        if isinstance(error, UnicodeDecodeError):
            utf16 = " (it looks like UTF-16)" * (data[:2] in (b"\xff\xfe", b"\xfe\xff"))
            why = f"it is not UTF-8 text{utf16}, byte {error.start}"
        raise FileError(f"cannot read arrivals from {path}: {why}") from error
    filled = [line for line in lines if any(line[1])]
    if not filled:
        raise FileError(f"{path} is empty; it needs the columns {', '.join(COLUMNS)}")
    return filled


def _header(where: str, header: list[str]) -> list[str]:
    """The names of the columns; raises `FileError` for a missing, repeated or unknown one."""
    if len(header) == 1 and (mark := re.search("[;\t|]", header[0])):
        raise FileError(f"{where}: separate columns by commas, not by {mark[0]!r}")
    for column in header:
        try:
            choice("column", column, (*COLUMNS, FACTORS, TYPES))
        except InputError as error:
            raise FileError(f"{where}: {error}") from None
        if header.count(column) > 1:
            raise FileError(f"{where}: there is more than one column {column}")
    if missing := [column for column in COLUMNS if column not in header]:
        raise FileError(f"{where}: column {', '.join(missing)} missing")
    return header


def _row(where: str, columns: list[str], cells: list[str], arms: int) -> list[float | str]:
    if len(cells) != len(columns):
        point = "; write decimals with a point" * (len(cells) > len(columns))
        wanted = f"{len(columns)} values, {', '.join(columns)}"
        raise FileError(f"{where}: expected {wanted}, got {len(cells)}{point}")
    return [_value(where, *pair, arms) for pair in zip(columns, cells, strict=True)]


def _value(where: str, column: str, cell: str, arms: int) -> float | str:
    """What a cell stands for: a lane's index, a manoeuvre, seconds, a factor or a type's name."""
    if column == TYPES:
        if not cell:
            raise FileError(f"{where}: the type is missing")
        return cell
    if column == "lane":
        lanes = list(ARM_NAMES[:arms])
        if cell not in lanes:
            raise FileError(f"{where}: lane must be one of {', '.join(lanes)}, got {show(cell)}")
        return lanes.index(cell)
    ranges = {FACTORS: (LEAST_FACTOR, MOST_FACTOR), "manoeuvre": (1, arms - 1)}
    low, high = ranges.get(column, (0.0, MAX_TIME))
    try:
        value = int(cell) if column == "manoeuvre" else float(cell)
        return number(column, value, low=low, high=high)
    except ValueError:
        point = "; write decimals with a point" * ("," in cell)
        wanted = f"a number {low:g} … {high:g}"
        raise FileError(f"{where}: {column} must be {wanted}, got {show(cell)}{point}") from None
