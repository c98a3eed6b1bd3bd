"""Turning-movement counts: sheets of what was counted at a junction, as a demand.

A sheet has a row per interval, approach and turn, with a column per class or with one column for
the class and one for the count; or a row per interval with a column per movement, such as `NBL`.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from minisim.clock import seconds_of, time_of_day
from minisim.demand import DemandProfile, Period
from minisim.errors import FileError, choice, instance, items, number, show
from minisim.files import AnyPath, read_file
from minisim.fleet import TYPES
from minisim.inflow import Floats
from minisim.junction.movements import ARM_NAMES
from minisim.sheets import (
    CLASSES,
    COLUMNS,
    COMPASS,
    LEFT_OUT,
    TURNS,
    Sheet,
    compass,
    interval_of,
    number_of,
    plain,
    read_sheet,
    word_of,
)

#: Keys of a mapping besides the columns.
MAPPING: Final = (*COLUMNS, "interval", "from", "until", "arms", "classes", "turns")


@dataclass(frozen=True, eq=False)
class Count:
    """A turning-movement count; its lanes a, b, … are the `arms`, in clockwise order."""

    name: str
    arms: tuple[str, ...]  # as the sheet calls them
    edges: tuple[int, ...]  # of the intervals, times of day [s], shape (p + 1,)
    types: tuple[str, ...]  # vehicle types (`minisim.fleet.TYPES`)
    vehicles: Floats  # by interval, lane, manoeuvre 1 … n−1 and type, shape (p, n, n−1, c)
    classes: Mapping[str, str]  # class of the sheet -> its type, or why it is left out
    left_out: Mapping[str, float]  # what was not used -> how many vehicles
    notes: tuple[str, ...]  # what was assumed

    @cached_property
    def demand(self) -> DemandProfile:
        """The rates and turns of every interval."""
        periods = []
        for (start, end), lanes in zip(pairwise(self.edges), self.vehicles.sum(3), strict=True):
            rates = tuple((lanes.sum(1) * 3600.0 / (end - start)).tolist())
            turns = tuple(tuple(row) if sum(row) else None for row in lanes.tolist())
            periods.append(Period(start=start, end=end, rates=rates, turns=turns))
        return DemandProfile(name=self.name, periods=tuple(periods), fleet=self.fleet)

    @property
    def mix(self) -> str:
        """The fleet over all lanes, as `minisim run --fleet` takes it."""
        totals = self.vehicles.sum((0, 1, 2))
        shares = [round(float(it), 4) for it in totals / totals.sum()]
        shares[int(np.argmax(shares))] += 1.0 - sum(shares)
        return ",".join(f"{kind}:{it:.4f}" for kind, it in zip(self.types, shares, strict=True))

    @cached_property
    def fleet(self) -> dict[str, list[float]]:
        """Share of each type on each lane, as `minisim.fleet.fleet_named` takes it."""
        lanes = self.vehicles.sum((0, 2))  # (n, c)
        lanes = np.where(lanes.sum(1, keepdims=True) > 0, lanes, lanes.sum(0))
        return dict(zip(self.types, (lanes / lanes.sum(1, keepdims=True)).T.tolist(), strict=True))


class _Record(NamedTuple):
    where: str
    start: int
    end: int | None
    approach: str
    turn: str  # its word or a manoeuvre's number; empty if there is an exit
    exit: str
    kind: str  # class of the sheet
    vehicles: float


def read_counts(path: AnyPath, mapping: AnyPath | Mapping[str, Any] | None = None) -> Count:
    """Read a turning-movement count.

    What cannot be simulated, such as U-turns and bicycles, is left out and counted (`left_out`).

    Args:
        path: the sheet, as text with a header; see the module.
        mapping: what the sheet does not say in usual words, as a table or a TOML file: the names
            of its columns (`COLUMNS`: start, end, approach, turn, exit, class, count); `interval`
            [min] if it has starts alone; `from` and `until`, times of day outside which rows are
            left out; `arms`, in clockwise order; `classes`, type (`minisim.fleet.TYPES`) or "left
            out" by class; and `turns`, left, through, right, u-turn or a manoeuvre's number by
            word.

    Raises:
        InputError: a mapping with an unknown key, or of a column that is not there.
        FileError: unreadable; a column that is missing; a broken cell, an unknown class or turn
            (with the nearest, and the line); intervals that overlap or leave holes; or fewer than
            3 arms.
    """
    given = _mapping(mapping)
    sheet = read_sheet(path)
    columns = _columns(sheet, given, f"{path}")
    notes: list[str] = []
    records = list(_records(sheet, columns, given, f"{path}", notes))
    return _count(records, given, f"{path}", Path(path).stem, notes)


def _mapping(mapping: AnyPath | Mapping[str, Any] | None) -> Mapping[str, Any]:
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


def _columns(sheet: Sheet, given: Mapping[str, Any], place: str) -> dict[str, int]:
    """What a column means -> its index, as the mapping says or by its name."""
    found: dict[str, int] = {}
    for key, words in COLUMNS.items():
        if key in given:
            name = choice(f"column of {place} for {key}:", given[key], sheet.header)
            found[key] = sheet.header.index(name)
            continue
        known = {plain(name): k for k, name in reversed(list(enumerate(sheet.header)))}
        place_of = next((known[word] for word in (plain(key), *words) if word in known), None)
        if place_of is not None and place_of not in found.values():
            found[key] = place_of
    if "start" not in found:
        raise FileError(
            f"{place}: no column has the start of the intervals, such as {show('start')}; it has "
            f"{', '.join(sheet.header)}; a mapping can name it"
        )
    return found


def _records(
    sheet: Sheet, columns: Mapping[str, int], given: Mapping[str, Any], place: str,
    notes: list[str],
) -> Iterator[_Record]:  # fmt: skip
    """Every count of a sheet."""
    rest = {name: k for k, name in enumerate(sheet.header) if k not in columns.values()}
    wide = "approach" not in columns
    if wide:
        streams = {name: (k, *it) for name, k in rest.items() if (it := _movement(name))}
    else:
        streams = {}
        if not columns.keys() & {"turn", "exit"}:
            raise FileError(f"{place}: no column has the turn or the exit; a mapping can name it")
    kinds = {k: name for name, k in rest.items() if not streams and _class(name, given)}
    if wide and not streams:
        raise FileError(
            f"{place}: no column has the approach, and none is a movement such as NBL; a mapping "
            "can name the column"
        )
    if not wide and not kinds and "count" not in columns:
        raise FileError(
            f"{place}: no column has counts: none is a class such as car or called count"
        )
    unused = [n for n, k in rest.items() if n and n not in streams and k not in kinds]
    for name in unused:
        if not streams and (near := _near_class(name)) and _numeric(sheet, rest[name]):
            raise FileError(f"{place}: unknown class {name!r}; did you mean {near!r}?")
    if unused:
        notes.append(f"columns not used: {', '.join(unused)}")
    if not kinds and "class" not in columns:
        notes.append("no classes: all count as cars")
    for line, cells in sheet.rows:
        where = f"{place}, line {line}"
        said = {key: cells[k] for key, k in columns.items()}
        start, end = interval_of(said["start"], said.get("end"), where)
        kind = said.get("class", "car")
        if wide:
            for k, approach, turn, out in streams.values():
                count = number_of(cells[k], where, sheet.decimal)
                yield _Record(where, start, end, approach, turn, out, kind, count)
            continue
        stream = (said["approach"], said.get("turn", ""), said.get("exit", ""))
        named = {name: cells[k] for k, name in kinds.items()} or {kind: said["count"]}
        for name, cell in named.items():
            yield _Record(where, start, end, *stream, name, number_of(cell, where, sheet.decimal))


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


def _class(name: str, given: Mapping[str, Any]) -> str | None:
    """The type of a class of a sheet, or the word for why it is left out; None if unknown."""
    if name in given.get("classes", {}):
        return str(given["classes"][name])
    return word_of(name, CLASSES)


def _near_class(name: str) -> str | None:
    words = [word for said in CLASSES.values() for word in said if len(word) > 2]
    return next(iter(difflib.get_close_matches(plain(name), words, n=1, cutoff=0.6)), None)


def _numeric(sheet: Sheet, column: int) -> bool:
    cells = [cells[column] for _, cells in sheet.rows]
    return any(cells) and all(not cell or cell.replace(",", ".").isdecimal() for cell in cells)


def _count(
    records: list[_Record], given: Mapping[str, Any], place: str, name: str, notes: list[str]
) -> Count:
    left: dict[str, float] = defaultdict(float)
    kinds: dict[str, str] = {}
    kept = []
    low, high = (seconds_of(given[key], key) if key in given else None for key in ("from", "until"))
    for it in records:
        if (low is not None and it.start < low) or (high is not None and it.start >= high):
            left["outside from … until"] += it.vehicles
            continue
        if it.kind not in kinds:
            if (kind := _class(it.kind, given)) is None:
                near = _near_class(it.kind)
                hint = f"; did you mean {near!r}?" if near else "; a mapping can say what it is"
                raise FileError(f"{it.where}: unknown class {it.kind!r}{hint}")
            kinds[it.kind] = LEFT_OUT.get(kind, kind)
        if kinds[it.kind] in TYPES:
            kept.append(it)
        else:
            left[f"{it.kind} ({kinds[it.kind]})"] += it.vehicles
    if not kept:
        raise FileError(f"{place}: nothing is left to simulate")
    arms, index = _arms([it.approach for it in kept] + [it.exit for it in kept if it.exit],
                        given, place, notes)  # fmt: skip
    edges = _edges(kept, given, place)
    types = tuple(kind for kind in TYPES if kind in kinds.values())
    manoeuvres = _manoeuvres(kept, index, len(arms), given, place)
    vehicles = np.zeros((len(edges) - 1, len(arms), len(arms) - 1, len(types)))
    seen = set()
    for it in kept:
        turn = manoeuvres[it.approach, it.turn, it.exit]
        if turn == 0:
            left["U-turns"] += it.vehicles
            continue
        where = edges.index(it.start), index[it.approach], turn - 1
        seen.add(where)
        vehicles[(*where, types.index(kinds[it.kind]))] += it.vehicles
    notes += _missing(seen, edges, arms)
    if empty := [kind for k, kind in enumerate(types) if not vehicles[..., k].any()]:
        notes.append(f"no vehicle was counted of: {', '.join(empty)}")
    there = [k for k, kind in enumerate(types) if kind not in empty]
    types, vehicles = tuple(types[k] for k in there), vehicles[..., there]
    if not there:
        raise FileError(f"{place}: no vehicle that can be simulated was counted")
    return Count(name, arms, edges, types, vehicles, kinds, dict(left), tuple(notes))


def _arms(
    named: list[str], given: Mapping[str, Any], place: str, notes: list[str]
) -> tuple[tuple[str, ...], dict[str, int]]:
    """The arms in clockwise order, and the lane of each name."""
    found = sorted({*named}, key=lambda name: [int(x) if x.isdigit() else x
                                               for x in re.split(r"(\d+)", name)])  # fmt: skip
    points = {name: compass(name) for name in found}
    if "arms" in given:
        arms = tuple(map(str, items("arms", given["arms"], "names of arms")))
        for name in found:
            choice(f"arm of {place}:", name, arms)
        index = {name: arms.index(name) for name in found}
    elif all(points.values()):
        places = {}
        for name, it in points.items():
            point, heads = it or ("n", False)
            places[name] = (COMPASS.index(point) + 4 * heads) % 8
        order = sorted(set(places.values()))
        arms = tuple(COMPASS[k].upper() for k in order)
        index = {name: order.index(places[name]) for name in found}
        if any(it and it[1] for it in points.values()):
            notes.append("NB, SB, … is where traffic heads: NB comes from the arm S")
    else:
        arms, index = tuple(found), {name: k for k, name in enumerate(found)}
        notes.append("the arms are taken as clockwise in this order; a mapping can say otherwise")
    if not 3 <= len(arms) <= len(ARM_NAMES):
        raise FileError(f"{place}: a junction has 3 … {len(ARM_NAMES)} arms, got {', '.join(arms)}")
    return arms, index


def _manoeuvres(
    records: list[_Record], index: Mapping[str, int], n: int, given: Mapping[str, Any], place: str
) -> dict[tuple[str, str, str], int]:
    """The manoeuvre of each approach with a turn or an exit; 0 is a U-turn."""
    words: dict[tuple[str, str, str], str | int] = {}
    for it in records:
        key = (it.approach, it.turn, it.exit)
        if key not in words:
            there = (index[it.exit] - index[it.approach]) % n if it.exit else None
            words[key] = _turn(it, given) if there is None else there
    made = {}
    for key, word in words.items():
        if isinstance(word, str) and word != "u-turn":
            order = ["left", "through", "right"]
            if n == 3:
                mine = {w for k, w in words.items() if index[k[0]] == index[key[0]]}
                order = [w for w in order if w in mine]
            if n > 4 or len(order) != n - 1:
                raise FileError(
                    f"{place}: with {n} arms, {word} on {key[0]!r} does not say which exit; a "
                    "column of exits does, or a mapping of turns to manoeuvres 1 … "
                    f"{n - 1}, clockwise"
                )
            word = 1 + order.index(word)
        made[key] = 0 if isinstance(word, str) else word
        if made[key] >= n:
            raise FileError(
                f"{place}: {key[1]!r} on {key[0]!r}: {n} arms have manoeuvres 1 … {n - 1}"
            )
    return made


def _turn(it: _Record, given: Mapping[str, Any]) -> str | int:
    said = given.get("turns", {}).get(it.turn, it.turn)
    if isinstance(said, int) or (isinstance(said, str) and said.isdigit()):
        return int(said)
    known = re.sub(r"[0-9]", "", plain(str(said)))
    for text in (plain(str(said)), known, known.removeprefix(plain(it.approach))):
        if text and (word := word_of(text, TURNS)):
            return word
    near = next(iter(difflib.get_close_matches(known, [*TURNS], n=1, cutoff=0.5)), "")
    hint = f"; did you mean {near!r}?" if near else "; a mapping can say what it is"
    raise FileError(f"{it.where}: unknown turn {said!r}{hint}")


def _edges(records: list[_Record], given: Mapping[str, Any], place: str) -> tuple[int, ...]:
    """The edges of the intervals [s], one after the other; raises `FileError` for others."""
    starts = sorted({it.start for it in records})
    ends = {it.start: it.end for it in records}
    if any(it.end != ends[it.start] for it in records):
        it = next(it for it in records if it.end != ends[it.start])
        raise FileError(f"{it.where}: two intervals begin at {time_of_day(it.start)} and overlap")
    if "interval" in given:
        step = int(60 * number("interval [min]", given["interval"], above=0, high=1440))
    else:
        step = min((b - a for a, b in pairwise(starts)), default=0)
    spans = []
    for start in starts:
        end = ends[start]
        if end is None and not step:
            raise FileError(f"{place}: how long is the interval? a mapping can say interval = 15")
        spans.append((start, start + step if end is None else end or 86_400))
    for (a, b), (c, d) in pairwise(spans):
        if b != c:
            how = "overlap" if c < b else "leave a hole"
            raise FileError(
                f"{place}: the intervals {time_of_day(a)}-{time_of_day(b)} and {time_of_day(c)}-"
                f"{time_of_day(d)} {how}; a mapping can choose a part of the day (from, until)"
            )
    return (*starts, spans[-1][1])


def _missing(
    seen: set[tuple[int, int, int]], edges: tuple[int, ...], arms: tuple[str, ...]
) -> Iterator[str]:
    """A note on each stream that is not in every interval."""
    for lane, turn in sorted({it[1:] for it in seen}):
        gone = [k for k in range(len(edges) - 1) if (k, lane, turn) not in seen]
        if gone:
            times = ", ".join(time_of_day(edges[k]) for k in gone[:5])
            more = f" and {len(gone) - 5} more" if len(gone) > 5 else ""
            yield (
                f"{arms[lane]}, manoeuvre {turn + 1}: no row for the intervals from {times}{more}; "
                "taken as 0"
            )
