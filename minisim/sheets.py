"""Count sheets as cells: encodings, delimiters, and the words that name columns, turns, classes."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from minisim.clock import seconds_of
from minisim.errors import FileError, InputError, show
from minisim.files import AnyPath, read_file

#: What a column may mean -> its usual names, in plain letters (`plain`).
COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {
    "start": (
        "start", "intervallstart", "starttime", "begin", "beginn", "time", "timestart", "zeit",
        "uhrzeit", "interval", "intervall", "period", "timeperiod",
    ),
    "end": ("end", "intervallende", "endtime", "ende", "timeend"),
    "approach": ("approach", "zufahrt", "arm", "knotenarm", "leg", "from", "origin", "von"),
    "turn": ("turn", "turning", "movement", "kennung", "manoeuvre", "maneuver", "richtung"),
    "exit": ("exit", "to", "destination", "ausfahrt", "nach"),
    "class": ("class", "vehicleclass", "vehicle", "vehicletype", "klasse", "fahrzeugart", "mode"),
    "count": ("count", "vehicles", "anzahl", "volume", "number", "n", "menge", "flow"),
}  # fmt: skip

#: Types of vehicles (`minisim.fleet`) -> the words of sheets for them.
CLASSES: Final[Mapping[str, tuple[str, ...]]] = {
    "car": ("car", "cars", "pkw", "light", "lights", "passengercar", "lightvehicles", "taxi"),
    "motorcycle": (
        "motorcycle", "motorcycles", "krad", "kraftrad", "mc", "twowheeler", "2w", "motorbike",
    ),
    "auto-rickshaw": ("autorickshaw", "rickshaw", "threewheeler", "3w", "auto"),
    "lcv": ("lcv", "lfz", "lieferwagen", "lieferfahrzeug", "lgv", "van", "vans"),
    "truck": (
        "truck", "trucks", "lkw", "lz", "lastzug", "hgv", "hgvs", "heavy", "ogv1", "ogv2",
        "lkwa", "singleunit", "articulated",
    ),
    "bus": ("bus", "buses", "psv", "kom", "coach"),
    "bicycle": ("bicycle", "bicycles", "rad", "fahrrad", "bike", "bikes", "pc", "cycle", "cycles"),
    "pedestrian": ("pedestrian", "pedestrians", "peds", "fussganger", "fuss"),
    "total": ("total", "summe", "gesamt", "sum", "kfz", "all"),
}  # fmt: skip

#: Classes that are not simulated, and why.
LEFT_OUT: Final = {
    "bicycle": "bicycles are not simulated",
    "pedestrian": "pedestrians are not simulated",
    "total": "a sum, not a class",
}

#: Turns, from left to right, and back -> the words of sheets for them.
TURNS: Final[Mapping[str, tuple[str, ...]]] = {
    "left": ("left", "l", "lt", "links", "linksabbieger"),
    "through": ("through", "t", "th", "thru", "straight", "s", "g", "geradeaus", "gerade",
                "geradeausfahrer", "ahead"),
    "right": ("right", "r", "rt", "rechts", "rechtsabbieger"),
    "u-turn": ("uturn", "u", "w", "wender", "back"),
}  # fmt: skip

#: Points of the compass, clockwise from north.
COMPASS: Final = ("n", "ne", "e", "se", "s", "sw", "w", "nw")
_POINTS: Final = {
    "north": "n", "nord": "n", "east": "e", "ost": "e", "o": "e", "south": "s", "sud": "s",
    "west": "w", "northeast": "ne", "southeast": "se", "southwest": "sw", "northwest": "nw",
}  # fmt: skip


class Sheet(NamedTuple):
    """The cells of a file: the names of its columns and the rows, each with its line number."""

    header: list[str]
    rows: list[tuple[int, list[str]]]
    decimal: str  # comma or point


def read_sheet(path: AnyPath) -> Sheet:
    """Read a table with a header: UTF-8, UTF-16 or Windows' letters; commas, semicolons or tabs.

    Raises `FileError` for a file that is unreadable, empty or no table.
    """
    text = _decoded(read_file("counts", path), path)
    head = next((line for line in text.splitlines() if line.strip()), "")
    delimiter = max(";\t,|", key=head.count)
    if not head.count(delimiter):
        raise FileError(f"{path} is not a table: its first line has no comma, semicolon or tab")
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter, strict=True)
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader]
    except csv.Error as error:
        raise FileError(f"cannot read counts from {path}: {error}") from error
    (_, header), *filled = [row for row in rows if any(row[1])]
    for line, cells in filled:
        if len(cells) != len(header):
            raise FileError(
                f"{path}, line {line}: {len(header)} cells are needed, got {len(cells)}"
            )
    if not filled:
        raise FileError(f"{path} has no counts, only a header")
    if again := [name for name in header if name and header.count(name) > 1]:
        raise FileError(f"{path}: there is more than one column {again[0]!r}")
    return Sheet(header, filled, "." if delimiter == "," else ",")


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


def plain(name: str) -> str:
    """A name in small letters and digits, without accents: "Zufahrt " is zufahrt."""
    letters = unicodedata.normalize("NFKD", name.casefold())
    return re.sub(r"[^a-z0-9]", "", letters)


def word_of(text: str, words: Mapping[str, Sequence[str]]) -> str | None:
    """The key of `words` that has this text among its words."""
    known = plain(text)
    return next((key for key, said in words.items() if known == plain(key) or known in said), None)


def number_of(cell: str, where: str, decimal: str) -> float:
    """A count, 0 for an empty cell; raises `FileError` for anything but a number ≥ 0."""
    try:
        value = float(cell.replace(decimal, ".") or 0) if cell not in ("-", "–") else 0.0
    except ValueError:
        value = -1.0
    if not 0.0 <= value < 1e6:
        raise FileError(f"{where}: a count must be a number 0 … 1e6, got {show(cell)}")
    return value


def interval_of(start: str, end: str | None, where: str) -> tuple[int, int | None]:
    """Start and end [s] of an interval such as "07:00" or "07:00-07:15"; raises `FileError`."""
    span = re.split(r"\s*(?:-|–|to|bis)\s*", start) if end is None else [start, end]
    try:
        times = [seconds_of(_time(part), "a time") for part in span]
    except InputError as error:
        raise FileError(f"{where}: {error}") from None
    return int(times[0]), int(times[1]) if len(times) > 1 else None


def _time(cell: str) -> str:
    """A time without its date: "2012-05-08 07:00" is 07:00, and "7.00" too."""
    cell = re.sub(r"\b(\d{4}-\d{2}-\d{2}|\d{1,2}[./]\d{1,2}[./]\d{2,4})[ T]", "", cell)
    cell = re.sub(r"\b([0-9]{1,2})[.h]([0-5][0-9])\b", r"\1:\2", cell)
    half = re.fullmatch(r"(\d{1,2}):(\d{2})(?::\d{2})? ?([AaPp])\.?[Mm]\.?", cell)
    if half:
        return f"{int(half[1]) % 12 + 12 * (half[3] in 'Pp')}:{half[2]}"
    return cell


def compass(name: str) -> tuple[str, bool] | None:
    """The point of the compass that an arm's name means, and whether it is where traffic heads.

    "north" is the arm in the north; "NB" or "northbound" is traffic to the north, from the south.
    """
    known = plain(name)
    bound = re.fullmatch(r"(.+?)(?:bound|b)", known)
    for part, heads in ((known, False), (bound[1] if bound else "", True)):
        point = _POINTS.get(part, part)
        if point in COMPASS:
            return point, heads
    return None
