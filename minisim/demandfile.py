"""Demand by time of day as a TOML file.

name = "Market Street"              # what rows call it
model = "poisson"                   # and min_headway = …, as for a `Demand`
start = "07:00"                     # where a run begins, if not at the first period

[fleet]                             # shares of vehicle types; without it, the profile's vehicle
car = 0.9                           # on every lane; or a list with one share per lane
bus = 0.1

[[period]]
start = "07:00"
end = "07:15"
rates = [120, 340, 96, 280]         # of lanes a, b, … [veh/h]
turns = "1:2:1"                     # on every lane; or a list with one text per lane
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from minisim.clock import time_of_day
from minisim.demand import DemandProfile, Period
from minisim.errors import FileError, InputError, choice, instance
from minisim.files import AnyPath, read_file, write_text
from minisim.fleet import TYPES, Fleet
from minisim.parameters import parameters
from minisim.shares import UNIFORM


def read_demand(path: AnyPath, start: float | str | None = None) -> DemandProfile:
    """Read demand by time of day from a TOML file; `start` replaces that of the file.

    Raises:
        InputError: a `start` that is not a time of the demand.
        FileError: unreadable, not TOML, an unknown key (with the nearest), a value that is not
            allowed, or periods that overlap or leave holes; the message names file and period.
    """
    try:
        table = tomllib.loads(read_file("demand", path).decode())
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is not valid TOML: {error}") from error
    known = [it.name for it in parameters(DemandProfile) if it.name != "periods"]
    for key in table:
        if key not in known and any(it.name == key for it in parameters(Period)):
            raise FileError(f"{path}: unknown key {key!r}; it belongs to a period, [[period]]")
        _made(f"{path}", choice, {"name": "key", "value": key, "allowed": ["period", *known]})
    blocks = table.pop("period", None)
    if not isinstance(blocks, list) or not all(isinstance(block, dict) for block in blocks):
        raise FileError(f"{path}: periods are written [[period]], with two brackets")
    periods = tuple(_made(f"{path}: period {k}", Period, it) for k, it in enumerate(blocks, 1))
    given = {"name": Path(path).stem, **table, "periods": periods}
    demand: DemandProfile = _made(f"{path}", DemandProfile, given)
    return demand if start is None else replace(demand, start=start)


def write_demand(demand: DemandProfile, path: AnyPath) -> None:
    """Write demand in the form that `read_demand` reads.

    Raises:
        InputError: a fleet with vehicle types of one's own, which a file cannot name.
        FileError: it cannot be written.
    """
    instance("demand", demand, DemandProfile)
    lines = [f"name = {_toml(demand.name)}", f'model = "{demand.model}"']
    if demand.model == "shifted":
        lines.append(f"min_headway = {_toml(demand.min_headway)}")
    lines.append(f'start = "{time_of_day(demand.start)}"')
    if demand.fleet is not None:
        lines += ["", "[fleet]", *_shares(demand.fleet)]
    for period in demand.periods:
        lines += [
            "", "[[period]]", f'start = "{time_of_day(period.start)}"',
            f'end = "{time_of_day(period.end)}"', f"rates = {_toml(period.rates)}",
            f"turns = {_toml(period.turns)}",
        ]  # fmt: skip
    write_text(path, "\n".join(lines) + "\n")


def _shares(fleet: Fleet) -> Iterator[str]:
    for kind, row in zip(fleet.types, fleet.shares, strict=True):
        ready = TYPES.get(kind.name)
        if ready is None or replace(kind, model=ready.model) != ready:
            raise InputError(
                f"a file of demand knows only the ready vehicle types, not your own {kind.name!r}"
            )
        yield f"{kind.name} = {_toml(row if len(row) > 1 else row[0])}"


def _made(where: str, make: Callable[..., Any], table: Mapping[str, Any]) -> Any:
    try:
        return make(**table)
    except InputError as error:
        raise FileError(f"{where}: {error}") from error


def _toml(value: Any) -> str:
    """A text, a number as exact as it is, or turns."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if value is None or isinstance(value, str):
        return json.dumps(value or UNIFORM, ensure_ascii=False)
    return repr(float(value)).removesuffix(".0")
