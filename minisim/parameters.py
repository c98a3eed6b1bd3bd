"""Parameters: a field's meaning, default, range and unit, declared together and checked once.

    @declared
    class OneAtATime:
        \"\"\"The vehicle nearest to the junction crosses alone, then the next.\"\"\"

        sight: float = real(
            "how far before the junction vehicles are seen", "m", default=40.0, low=1, high=400
        )

`declared` makes a frozen dataclass whose constructor checks every such field and raises an
`InputError` of one sentence. Rules that link fields go into `__post_init__`, which runs
afterwards. The class docstring gets a list of the parameters; `parameters` gives them as data, for
help texts and for parsers of command lines and files. `spelled` makes the name of a recipe, in the
spelling that those parsers accept.
"""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import keyword
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass
from functools import cache, partial
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any, NamedTuple, TypedDict, TypeVar, Unpack, dataclass_transform, overload

from minisim.errors import InputError, choice, instance, integer, number, numbers, show

_T = TypeVar("_T")

#: Returns the value of a field, perhaps in another form, or raises `InputError`. Its arguments are
#: what messages call the field, and the field's value.
Check = Callable[[str, Any], Any]

_KEY = "parameter"

#: The words of a `switch`.
SWITCH = ("true", "false")


@dataclass(frozen=True)
class Parameter:
    """What is declared about a field.

    Attributes:
        meaning: what it means, in a few words.
        unit: such as "m"; empty if it has none.
        allowed: the values that it takes, in words.
        check: see `Check`.
        label: what messages call it; if empty, the name of the field.
        optional: whether None is allowed too.
        words: the words allowed, for a field that takes one of several.
        kinds: word -> what makes the value of that name, for a field that holds another recipe.
    """

    meaning: str
    unit: str
    allowed: str
    check: Check
    label: str = ""
    optional: bool = False
    words: tuple[str, ...] = ()
    kinds: Mapping[str, Callable[..., Any]] = dataclasses.field(default_factory=dict)

    def title(self, name: str) -> str:
        """What messages call the field: its label or name, and its unit."""
        return f"{self.label or name} [{self.unit}]" if self.unit else self.label or name


class Declared(NamedTuple):
    """A parameter of a class; `default` is `dataclasses.MISSING` if it has none."""

    name: str
    parameter: Parameter
    default: Any


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
    return _field(meaning, check, " | ".join(among), words=tuple(among), **common)


def switch(meaning: str, **common: Unpack[Common]) -> Any:
    """True or false."""
    check = _unchanged(partial(instance, kind=bool))
    return _field(meaning, check, " | ".join(SWITCH), words=SWITCH, **common)


def text(meaning: str, **common: Unpack[Common]) -> Any:
    """Any text."""
    return checked(meaning, _unchanged(partial(instance, kind=str)), "text", **common)


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

    Command lines and files name it by a word in `kinds`, which maps each word to what makes it.
    """
    classes = kind if isinstance(kind, tuple) else (kind,)
    allowed = " | ".join(kinds or (one.__name__ for one in classes))
    check = _unchanged(partial(instance, kind=kind))
    return _field(meaning, check, allowed, kinds=kinds or {}, **common)


def checked(
    meaning: str, check: Check, allowed: str, unit: str = "", **common: Unpack[Common]
) -> Any:
    """A field with a check of its own; `allowed` says in words which values pass."""
    return _field(meaning, check, allowed, unit, **common)


def _field(
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
    def unless_none(title: str, value: Any) -> Any:
        return None if value is None else check(title, value)

    if optional:
        allowed = f"{allowed} | none"
    it = Parameter(
        meaning, unit, allowed, unless_none if optional else check, label, optional, words, kinds
    )
    return dataclasses.field(default=default, default_factory=default_factory, metadata={_KEY: it})


def _unchanged(test: Callable[[str, Any], object]) -> Check:
    """A check that returns the value as it is, such as an int where a float is allowed."""

    def check(title: str, value: Any) -> Any:
        test(title, value)
        return value

    return check


@overload
def declared(cls: type[_T], /) -> type[_T]: ...


@overload
def declared(*, kw_only: bool) -> Callable[[type[_T]], type[_T]]: ...


@dataclass_transform(
    frozen_default=True,
    field_specifiers=(real, whole, word, switch, text, reals, part, checked, dataclasses.field),
)
def declared(
    cls: type[_T] | None = None, /, *, kw_only: bool = False
) -> type[_T] | Callable[[type[_T]], type[_T]]:
    """Make a frozen dataclass that checks its declared fields on construction."""

    def make(kind: type[_T]) -> type[_T]:
        between = kind.__dict__.get("__post_init__")

        def check_all(self: Any) -> None:
            for name, title, check in _checks(self.__class__):
                value = getattr(self, name)
                fit = check(title, value)
                if fit is not value:
                    object.__setattr__(self, name, fit)
            if between is not None:
                between(self)

        if between is not None or not hasattr(kind, "__post_init__"):
            kind.__post_init__ = check_all  # type: ignore[attr-defined]  # of any class
        about = kind.__doc__ or ""
        made = dataclass(frozen=True, kw_only=kw_only)(kind)
        made.__doc__ = _documented(about, made)
        return made

    return make if cls is None else make(cls)


@cache
def parameters(kind: Any) -> tuple[Declared, ...]:
    """The declared parameters of a class that its constructor takes, in order."""
    if not dataclasses.is_dataclass(kind):
        return ()
    return tuple(
        Declared(field.name, field.metadata[_KEY], _default(field))
        for field in dataclasses.fields(kind)
        if field.init and _KEY in field.metadata
    )


def spelled(name: str, recipe: object) -> str:
    """A recipe's name on command lines and in files: `dim:gate=harmonious,order=lanes`.

    Only parameters that differ from their defaults are spelled. A value that has no text form,
    such as a matrix, becomes its class and a digest, so different recipes get different names.
    """
    arguments = _arguments(recipe)
    return f"{name}:{arguments}" if arguments else name


class Name:
    """The attribute `name` of a recipe: its spelling, with `word` before any parameters."""

    def __init__(self, word: str) -> None:
        self._word = word

    def __get__(self, recipe: object, kind: type) -> str:
        return spelled(self._word, recipe)


def _arguments(recipe: Any) -> str:
    return ",".join(
        f"{name}={spelled_value(getattr(recipe, name), it.kinds)}"
        for name, it, default in parameters(recipe.__class__)
        if default is MISSING or getattr(recipe, name) != default
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


@cache
def _checks(kind: Any) -> tuple[tuple[str, str, Check], ...]:
    return tuple((name, it.title(name), it.check) for name, it, _ in parameters(kind))


def _default(field: Field[Any]) -> Any:
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _documented(about: str, kind: type) -> str:
    """The docstring of a class with its parameters."""
    lines = [
        f"    {name}: {it.meaning}{f' [{it.unit}]' if it.unit else ''} ({it.allowed})"
        + ("." if default is MISSING else f"; {show(default)} by default.")
        for name, it, default in parameters(kind)
    ]
    head = inspect.cleandoc(about) or f"{kind.__name__}."
    return "\n".join([head, "", "Parameters:", *lines]) if lines else head


def _range(low: float, high: float, above: float = -math.inf, below: float = math.inf) -> str:
    least = f"≥ {low:g}" if math.isfinite(low) else ""
    most = f"≤ {high:g}" if math.isfinite(high) else ""
    if math.isfinite(above) and above >= low:
        least = f"> {above:g}"
    if math.isfinite(below) and below <= high:
        most = f"< {below:g}"
    if least.startswith("≥") and most.startswith("≤"):
        return f"{low:g} … {high:g}"
    return ", ".join(filter(None, (least, most))) or "number"
