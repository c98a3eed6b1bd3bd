"""Count sheets as cells: encodings, delimiters, numbers and times of day."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable
from statistics import median
from typing import Final, NamedTuple

from minisim.clock import seconds_of
from minisim.errors import FileError, InputError, show
from minisim.files import AnyPath, read_file

#: A date before a time.
DATE: Final = r"\b(\d{4}-\d{2}-\d{2}|\d{1,2}[./]\d{1,2}[./]\d{2,4})[ T]"


#: A header comes within so many lines that are not blank, after titles.
TITLES: Final = 20


class Sheet(NamedTuple):
    """The cells of a file: the names of its columns and the rows, each with its line number."""

    header: list[str]
    rows: list[tuple[int, list[str]]]  # perhaps with fewer cells than the header, or more
    decimal: str  # comma or point
    titles: list[str]  # the cells above the header that are not empty


def read_sheet(path: AnyPath, is_header: Callable[[list[str]], bool]) -> Sheet:
    """Read a table with a header: UTF-8, UTF-16 or Windows' letters; commas, semicolons or tabs.

    The header is the first of the first `TITLES` rows of which `is_header` is true, or else the
    first with the most names. Raises `FileError` for a file that is unreadable, empty or no table.
    """
    text = _decoded(read_file("counts", path), path)
    lines = [line for line in text.splitlines() if line.strip()] or [""]
    delimiter = max(";\t,|", key=lambda mark: median(line.count(mark) for line in lines))
    if not any(delimiter in line for line in lines):
        raise FileError(f"{path} is not a table: its lines have no comma, semicolon or tab")
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise FileError(f"cannot read counts from {path}: {error}") from error
    filled = [row for row in rows if any(row[1])]
    names = [len(list(filter(None, cells))) for _, cells in filled[:TITLES]]
    fullest = names.index(max(names))
    first = next((k for k in range(len(names)) if is_header(filled[k][1])), fullest)
    header = filled[first][1]
    if not filled[first + 1 :]:
        raise FileError(f"{path} has no counts, only a header")
    if again := [name for name in header if name and header.count(name) > 1]:
        raise FileError(f"{path}: there is more than one column {again[0]!r}")
    titles = [cell for _, cells in filled[:first] for cell in cells if cell]
    return Sheet(header, filled[first + 1 :], "." if delimiter == "," else ",", titles)


def _decoded(data: bytes, path: AnyPath) -> str:
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else (
        "utf-8-sig", "cp1252",
    ):  # fmt: skip
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" in text:
            break
        return text
    raise FileError(f"cannot read counts from {path}: it is not text")


def number_of(cell: str, where: str, decimal: str) -> float:
    """A count, 0 for an empty cell.

    Raises `FileError` for anything but a number ≥ 0, and for one such as 1.200 in a sheet that may
    have decimal commas: it could be 1200 or 1.2.
    """
    if decimal == "," and re.fullmatch(r"\d{1,3}(\.\d{3})+", cell):
        whole, part = cell.replace(".", ""), f"{float(cell[: cell.index('.') + 4]):g}"
        choice = f"write {whole} or {part.replace('.', decimal)}"
        raise FileError(f"{where}: {show(cell)} may mean {whole} or {part}; {choice}")
    try:
        value = float(cell.replace(decimal, ".") or 0) if cell not in ("-", "–") else 0.0
    except ValueError:
        value = -1.0
    if not 0.0 <= value < 1e6:
        raise FileError(f"{where}: a count must be a number 0 … 1e6, got {show(cell)}")
    return value


def interval_of(start: str, end: str | None, where: str) -> tuple[int, int | None, str]:
    """Start and end [s] of an interval such as "07:00" or "07:00-07:15", and its date.

    The end is None and the date empty if there is none. Raises `FileError` for no time of day.
    """
    day = re.search(DATE, start)
    start, end = _time(start), None if end is None else _time(end)
    span = re.split(r"\s*(?:-|–|to|bis)\s*", start) if end is None else [start, end]
    try:
        times = [seconds_of(_clock(part), "a time") for part in span]
    except InputError as error:
        raise FileError(f"{where}: {error}") from None
    return int(times[0]), int(times[1]) if len(times) > 1 else None, day[1] if day else ""


def _time(cell: str) -> str:
    """A time without its date: "2012-05-08 07:00" is 07:00."""
    return re.sub(DATE, "", cell)


def _clock(cell: str) -> str:
    """A time such as "7.00", "7h00" or "7:00 PM" as "7:00" and "19:00"."""
    cell = re.sub(r"\b([0-9]{1,2})[.h]([0-5][0-9])\b", r"\1:\2", cell)
    half = re.fullmatch(r"(\d{1,2}):(\d{2})(?::\d{2})? ?([AaPp])\.?[Mm]\.?", cell)
    if half:
        return f"{int(half[1]) % 12 + 12 * (half[3] in 'Pp')}:{half[2]}"
    return cell
