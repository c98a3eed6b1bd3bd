"""Every declared parameter of every recipe refuses what it says it refuses, in one sentence.

The bounds are read from the words of the declaration (`Parameter.allowed`), which users see, so a
check that disagrees with them fails here. Tests of single classes need not repeat it.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import pkgutil
import re
from collections.abc import Iterator
from dataclasses import MISSING
from inspect import isabstract
from typing import Any

import pytest

from minisim.errors import InputError
from minisim.fields import SWITCH
from minisim.parameters import Declared, Parameter, parameters

ROOMS = ("minisim", "dim", "baselines", "scenarios")

#: Not imported: a process of SUMO's own, which needs the extra; and commands, not recipes.
LEFT_OUT = ("minisim.sumo.worker", "minisim.__main__", "scenarios.cli")

NUMBER = r"-?[0-9.]+(?:e[+-]?[0-9]+)?"

#: The words of a range, as `minisim.parameters` writes them; other words are not parsed.
RANGE = re.compile(
    rf"(?P<kind>integer|numbers?|) ?"
    rf"(?:(?P<low>{NUMBER}) … (?P<high>{NUMBER})"
    rf"|(?:(?P<least>[≥>]) (?P<from>{NUMBER}))?(?:, )?(?:(?P<most>[≤<]) (?P<to>{NUMBER}))?)"
    rf"(?: \| none)?"
)


def modules() -> Iterator[Any]:
    for room in ROOMS:
        package = importlib.import_module(room)
        for module in pkgutil.walk_packages(package.__path__, f"{room}."):
            if not module.name.startswith(LEFT_OUT):
                yield importlib.import_module(module.name)


def declarations() -> dict[str, tuple[type, Declared]]:
    """`Class.parameter` -> the class and the parameter."""
    return {
        f"{kind.__name__}.{declared.name}": (kind, declared)
        for module in modules()
        for kind in vars(module).values()
        if isinstance(kind, type) and kind.__module__ == module.__name__ and not isabstract(kind)
        for declared in parameters(kind)
    }


ALL = declarations()


def refused(it: Parameter) -> list[Any]:
    """Values that the declaration rules out in words: of no known type, and beyond its bounds."""
    if it.words:
        return [object(), "no such word", 1]
    if it.allowed == "true | false":
        return [object(), 1, "yes"]
    said = RANGE.fullmatch(it.allowed)
    if said is None:
        return [object()]
    bad: list[Any] = [math.nan, math.inf, 1j, "1", True]
    for text, side in ((said["low"] or said["from"], -1), (said["high"] or said["to"], 1)):
        if text:
            # The words have six digits, so a little further than the next number.
            beyond = float(text) + side * max(1.0, abs(float(text)) * 1e-4)
            bad.append(int(beyond) if said["kind"] == "integer" else beyond)
    bad += [float(said["from"])] if said["least"] == ">" else []
    bad += [float(said["to"])] if said["most"] == "<" else []
    return [object(), *([value] for value in bad)] if said["kind"] == "numbers" else bad


@pytest.mark.parametrize("name", ALL)
def test_what_is_ruled_out_is_refused_by_name(name: str) -> None:
    kind, (field, it, _) = ALL[name]
    title = (it.label or field).removesuffix("s")  # of one of several values, too
    complete = all(default is not MISSING for _, _, default in parameters(kind))
    for value in refused(it):
        with pytest.raises(InputError) as caught:
            kind(**{field: value}) if complete else it.check(title, value)
        message = str(caught.value)
        assert title in message
        assert "\n" not in message
        assert len(message) < 400


@pytest.mark.parametrize("name", ALL)
def test_its_type_shows_what_it_takes(name: str) -> None:
    """Not only what it keeps, so that type checkers accept what the constructor accepts."""
    kind, (field, it, _) = ALL[name]
    (annotated,) = (each.type for each in dataclasses.fields(kind) if each.name == field)
    spelled = ("Spelled[",) if it.kinds else ("Switch",) if it.words == SWITCH else ()
    sequence = ("Reals[", "MaybeReals[", "Takes[") if re.search(r"\bnumbers", it.allowed) else ()
    assert annotated.startswith(spelled or sequence or "")


@pytest.mark.parametrize("name", ALL)
def test_a_misspelt_parameter_gets_the_nearest_name(name: str) -> None:
    kind, (field, _, _) = ALL[name]
    with pytest.raises(InputError, match=f"unknown {kind.__name__} parameter.*; did you mean "):
        kind(**{f"{field}x": 1})


@pytest.mark.parametrize("name", ALL)
def test_what_has_no_order_is_no_sequence(name: str) -> None:
    """Or anything else: no parameter is a set, and only recipes and texts may be tables."""
    _, (field, it, _) = ALL[name]
    tables = it.kinds or name == "Recipe.controller"
    for value in ({0, 1, 2, 3}, frozenset(), {}.keys(), *(() if tables else ({}, {0: 1, 1: 0}))):
        with pytest.raises(InputError):
            it.check(it.title(field), value)


@pytest.mark.parametrize("name", [name for name, (_, it) in ALL.items() if "text" in it[1].allowed])
@pytest.mark.parametrize("value", ["a\0", "a\nb", "\x1b[31m", "\ud800", "\u202e"])
def test_texts_can_be_printed(name: str, value: str) -> None:
    _, (field, it, default) = ALL[name]
    with pytest.raises(InputError, match="must be a text of one line, without control characters"):
        it.check(it.title(field), value)
    if default != "":
        with pytest.raises(InputError, match="must be a text that is not empty"):
            it.check(it.title(field), "")


@pytest.mark.parametrize("name", ALL)
def test_the_default_is_allowed_and_the_meaning_said(name: str) -> None:
    _, (field, it, default) = ALL[name]
    assert it.meaning
    assert it.meaning[-1] != "."
    if default is not MISSING:
        it.check(it.title(field), default)
