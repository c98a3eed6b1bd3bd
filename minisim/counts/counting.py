"""What a sheet counted, put together: arms, intervals, and vehicles by movement and type."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from minisim.clock import seconds_of, time_of_day
from minisim.counts.arms import arms_of, manoeuvres_of
from minisim.counts.intervals import edges_of
from minisim.counts.mapping import read_mapping
from minisim.counts.records import Record, class_of, near_class, records_of
from minisim.counts.words import LEFT_OUT, hint
from minisim.demand import DemandProfile, Period
from minisim.errors import FileError, InputError
from minisim.files import AnyPath
from minisim.fleet import TYPES
from minisim.inflow import Floats

#: Interval, lane, and manoeuvre − 1.
_Cell = tuple[int, int, int]


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
        """The rates [veh/h] and turns of every interval, and the fleet."""
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
        InputError: a mapping with an unknown key, or of something that the sheet does not have.
        FileError: unreadable; a column that is missing; a broken cell, an unknown class, turn or
            arm (with the nearest, and the line); intervals that overlap or leave holes; or fewer
            than 3 arms.
    """
    given, place = read_mapping(mapping), f"{path}"
    notes: list[str] = []
    left: dict[str, float] = defaultdict(float)
    kinds, kept = _simulated(list(records_of(path, given, notes)), given, left)
    if not kept:
        why = ", ".join(f"{total:g} {what}" for what, total in left.items()) or "all rows"
        told = f"{place}: nothing is left to simulate; left out: {why}"
        help_ = '; a mapping can say what a class is, as in classes = { Kfz = "car" }'
        raise FileError(told + help_ * bool(kinds))
    edges, (arms, index) = edges_of(kept, given, place, notes), arms_of(kept, given, place, notes)
    manoeuvres = manoeuvres_of(kept, index, len(arms), given, place)
    types = tuple(kind for kind in TYPES if kind in kinds.values())
    vehicles = np.zeros((len(edges) - 1, len(arms), len(arms) - 1, len(types)))
    seen: dict[str, set[_Cell]] = defaultdict(set)
    for it in kept:
        turn = manoeuvres[it.approach, it.turn, it.exit]
        if turn == 0:
            left["U-turns"] += it.vehicles
            continue
        where = edges.index(it.start), index[it.approach], turn - 1
        seen[it.kind].add(where)
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
    if low is not None and high is not None and low >= high:
        raise InputError(f"from must be before until, got {given['from']} and {given['until']}")
    kinds: dict[str, str] = {}
    kept = []
    for it in records:
        if (low is not None and it.start < low) or (high is not None and it.start >= high):
            left["outside from … until"] += it.vehicles
            continue
        if it.kind not in kinds:
            if (kind := class_of(it.kind, given)) is None:
                near = hint(near_class(it.kind))
                raise FileError(f"{it.where}: unknown class {it.kind!r}{near}")
            kinds[it.kind] = LEFT_OUT.get(kind, kind)
        if kinds[it.kind] in TYPES:
            kept.append(it)
        else:
            left[f"{it.kind} ({kinds[it.kind]})"] += it.vehicles
    return kinds, kept


def _missing(
    seen: Mapping[str, set[_Cell]], edges: tuple[int, ...], arms: tuple[str, ...]
) -> Iterator[str]:
    """A note on each stream that is not in every interval, and on each class that some lack."""
    cells = set().union(*seen.values())
    for lane, turn in sorted({it[1:] for it in cells}):
        gone = [k for k in range(len(edges) - 1) if (k, lane, turn) not in cells]
        if gone:
            times = ", ".join(time_of_day(edges[k]) for k in gone[:5])
            more = f" and {len(gone) - 5} more" if len(gone) > 5 else ""
            yield (
                f"{arms[lane]}, manoeuvre {turn + 1}: no row for the intervals from {times}{more}; "
                "taken as 0"
            )
    for kind, there in seen.items():
        if lacking := sorted(cells - there):
            k, lane, turn = lacking[0]
            yield (
                f"class {kind!r}: no row in {len(lacking)} of {len(cells)} intervals and streams "
                f"that others have, the first from {time_of_day(edges[k])} on {arms[lane]}, "
                f"manoeuvre {turn + 1}; taken as 0"
            )
