"""The intervals of a sheet, one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from minisim.clock import time_of_day
from minisim.counts.records import Record
from minisim.errors import FileError, InputError, number

#: A day [s].
DAY = 86_400


def edges_of(
    records: Sequence[Record], given: Mapping[str, Any], place: str, notes: list[str]
) -> tuple[int, ...]:
    """The edges of the intervals, times of day [s], ascending; p + 1 of p intervals.

    What is assumed goes into `notes`. Raises `FileError` for intervals that overlap, leave a hole
    or cross midnight, and `InputError` for a length that a mapping gives beside ends.
    """
    ends: dict[int, int | None] = {}
    for it in records:
        if ends.setdefault(it.start, it.end) != it.end:
            raise FileError(
                f"{it.where}: two intervals begin at {time_of_day(it.start)} and overlap"
            )
    starts, step = sorted(ends), _step(ends, given, place, notes)
    spans = []
    for start in starts:
        end = ends[start]
        spans.append((start, start + step if end is None else end or DAY))
        if spans[-1][1] <= start:
            raise FileError(
                f"{place}: the interval {_span(spans[-1])} must end after its start; one that goes "
                "past midnight must end at 24:00"
            )
    for one, other in pairwise(spans):
        if one[1] != other[0]:
            how = "overlap" if other[0] < one[1] else "leave a hole"
            night = spans[0][0] == 0 and spans[-1][1] == DAY
            raise FileError(
                f"{place}: the intervals {_span(one)} and {_span(other)} {how}; a mapping can "
                "choose a part of the day (from, until)"
                + ", before midnight or after it, which are two days"
                * night
            )
    return (*starts, spans[-1][1])


def _step(
    ends: Mapping[int, int | None], given: Mapping[str, Any], place: str, notes: list[str]
) -> int:
    """How long intervals without an end last [s]; 0 if all have one."""
    if None not in ends.values():
        if "interval" in given:
            raise InputError(
                f"the mapping has interval = {given['interval']!r}, but the intervals of {place} "
                "have ends"
            )
        return 0
    if "interval" in given:
        return int(60 * number("interval [min]", given["interval"], low=1, high=1440))
    step = min((b - a for a, b in pairwise(sorted(ends))), default=0)
    if not step:
        raise FileError(
            f"{place}: the length of the interval is unknown; a mapping can say interval = 15"
        )
    notes.append(
        f"intervals have no ends: {step / 60:g} min each, as from one start to the next; a mapping "
        "can say otherwise (interval)"
    )
    return step


def _span(edges: tuple[int, int]) -> str:
    return "-".join(map(time_of_day, edges))
