"""The arms of a sheet in clockwise order, and the manoeuvre that each of its turns is."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from minisim.counts.records import Record
from minisim.counts.words import (
    COMPASS,
    TURNS,
    compass,
    hint,
    near_point,
    near_word,
    plain,
    word_of,
)
from minisim.errors import FileError, InputError, items, nearest
from minisim.junction.movements import ARM_NAMES


def arms_of(
    records: Sequence[Record], given: Mapping[str, Any], place: str, notes: list[str]
) -> tuple[tuple[str, ...], dict[str, int]]:
    """The arms in clockwise order, and the index of the lane of each name in the sheet.

    What is assumed goes into `notes`. Raises `FileError` for a misspelt point of the compass, and
    for fewer than 3 arms or too many; and `InputError` for a mapping that lacks an arm.
    """
    named = {it.approach for it in records} | {it.exit for it in records if it.exit}
    found = sorted(named, key=lambda name: [
        int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)
    ])  # fmt: skip
    points = {name: it for name in found if (it := compass(name))}
    if "arms" in given:
        arms, index = _given_arms(records, found, given, notes)
    elif len(points) == len(found):
        places = {name: (COMPASS.index(it) + 4 * heads) % 8 for name, (it, heads) in points.items()}
        order = sorted(set(places.values()))
        arms = tuple(COMPASS[k].upper() for k in order)
        index = {name: order.index(places[name]) for name in found}
        if any(heads for _, heads in points.values()):
            notes.append("NB, SB, … is where traffic heads: NB comes from the arm S")
    else:
        for name in found:
            if points and name not in points and (near := near_point(name)):
                raise FileError(
                    f"{_where(records, name)}: unknown arm {name!r}; did you mean {near!r}? If "
                    "not, the arms of a mapping say the order"
                )
        arms, index = tuple(found), {name: k for k, name in enumerate(found)}
        notes.append("the arms are taken as clockwise in this order; a mapping can say otherwise")
    if not 3 <= len(arms) <= len(ARM_NAMES):
        raise FileError(f"{place}: a junction has 3 … {len(ARM_NAMES)} arms, got {', '.join(arms)}")
    return arms, index


def _given_arms(
    records: Sequence[Record], found: Sequence[str], given: Mapping[str, Any], notes: list[str]
) -> tuple[tuple[str, ...], dict[str, int]]:
    """The arms of a mapping, and the lane of each name."""
    arms = tuple(map(str, items("arms", given["arms"], "names of arms")))
    if again := [name for name in arms if arms.count(name) > 1]:
        raise InputError(f"arms names {again[0]!r} twice")
    idle = [name for name in arms if name not in found]
    for name in found:
        if name not in arms:
            raise InputError(
                f"{_where(records, name)}: the arm {name!r} is missing among the arms of the "
                f"mapping, {', '.join(arms)}{nearest(name, idle)}"
            )
    if idle:
        notes.append(f"arms of the mapping of which nothing was counted: {', '.join(idle)}")
    return arms, {name: arms.index(name) for name in found}


def _where(records: Sequence[Record], arm: str) -> str:
    """The file and line in which an arm is named first."""
    return next(it.where for it in records if arm in (it.approach, it.exit))


def manoeuvres_of(
    records: Sequence[Record], index: Mapping[str, int], n: int, given: Mapping[str, Any],
    place: str,
) -> dict[tuple[str, str, str], int]:  # fmt: skip
    """The manoeuvre 1 … n−1 of each approach, turn and exit that `records` have; 0 is a U-turn.

    Raises `FileError` for a turn that is unknown, or that does not say which exit with `n` arms.
    """
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
    raise FileError(f"{it.where}: unknown turn {said!r}{hint(near)}")
