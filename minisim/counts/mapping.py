"""Mappings: what a user says of a sheet that does not use the usual words."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from typing import Any, Final

from minisim.counts.words import COLUMNS, TURNS, word_of
from minisim.errors import FileError, InputError, choice, instance, nearest, show
from minisim.files import AnyPath, read_file
from minisim.fleet import TYPES

#: Keys of a mapping besides the columns.
MAPPING: Final = (*COLUMNS, "interval", "from", "until", "arms", "classes", "turns")


def read_mapping(mapping: AnyPath | Mapping[str, Any] | None) -> Mapping[str, Any]:
    """A mapping from a table or a TOML file, with known keys, types of vehicles and turns.

    Raises `FileError` for a file that is unreadable or no TOML, and `InputError` for a key or value
    that is not allowed.
    """
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
    for name, turn in table.get("turns", {}).items():
        if not (type(turn) is int or (isinstance(turn, str) and _is_turn(turn))):
            raise InputError(
                f"turns: {name!r} must be {', '.join(TURNS)} or the number of a manoeuvre, got "
                f"{show(turn)}{nearest(turn, TURNS)}"
            )
    return table


def _is_turn(text: str) -> bool:
    return text.isdecimal() or word_of(text, TURNS) is not None


def check_used(
    given: Mapping[str, Any], key: str, there: Collection[str], place: str, what: str
) -> None:
    """Raise `InputError` for a word under a key of a mapping that is not `there` in the sheet.

    `place` is the sheet, and `what` is what messages call such a word.
    """
    for name in given.get(key, {}):
        if name not in there:
            known = f"it has {', '.join(sorted(there))}{nearest(name, there)}"
            raise InputError(
                f"{key} of the mapping: {place} has no {what} {name!r}; "
                f"{known if there else f'it names no {what}'}"
            )
