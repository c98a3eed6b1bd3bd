"""Shares of lanes and manoeuvres: read from numbers or text, written as text, and made to fit."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from minisim.errors import InputError, numbers, plural, show
from minisim.inflow import Floats
from minisim.junction.movements import ARM_NAMES, Bools

#: Words for equal shares of the lanes and of the manoeuvres.
BALANCED, UNIFORM = "balanced", "uniform"
#: Shares as callers may give them.
Shares = Sequence[float] | str | None
#: Shares of the manoeuvres: the same on every lane, or a row for each.
Turns = Shares | Sequence[Shares]


def read_shares(name: str, value: object, equal: str) -> tuple[float, ...] | None:
    """Shares from numbers, or from text such as "4:3:2:1" or "(4, 3, 2, 1)".

    None and the word `equal` mean equal shares, which are returned as None.

    Raises:
        InputError: not finite numbers, a negative one, or only zeros.
    """
    if value is None or (isinstance(value, str) and value == equal):
        return None
    if isinstance(value, str):
        text = value.strip()
        listed = text[1:-1] if text[:1] + text[-1:] in ("()", "[]") else text
        try:
            value = tuple(map(float, re.split("[:,]", listed)))
        except ValueError:
            wrong = f"{name} must be {equal} or like 4:3:2:1, got {show(value)}"
            raise InputError(wrong) from None
    shares = numbers(name, value)
    if not shares or min(shares) < 0 or not 0 < sum(shares) < math.inf:
        raise InputError(f"{name} must be shares ≥ 0, not all 0; got {show(value)}")
    return shares


def read_turns(name: str, value: object) -> Any:
    """Shares of the manoeuvres as for `read_shares`, or a row of them per lane.

    As text, slashes separate the rows: "1:2:1/uniform/0:1:1/1:2:1". Raises as `read_shares`.
    """
    rows: Any = value.split("/") if isinstance(value, str) and "/" in value else value
    if isinstance(rows, list | tuple) and any(
        it is None or np.ndim(it) or _text(it) for it in rows
    ):
        return tuple(read_shares(f"{name}[{k}]", row, UNIFORM) for k, row in enumerate(rows))
    return read_shares(name, value, UNIFORM)


def shares_text(shares: Shares, equal: str) -> str:
    """Shares as `read_shares` returns them, as text such as "4:3:2:1" or the word `equal`."""
    return equal if shares is None else ":".join(f"{float(share):g}" for share in shares)


def turns_text(turns: Any) -> str:
    """Turns as `read_turns` returns them, as text."""
    rows = turns if _by_lane(turns) else (turns,)
    return "/".join(shares_text(row, UNIFORM) for row in rows)


def lane_shares(split: Shares, lanes: Bools) -> tuple[float, ...]:
    """Shares of the lanes, shape (n,), summing to 1: 0 where `lanes` says that no vehicle may come.

    Raises:
        InputError: too many shares or too few, or one above 0 for a lane without vehicles.
    """
    if split is None:
        return tuple(1.0 / int(lanes.sum()) * used for used in lanes.tolist())
    shares = _summing_to_one("split", split, len(lanes), "lanes")
    for lane, (share, used) in enumerate(zip(shares, lanes.tolist(), strict=True)):
        if share and not used:
            raise InputError(
                f"split gives lane {ARM_NAMES[lane]} a share, but no vehicle may come from there: "
                "its share must be 0"
            )
    return shares


def turning(name: str, turns: Turns, n: int, allowed: Bools | None = None) -> Floats:
    """Shares of the manoeuvres that are `allowed`, by lane, shape (n, n−1); not summing to 1.

    Args:
        name: what messages call them.
        turns: as `read_turns` returns them.
        n: number of lanes.
        allowed: which manoeuvres vehicles may take, shape (n, n−1); None is all.

    Raises:
        InputError: shares that do not fit the lanes, that leave a lane nothing that is allowed, or,
            if given by lane, one of a manoeuvre that is not allowed.
    """
    by_lane = _by_lane(turns)
    rows: Any = turns if by_lane else (turns,) * n
    if len(rows) != n:
        raise InputError(f"{name} has {plural(len(rows), 'row')} for {n} lanes")
    shares = np.array([
        _summing_to_one(f"{name} on lane {lane}" if by_lane else name, row, n - 1, "manoeuvres")
        for lane, row in zip(ARM_NAMES, rows, strict=False)
    ])  # fmt: skip
    if allowed is None:
        return shares
    lanes, kept = np.asarray(allowed.any(axis=1)), np.where(allowed, shares, 0.0)
    for lane in range(n):
        if by_lane and rows[lane] is not None and (kept[lane] < shares[lane]).any():
            raise InputError(f"{name} send vehicles of lane {ARM_NAMES[lane]} where none may go")
        if lanes[lane] and not kept[lane].any():
            where = f"lane {ARM_NAMES[lane]} none of the manoeuvres allowed there"
            raise InputError(f"{name} leave {where}")
    return np.where(lanes[:, None], kept, 1.0)  # no vehicle draws the latter


def _text(value: object) -> bool:
    return isinstance(value, str)


def _by_lane(turns: Any) -> bool:
    return turns is not None and any(row is None or isinstance(row, tuple) for row in turns)


def _summing_to_one(name: str, given: Any, count: int, things: str) -> tuple[float, ...]:
    """Shares of `count` things, as `read_shares` returns them, made to sum to 1."""
    if given is None:
        return (1.0 / count,) * count
    if len(given) != count:
        raise InputError(f"{name} has {plural(len(given), 'share')} for {count} {things}")
    return tuple(share / sum(given) for share in given)
