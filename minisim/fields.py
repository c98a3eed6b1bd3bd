"""What a parameter of a recipe is, and a function to declare each kind of parameter."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Literal, Protocol, TypeAlias, TypedDict, TypeVar, Unpack

from minisim.errors import (
    InputError,
    choice,
    instance,
    integer,
    kind_word,
    limits,
    number,
    numbers,
    printable,
    show,
)
from minisim.spelling import read

#: A field's title in messages and its value -> the value, perhaps in another form, or `InputError`.
Check = Callable[[str, Any], Any]

_Kept_co = TypeVar("_Kept_co", covariant=True)
_Given_contra = TypeVar("_Given_contra", contravariant=True)
_T = TypeVar("_T")


class Takes(Protocol[_Kept_co, _Given_contra]):
    """For type checkers, a field that keeps another type than its constructor takes.

    Checkers read it as a descriptor, though at run time the field is an ordinary one.
    """

    def __get__(self, recipe: object, kind: Any = None, /) -> _Kept_co: ...
    def __set__(self, recipe: object, value: _Given_contra, /) -> None: ...


#: The field of a `part` with `kinds`: the part itself, or a text or table that describes it.
Spelled: TypeAlias = Takes[_T, _T | str | Mapping[str, Any]]

#: The field of a `switch`.
Switch: TypeAlias = Takes[bool, bool | Literal["on", "off", "true", "false"]]

#: The field of `reals`, kept as a tuple of the type `_T`; `MaybeReals` for an optional one.
Reals: TypeAlias = Takes[_T, Iterable[float]]
MaybeReals: TypeAlias = Takes[_T | None, Iterable[float] | None]

KEY = "parameter"

#: The words of a `switch`, and all that it understands.
SWITCH = ("true", "false")
_SWITCHES = {"true": True, "on": True, "false": False, "off": False}


@dataclass(frozen=True)
class Parameter:
    """What is declared about a field."""

    meaning: str  # in a few words
    unit: str  # such as "m"; empty if it has none
    allowed: str  # the values that it takes, in words
    check: Check
    label: str = ""  # what messages call it; if empty, the name of the field
    optional: bool = False  # whether None is allowed, too
    words: tuple[str, ...] = ()  # those allowed, for a field that takes one of several
    #: Word -> what makes the recipe of that name, for a field that holds another recipe.
    kinds: Mapping[str, Callable[..., Any]] = dataclasses.field(default_factory=dict)

    def title(self, name: str) -> str:
        """What messages call the field: its label or name, and its unit."""
        return f"{self.label or name} [{self.unit}]" if self.unit else self.label or name


class Common(TypedDict, total=False):
    """What every field may have: see `Parameter` and `dataclasses.field`."""

    optional: bool
    label: str
    default: Any
    default_factory: Any


def real(
    meaning: str,
    unit: str = "",
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    below: float = math.inf,
    **common: Unpack[Common],
) -> Any:
    """A finite number within [low, high] and (above, below)."""
    check = _unchanged(partial(number, low=low, high=high, above=above, below=below))
    return checked(meaning, check, _range(low, high, above, below), unit, **common)


def whole(
    meaning: str, unit: str = "", *, low: int, high: int | None = None, **common: Unpack[Common]
) -> Any:
    """An integer in [low, high]."""
    allowed = f"integer ≥ {low}" if high is None else f"integer {low} … {high}"
    check = _unchanged(partial(integer, low=low, high=high))
    return checked(meaning, check, allowed, unit, **common)


def word(meaning: str, among: Sequence[str], **common: Unpack[Common]) -> Any:
    """One of several words."""
    check = partial(choice, allowed=among)
    return checked(meaning, check, " | ".join(among), words=tuple(among), **common)


def switch(meaning: str, **common: Unpack[Common]) -> Any:
    """True or false."""

    def check(title: str, value: Any) -> Any:
        said = _SWITCHES.get(value.lower(), value) if isinstance(value, str) else value
        instance(title, said, bool)
        return said

    return checked(meaning, check, " | ".join(SWITCH), words=SWITCH, **common)


def text(meaning: str, *, empty: bool = False, **common: Unpack[Common]) -> Any:
    """A printable text of one line; `empty` says whether "" is allowed."""
    return checked(meaning, partial(printable, empty=empty), "text", **common)


def reals(
    meaning: str,
    unit: str = "",
    *,
    low: float = -math.inf,
    high: float = math.inf,
    count: int | None = None,
    **common: Unpack[Common],
) -> Any:
    """A sequence of finite numbers in [low, high], of any or a given length, kept as a tuple."""

    def check(title: str, value: Any) -> Any:
        kept = numbers(title, value)
        if count not in (None, len(kept)):
            raise InputError(f"{title} must be {count} numbers, got {kept}")
        for i, one in enumerate(kept):
            number(f"{title}[{i}]", one, low=low, high=high)
        return kept

    allowed = f"numbers {_range(low, high)}".removesuffix(" number")
    allowed = allowed if count is None else f"{count} {allowed}"
    return checked(meaning, check, allowed, unit, **common)


def part(
    meaning: str,
    kind: type | tuple[type, ...],
    *,
    kinds: Mapping[str, Callable[..., Any]] | None = None,
    **common: Unpack[Common],
) -> Any:
    """Another object, of the class or protocol `kind`.

    A text or a table (as in TOML) may name it by a word in `kinds`, which maps words to what makes
    it: `on`, `noisy(delay=0.1)`. `off` means none.
    """
    classes = kind if isinstance(kind, tuple) else (kind,)
    if not kinds:
        check = _unchanged(partial(instance, kind=kind))
        return checked(meaning, check, " | ".join(one.__name__ for one in classes), **common)
    nothing = ("off", "none") if common.get("optional") else ()
    wanted = f"{', '.join((*kinds, *nothing))} or {' or '.join(map(kind_word, classes))}"

    def check_part(title: str, value: Any) -> Any:
        made = read(title, value, kinds, nothing)
        none = made is None and nothing
        if not none and (not isinstance(made, kind) or isinstance(made, type)):
            raise InputError(f"{title} must be {wanted}, got {show(made)}")
        return made

    allowed = " | ".join(map(_form, kinds.items()))
    return checked(meaning, check_part, allowed, kinds=kinds, **common)


def _form(kind: tuple[str, Callable[..., Any]]) -> str:
    """A word and the arguments that it needs, such as `paper(n)`."""
    word, make = kind
    taken = inspect.signature(make).parameters.values()
    needed = ", ".join(it.name for it in taken if it.default is it.empty)
    return f"{word}({needed})" if needed else word


def checked(
    meaning: str,
    check: Check,
    allowed: str,
    unit: str = "",
    *,
    optional: bool = False,
    label: str = "",
    default: Any = MISSING,
    default_factory: Any = MISSING,
    words: tuple[str, ...] = (),
    kinds: Mapping[str, Callable[..., Any]] = MappingProxyType({}),
) -> Any:
    """A field with a check of its own; `allowed` says in words which values pass."""

    def unless_none(title: str, value: Any) -> Any:
        none = value is None or (isinstance(value, str) and value.lower() == "none")
        return None if none else check(title, value)

    said, tested = (f"{allowed} | none", unless_none) if optional else (allowed, check)
    it = Parameter(meaning, unit, said, tested, label, optional, words, kinds)
    return dataclasses.field(default=default, default_factory=default_factory, metadata={KEY: it})


def _unchanged(test: Callable[[str, Any], object]) -> Check:
    """A check that returns an object or an int unchanged, where a float is allowed too.

    Other numbers, such as fractions, become floats, and -0.0 becomes 0.0.
    """

    def check(title: str, value: Any) -> Any:
        fit = test(title, value)
        return value if fit is None or isinstance(value, int) else fit

    return check


def _range(low: float, high: float, above: float = -math.inf, below: float = math.inf) -> str:
    if above < low > -math.inf and below > high < math.inf:
        return f"{low:g} … {high:g}"
    return ", ".join(limits(low, high, above, below, ("≥", "≤", ">", "<"))) or "number"
