"""The counts of a sheet one by one: which columns hold what, and what each cell counts."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from minisim.counts.sheets import Sheet, interval_of, number_of
from minisim.counts.words import CLASSES, COLUMNS, TURNS, compass, near_word, plain, word_of
from minisim.errors import FileError, choice, instance
from minisim.files import AnyPath, read_file
from minisim.fleet import TYPES

#: Keys of a mapping besides the columns.
MAPPING: Final = (*COLUMNS, "interval", "from", "until", "arms", "classes", "turns")


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


def read_mapping(mapping: AnyPath | Mapping[str, Any] | None) -> Mapping[str, Any]:
    """A mapping from a table or a TOML file, with known keys and types of vehicles."""
    if mapping is None or isinstance(mapping, Mapping):
        table: Mapping[str, Any] = mapping or {}
    else:
        try:
            table = tomllib.loads(read_file("mapping", mapping).decode())
        except (ValueError, RecursionError) as error:
            raise FileError(f"{mapping} is not valid TOML: {error}") from error
    for key in table:
        choice("key of a mapping", key, MAPPING)
    for key in ("classes", "turns"):
        instance(key, table.get(key, {}), dict)
    for name, kind in table.get("classes", {}).items():
        choice(f"type of the class {name!r},", kind, (*TYPES, "left out"))
    return table


def records_of(
    sheet: Sheet, given: Mapping[str, Any], place: str, notes: list[str]
) -> Iterator[Record]:
    """Every count of a sheet; `given` is a mapping, and what was assumed goes into `notes`.

    Raises `FileError` as `minisim.counts.read_counts`.
    """
    columns = _columns(sheet, given, place)
    rest = {k: name for k, name in enumerate(sheet.header) if k not in columns.values()}
    streams: dict[int, tuple[str, str, str]] = {}
    kinds: dict[int, str] = {}
    if "approach" in columns:
        kinds = {k: name for k, name in rest.items() if class_of(name, given)}
    else:
        streams = {k: it for k, name in rest.items() if (it := _movement(name))}
    if problem := _problem(columns, streams, kinds):
        raise FileError(f"{place}: {problem}")
    idle = ("turn", "exit", "count") if streams else ("class", "count") if kinds else ()
    unused = [sheet.header[columns[key]] for key in idle if key in columns]
    for k, name in rest.items():
        if not name or k in streams or k in kinds:
            continue
        if not streams and (near := near_class(name)) and _numeric(sheet, k):
            raise FileError(f"{place}: unknown class {name!r}; did you mean {near!r}?")
        unused.append(name)
    if unused:
        notes.append(f"columns not used: {', '.join(unused)}")
    if not kinds and "class" not in columns:
        notes.append("no classes: all count as cars")
    days: set[str] = set()
    empty: list[int] = []  # lines
    seen: set[tuple[object, ...]] = set()
    again: list[int] = []
    for line, cells in sheet.rows:
        where = f"{place}, line {line}"
        said = {key: cells[k] for key, k in columns.items()}
        start, end, day = interval_of(said["start"], said.get("end"), where)
        if len(days := days | ({day} if day else set())) > 1:
            raise FileError(f"{where}: a second day, {day}; keep the rows of one day")
        way = (said.get("approach", ""), said.get("turn", ""), said.get("exit", ""))
        kind = said.get("class", "car")
        if streams:
            counted = [(*stream, kind, cells[k]) for k, stream in streams.items()]
        else:
            counted = [(*way, name, cells[k]) for k, name in kinds.items()]
        for approach, turn, out, name, cell in counted or [(*way, kind, said["count"])]:
            empty += [line] if not cell else []
            again += [line] if (what := (start, approach, turn, out, name)) in seen else []
            seen.add(what)
            vehicles = number_of(cell, where, sheet.decimal)
            yield Record(where, start, end, approach, turn, out, name, vehicles)
    if empty:
        notes.append(f"empty cells, taken as 0: {len(empty)}, the first in line {empty[0]}")
    if again:
        notes.append(
            f"counts given twice, and added: {len(again)}, the first again in line {again[0]}"
        )


def class_of(name: str, given: Mapping[str, Any]) -> str | None:
    """What a class of a sheet means: a key of `CLASSES`, a type or "left out"; None if unknown."""
    if name in given.get("classes", {}):
        return str(given["classes"][name])
    return word_of(name, CLASSES)


def near_class(name: str) -> str | None:
    """The usual word for a class that is most like a name, or None if none is."""
    return near_word(name, [word for said in CLASSES.values() for word in said if len(word) > 2])


def _columns(sheet: Sheet, given: Mapping[str, Any], place: str) -> dict[str, int]:
    """What a column means -> its index, as the mapping says or by its name."""
    found: dict[str, int] = {}
    known = {plain(name): k for k, name in reversed(list(enumerate(sheet.header)))}
    for key, words in COLUMNS.items():
        if key in given:
            name = choice(f"column of {place} for {key}:", given[key], sheet.header)
            found[key] = sheet.header.index(name)
            continue
        column = next((known[word] for word in (plain(key), *words) if word in known), None)
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
    cells = [cells[column] for _, cells in sheet.rows]
    return any(cells) and all(not cell or cell.replace(",", ".").isdecimal() for cell in cells)
