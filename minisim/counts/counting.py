"""What a sheet counted, put together: arms, intervals, and vehicles by movement and type."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from minisim.clock import seconds_of, time_of_day
from minisim.counts.records import Record, class_of, near_class, read_mapping, records_of
from minisim.counts.sheets import read_sheet
from minisim.counts.words import COMPASS, LEFT_OUT, TURNS, compass, near_word, plain, word_of
from minisim.demand import DemandProfile, Period
from minisim.errors import FileError, InputError, choice, items, number
from minisim.files import AnyPath
from minisim.fleet import TYPES
from minisim.inflow import Floats
from minisim.junction.movements import ARM_NAMES


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
    given, place = read_mapping(mapping), f"{path}"
    notes: list[str] = []
    left: dict[str, float] = defaultdict(float)
    records = list(records_of(read_sheet(path), given, place, notes))
    kinds, kept = _simulated(records, given, left)
    if not kept:
        raise FileError(f"{place}: nothing is left to simulate")
    edges, (arms, index) = _edges(kept, given, place), _arms(kept, given, place, notes)
    manoeuvres = _manoeuvres(kept, index, len(arms), given, place)
    types = tuple(kind for kind in TYPES if kind in kinds.values())
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
    there = np.asarray(vehicles.any(axis=(0, 1, 2)))
    if not there.any():
        raise FileError(f"{place}: no vehicle that can be simulated was counted")
    if not there.all():
        gone = [kind for kind, any_of_it in zip(types, there, strict=True) if not any_of_it]
        notes.append(f"no vehicle was counted of: {', '.join(gone)}")
        types = tuple(kind for kind in types if kind not in gone)
    return Count(
        Path(path).stem, arms, edges, types, vehicles[..., there], kinds, dict(left), tuple(notes)
    )


def _simulated(
    records: Sequence[Record], given: Mapping[str, Any], left: dict[str, float]
) -> tuple[dict[str, str], list[Record]]:
    """What each class of the sheet is, and the records of those that are simulated."""
    low, high = (seconds_of(given[key], key) if key in given else None for key in ("from", "until"))
    kinds: dict[str, str] = {}
    kept = []
    for it in records:
        if (low is not None and it.start < low) or (high is not None and it.start >= high):
            left["outside from … until"] += it.vehicles
            continue
        if it.kind not in kinds:
            if (kind := class_of(it.kind, given)) is None:
                raise FileError(
                    f"{it.where}: unknown class {it.kind!r}{_hint(near_class(it.kind))}"
                )
            kinds[it.kind] = LEFT_OUT.get(kind, kind)
        if kinds[it.kind] in TYPES:
            kept.append(it)
        else:
            left[f"{it.kind} ({kinds[it.kind]})"] += it.vehicles
    return kinds, kept


def _hint(near: str | None) -> str:
    return f"; did you mean {near!r}?" if near else "; a mapping can say what it is"


def _arms(
    records: Sequence[Record], given: Mapping[str, Any], place: str, notes: list[str]
) -> tuple[tuple[str, ...], dict[str, int]]:
    """The arms in clockwise order, and the lane of each name."""
    named = {it.approach for it in records} | {it.exit for it in records if it.exit}
    found = sorted(named, key=lambda name: [
        int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)
    ])  # fmt: skip
    points = {name: it for name in found if (it := compass(name))}
    if "arms" in given:
        arms = tuple(map(str, items("arms", given["arms"], "names of arms")))
        if again := [name for name in arms if arms.count(name) > 1]:
            raise InputError(f"arms names {again[0]!r} twice")
        for name in found:
            choice(f"arm of {place}:", name, arms)
        index = {name: arms.index(name) for name in found}
    elif len(points) == len(found):
        places = {name: (COMPASS.index(it) + 4 * heads) % 8 for name, (it, heads) in points.items()}
        order = sorted(set(places.values()))
        arms = tuple(COMPASS[k].upper() for k in order)
        index = {name: order.index(places[name]) for name in found}
        if any(heads for _, heads in points.values()):
            notes.append("NB, SB, … is where traffic heads: NB comes from the arm S")
    else:
        arms, index = tuple(found), {name: k for k, name in enumerate(found)}
        notes.append("the arms are taken as clockwise in this order; a mapping can say otherwise")
    if not 3 <= len(arms) <= len(ARM_NAMES):
        raise FileError(f"{place}: a junction has 3 … {len(ARM_NAMES)} arms, got {', '.join(arms)}")
    return arms, index


def _manoeuvres(
    records: Sequence[Record], index: Mapping[str, int], n: int, given: Mapping[str, Any],
    place: str,
) -> dict[tuple[str, str, str], int]:  # fmt: skip
    """The manoeuvre of each approach with a turn or an exit; 0 is a U-turn."""
    made: dict[tuple[str, str, str], int] = {}
    words: dict[tuple[str, str, str], str] = {}
    for it in records:
        key = (it.approach, it.turn, it.exit)
        if key in made or key in words:
            continue
        turn = (index[it.exit] - index[it.approach]) % n if it.exit else _turn(it, given)
        if turn == "u-turn":
            made[key] = 0
        elif isinstance(turn, str):
            words[key] = turn
        elif it.exit or 1 <= turn < n:
            made[key] = turn
        else:
            raise FileError(
                f"{place}: {it.turn!r} on {it.approach!r}: {n} arms have manoeuvres 1 … {n - 1}, "
                f"got {turn}"
            )
    for key, word in words.items():
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
        made[key] = 1 + order.index(word)
    return made


def _turn(it: Record, given: Mapping[str, Any]) -> str | int:
    """A key of `TURNS`, or the number of a manoeuvre."""
    said = given.get("turns", {}).get(it.turn, it.turn)
    if isinstance(said, int) or (isinstance(said, str) and said.isdecimal()):
        return int(said)
    known = re.sub(r"[0-9]", "", plain(str(said)))
    for text in (plain(str(said)), known, known.removeprefix(plain(it.approach))):
        if text and (word := word_of(text, TURNS)):
            return word
    near = near_word(known, TURNS, cutoff=0.5)
    raise FileError(f"{it.where}: unknown turn {said!r}{_hint(near)}")


def _edges(records: Sequence[Record], given: Mapping[str, Any], place: str) -> tuple[int, ...]:
    """The edges of the intervals [s], one after the other; raises `FileError` for others."""
    ends: dict[int, int | None] = {}
    for it in records:
        if ends.setdefault(it.start, it.end) != it.end:
            raise FileError(
                f"{it.where}: two intervals begin at {time_of_day(it.start)} and overlap"
            )
    starts = sorted(ends)
    if "interval" in given:
        step = int(60 * number("interval [min]", given["interval"], low=1, high=1440))
    else:
        step = min((b - a for a, b in pairwise(starts)), default=0)
    spans = []
    for start in starts:
        end = ends[start]
        if end is None and not step:
            raise FileError(
                f"{place}: the length of the interval is unknown; a mapping can say interval = 15"
            )
        spans.append((start, start + step if end is None else end or 86_400))
        if spans[-1][1] <= start:
            raise FileError(f"{place}: the interval {_span(spans[-1])} must end after its start")
    for one, other in pairwise(spans):
        if one[1] != other[0]:
            how = "overlap" if other[0] < one[1] else "leave a hole"
            raise FileError(
                f"{place}: the intervals {_span(one)} and {_span(other)} {how}; a mapping can "
                "choose a part of the day (from, until)"
            )
    return (*starts, spans[-1][1])


def _span(edges: tuple[int, int]) -> str:
    return "-".join(map(time_of_day, edges))


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
