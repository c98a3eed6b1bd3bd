"""Names of recipes: what rows, figures and messages call them, spelled as on command lines."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import keyword
from collections.abc import Callable, Mapping
from functools import lru_cache
from numbers import Integral, Real
from typing import Any

from minisim.fields import SWITCH
from minisim.parameters import default_of, parameters


def spelled(name: str, recipe: object) -> str:
    """A recipe's name on command lines and in files: `dim:gate=harmonious,order=lanes`.

    It has the parameters that differ from their defaults. A value without a text form, such as a
    matrix, becomes its class and a digest, so different recipes get different names.
    """
    arguments = _arguments(recipe)
    return f"{name}:{arguments}" if arguments else name


class Name:
    """The attribute `name` of a recipe: its spelling, with `word` before any parameters."""

    def __init__(self, word: str) -> None:
        self._word = word

    def __get__(self, recipe: object, kind: type) -> str:
        return spelled(self._word, recipe)


def name_of(controller: Any) -> str:
    """A controller's name, with its parameters if the whole class has one constant name.

    So recipes that differ have different names, even if their author gave them only one.
    """
    name: str = controller.name
    same = inspect.getattr_static(type(controller), "name", None) == name
    return spelled(name, controller) if same else name


def _arguments(recipe: Any) -> str:
    return ",".join(
        f"{name}={spelled_value(getattr(recipe, name), kinds)}"
        for name, kinds, default in _fields(recipe.__class__)
        if getattr(recipe, name) != default
    )


@lru_cache(maxsize=256)
def _fields(kind: type) -> tuple[tuple[str, Mapping[str, Callable[..., Any]], Any], ...]:
    """Name, kinds (as in `part`) and default of each parameter of a class of recipes."""
    known = {name: it.kinds for name, it, _ in parameters(kind)}
    return tuple(
        (field.name, known.get(field.name, {}), default_of(field))
        for field in (dataclasses.fields(kind) if dataclasses.is_dataclass(kind) else ())
        if field.init and (field.name in known or not known)
    )


def spelled_value(value: Any, kinds: Mapping[str, Callable[..., Any]]) -> str:
    """One value of a spelling; `kinds` are the words for nested recipes, as in `part`."""
    if value is None or isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return value if _is_word(value) else repr(value)
    if isinstance(value, Integral):
        return str(int(value))
    if isinstance(value, Real):
        short = f"{value:g}"
        return short if float(short) == value else repr(float(value))
    if isinstance(value, tuple | list):
        inner = ",".join(spelled_value(one, kinds) for one in value)
        return f"({inner},)" if len(value) == 1 else f"({inner})"
    for known, maker in kinds.items():
        if type(value) is maker:
            arguments = _arguments(value)
            return f"{known}({arguments})" if arguments else known
    # An object may have a `spelling` of its own, which a maker in `kinds` accepts.
    own: str = getattr(value, "spelling", "")
    return own or f"{type(value).__name__}#{hashlib.sha256(repr(value).encode()).hexdigest()[:8]}"


def _is_word(text: str) -> bool:
    reserved = keyword.iskeyword(text) or text.lower() in (*SWITCH, "none")
    return text.isascii() and text.isidentifier() and not reserved
