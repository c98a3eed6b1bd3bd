"""Junctions as files: a town's network, an extract of OpenStreetMap, or a table in TOML."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from minisim.errors import FileError, InputError, choice, instance
from minisim.files import AnyPath, read_file
from minisim.junction.geometry import Intersection
from minisim.junction.roads import Road

#: Endings of the names of such files.
SUFFIXES = (".toml", ".xml", ".osm", ".gz")

#: Keys of a table; another simulator's curves are not written.
KEYS = ("name", *(field.name for field in fields(Intersection) if field.name != "ways"))


class Named(NamedTuple):
    """A junction, and what rows call it."""

    name: str
    intersection: Intersection


def is_junction_file(name: str) -> bool:
    """Whether a scenario's name is the name of a file, by its ending."""
    return name.lower().endswith(SUFFIXES)


def junction_from(path: AnyPath, node: str | None = None, side: str | None = None) -> Named:
    """Read a junction; `node` and `side` are for towns, see `minisim.town.read_junction`.

    Raises what `read_junction` raises, and `InputError` for a table with a key or value that is not
    allowed; the message names it and the file.
    """
    instance("junction file", path, (str, os.PathLike))
    if not str(path).lower().endswith(".toml"):
        from minisim.town import read_junction

        stem = Path(path).name.partition(".")[0]
        made = read_junction(path, node, side)
        return Named(stem if node is None else f"{stem} {node}", made)
    if node is not None or side is not None:
        given = "node" if node is not None else "side"
        raise InputError(f"{given} needs a town's network, not the junction of {path}")
    try:
        table = tomllib.loads(read_file("junction", path).decode())
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is not valid TOML: {error}") from error
    try:
        for key in table:
            if key not in KEYS and any(field.name == key for field in fields(Road)):
                raise InputError(f"unknown key {key!r}; it belongs to a road, [[roads]]")
            choice("key of a junction", key, KEYS)
        name = table.pop("name", Path(path).stem)
        if "bearings" not in table:
            raise InputError("bearings are missing, such as bearings = [0, 80, 190, 260]")
        return Named(name, Intersection(**table))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def junction_text(name: str, intersection: Intersection) -> str:
    """A junction as the table in TOML that `junction_from` reads."""
    lines = [f"name = {_value(name)}", *_pairs(intersection)]
    for road in intersection.roads or ():
        lines += ["", "[[roads]]", *_pairs(road)]
    return "\n".join([*lines, ""])


def _pairs(thing: Intersection | Road) -> Iterator[str]:
    for field in fields(thing):
        value = getattr(thing, field.name)
        if field.name != "roads" and value != field.default:
            yield f"{field.name} = {_value(value)}"


def _value(value: Any) -> str:
    if isinstance(value, str):
        quoted = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{quoted}"'
    if isinstance(value, tuple):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)
