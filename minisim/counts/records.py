"""The counts of a sheet one by one: which columns hold what, and what each cell counts."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from minisim.counts.mapping import check_used
from minisim.counts.sheets import Sheet, interval_of, number_of, read_sheet
from minisim.counts.words import (
    CLASSES,
    COLUMNS,
    TURNS,
    compass,
    is_total,
    near_word,
    plain,
    word_of,
)
from minisim.errors import FileError, InputError, choice
from minisim.files import AnyPath


class Record(NamedTuple):
    """How many vehicles of a class took one way in one interval."""

    where: str  # file and line
    start: int  # of the interval, time of day [s]
    end: int | None  # of the interval, time of day [s]; None if the sheet does not say
    approach: str
    turn: str  # its word or a manoeuvre's number; empty if there is an exit
    exit: str
    kind: str  # class of the sheet
    vehicles: float


class _Layout(NamedTuple):
    """Which columns hold what; indices of columns."""

    columns: dict[str, int]  # key of `COLUMNS` -> column
    streams: dict[int, tuple[str, str, str]]  # column of a movement -> approach, turn, exit
    kinds: dict[int, str]  # column of a class -> its name


def records_of(path: AnyPath, given: Mapping[str, Any], notes: list[str]) -> Iterator[Record]:
    """Every count of a sheet; `given` is a mapping, and what is assumed goes into `notes`.

    Once all are read, a mapping of words that none of them has is refused. Raises `FileError` and
    `InputError` as `minisim.counts.read_counts`.
    """
    sheet = read_sheet(path, partial(_is_header, given))
    columns, streams, kinds = layout = _layout(sheet, given, f"{path}", notes)
    names = {"classes": set(kinds.values()), "turns": set[str]()}
    noticed: dict[str, list[int]] = defaultdict(list)  # what -> lines
    seen: set[tuple[object, ...]] = set()
    days: set[str] = set()
    for line, cells in sheet.rows:
        where = f"{path}, line {line}"
        said = {key: cells[k] for key, k in columns.items() if k < len(cells)}
        if any(is_total(said.get(key, "")) for key in ("start", "approach", "turn", "exit")):
            noticed["rows of totals or shares, left out"].append(line)
            continue
        if len(cells) != len(sheet.header):
            raise FileError(f"{where}: {len(sheet.header)} cells are needed, got {len(cells)}")
        start, end, day = interval_of(said["start"], said.get("end"), where)
        if len(days := days | ({day} if day else set())) > 1:
            raise FileError(f"{where}: a second day, {day}; keep the rows of one day")
        if "approach" in said and not said["approach"]:
            raise FileError(f"{where}: the approach is empty; each row needs one")
        if not kinds and "class" in said:
            names["classes"].add(said["class"])
        if not streams and not said.get("exit"):
            names["turns"].add(said.get("turn", ""))
        for approach, turn, out, kind, cell in _counts(said, cells, layout):
            if not cell:
                noticed["empty cells, taken as 0"].append(line)
            if (what := (start, approach, turn, out, kind)) in seen:
                noticed["counts given twice, and added"].append(line)
            seen.add(what)
            vehicles = number_of(cell, where, sheet.decimal)
            yield Record(where, start, end, approach, turn, out, kind, vehicles)
    check_used(given, "classes", names["classes"], f"{path}", "class")
    check_used(given, "turns", names["turns"], f"{path}", "turn")
    for told, lines in noticed.items():
        notes.append(f"{told}: {len(lines)}, the first in line {lines[0]}")


def _is_header(given: Mapping[str, Any], cells: list[str]) -> bool:
    """Whether a row has the name of a column for the start of intervals, and others."""
    starts = any(word_of(cell, {"start": COLUMNS["start"]}) for cell in cells)
    return len(list(filter(None, cells))) > 2 and (given.get("start") in cells or starts)


def _layout(sheet: Sheet, given: Mapping[str, Any], place: str, notes: list[str]) -> _Layout:
    """What the columns mean; those without a meaning are noted."""
    columns = _columns(sheet, given, place)
    rest = {k: name for k, name in enumerate(sheet.header) if k not in columns.values() and name}
    streams: dict[int, tuple[str, str, str]] = {}
    kinds: dict[int, str] = {}
    if "approach" in columns:
        kinds = {k: name for k, name in rest.items() if class_of(name, given)}
    else:
        streams = {k: it for k, name in rest.items() if (it := _movement(name))}
    if problem := _problem(columns, streams, kinds):
        raise FileError(f"{place}: {problem}")
    idle = ("turn", "exit", "count") if streams else ("class", "count") if kinds else ()
    for key in idle:
        if key in given:
            counts = ", ".join(sheet.header[k] for k in streams or kinds)
            raise InputError(
                f"{place}: the mapping has {key} = {given[key]!r}, but the counts are in the "
                f"columns {counts}"
            )
    unused = [sheet.header[columns[key]] for key in idle if key in columns]
    for k, name in rest.items():
        if k in streams or k in kinds:
            continue
        if not streams and (near := near_class(name)) and _numeric(sheet, k):
            raise FileError(f"{place}: unknown class {name!r}; did you mean {near!r}?")
        unused.append(name)
    nameless = [k for k, name in enumerate(sheet.header) if not name]
    if any(cell for _, cells in sheet.rows for k, cell in enumerate(cells) if k in nameless):
        unused.append("those without a name")
    if sheet.titles:
        notes.append(f"above the header, not used: {', '.join(sheet.titles)}")
    if unused:
        notes.append(f"columns not used: {', '.join(unused)}")
    if not kinds and "class" not in columns:
        notes.append("no classes: all count as cars")
    return _Layout(columns, streams, kinds)


def _counts(
    said: Mapping[str, str], cells: list[str], layout: _Layout
) -> Iterator[tuple[str, str, str, str, str]]:
    """Approach, turn, exit, class and cell of every count of a row."""
    way = (said.get("approach", ""), said.get("turn", ""), said.get("exit", ""))
    kind = said.get("class", "car")
    if layout.streams:
        yield from ((*stream, kind, cells[k]) for k, stream in layout.streams.items())
    elif layout.kinds:
        yield from ((*way, name, cells[k]) for k, name in layout.kinds.items())
    else:
        yield (*way, kind, said["count"])


def class_of(name: str, given: Mapping[str, Any]) -> str | None:
    """What a class of a sheet means: a key of `CLASSES`, a type or "left out"; None if unknown."""
    if name in given.get("classes", {}):
        return str(given["classes"][name])
    return "total" if is_total(name) else word_of(name, CLASSES)


def near_class(name: str) -> str | None:
    """The usual word for a class that is most like a name, or None if none is."""
    return near_word(name, [word for said in CLASSES.values() for word in said if len(word) > 2])


def _columns(sheet: Sheet, given: Mapping[str, Any], place: str) -> dict[str, int]:
    """What a column means -> its index, as the mapping says or by its name.

    A name that may mean times or arms, such as "from", means times if it has any.
    """
    found: dict[str, int] = {}
    known = {plain(name): k for k, name in reversed(list(enumerate(sheet.header)))}
    both = {*COLUMNS["start"], *COLUMNS["end"]} & {*COLUMNS["approach"], *COLUMNS["exit"]}
    for key, words in COLUMNS.items():
        if key in given:
            name = choice(f"column of {place} for {key}:", given[key], sheet.header)
            if sheet.header.index(name) in found.values():
                raise InputError(f"the mapping has the column {name!r} of {place} for two keys")
            found[key] = sheet.header.index(name)
            continue
        named = [(word, known[word]) for word in (plain(key), *words) if word in known]
        column = next((
            k for word, k in named
            if word not in both or _timed(sheet, k) == (key in ("start", "end"))
        ), None)  # fmt: skip
        if column is not None and column not in found.values():
            found[key] = column
    if "start" not in found:
        raise FileError(
            f"{place}: no column has the start of the intervals, such as 'start'; it has "
            f"{', '.join(sheet.header)}; a mapping can name it"
        )
    return found


def _problem(columns: Mapping[str, int], streams: object, kinds: object) -> str:
    """What is missing in a sheet, as a sentence; empty if nothing is."""
    if "approach" not in columns:
        need = "no column has the approach, and none is a movement such as NBL"
        return "" if streams else f"{need}; a mapping can name the column"
    if not columns.keys() & {"turn", "exit"}:
        return "no column has the turn or the exit; a mapping can name it"
    if not kinds and "count" not in columns:
        return "no column has counts: none is a class such as car or called count"
    return ""


def _movement(name: str) -> tuple[str, str, str] | None:
    """Approach, turn and exit of a column such as "NBL", "North Left" or "N-S"."""
    pair = re.fullmatch(r"\s*(.+?)\s*(?:->|→|>|-|/| to | nach )\s*(.+?)\s*", name)
    if pair and compass(pair[1]) and compass(pair[2]):
        return pair[1], "", pair[2]
    known = plain(name)
    for turn, words in TURNS.items():
        for word in sorted({plain(turn), *words}, key=len, reverse=True):
            approach = known.removesuffix(word)
            if approach and approach != known and compass(approach):
                return approach, turn, ""
    return None


def _numeric(sheet: Sheet, column: int) -> bool:
    cells = [cells[column] for _, cells in sheet.rows if column < len(cells)]
    return any(cells) and all(not cell or cell.replace(",", ".").isdecimal() for cell in cells)


def _timed(sheet: Sheet, column: int) -> bool:
    """Whether the first cell of a column is a time of day."""
    cells = [cells[column] for _, cells in sheet.rows if column < len(cells)]
    return re.search(r"\d[:.h]\d\d", next(filter(None, cells), "")) is not None
