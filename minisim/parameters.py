"""Parameters: meaning, default, range and unit of a field, declared together and checked once.

    @declared
    class OneAtATime:
        \"\"\"The vehicle nearest to the junction crosses alone, then the next.\"\"\"

        sight: float = real(
            "how far before the junction vehicles are seen", "m", default=40.0, low=1, high=400
        )

`declared` makes a frozen dataclass whose constructor checks every such field and raises
`InputError` with one sentence. Rules between fields go into `__post_init__`, which runs after
that. The class docstring gets a list of the parameters; `parameters` gives them as data, for help
texts and for readers of command lines and files. `spelled` writes a recipe as such a reader takes
it, which makes its name.
"""

from __future__ import annotations

import dataclasses
import hashlib
import keyword
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass
from functools import cache
from numbers import Integral, Real
from typing import Any, NamedTuple, TypeVar, dataclass_transform, overload

from minisim.errors import choice, instance, integer, number, numbers, show

_T = TypeVar("_T")

#: Returns the value of a field, perhaps in another form, or raises `InputError`. Arguments: what
#: messages call the field, and its value.
Check = Callable[[str, Any], Any]

_KEY = "parameter"

#: The words of a `switch`.
SWITCH = ("true", "false")


@dataclass(frozen=True)
class Parameter:
    """What is declared of a field.

    Attributes:
        meaning: in a few words.
        unit: such as "m"; empty where it has none.
        allowed: the values that it takes, in words.
        label: what messages call it; empty is the name of the field.
        check: see `Check`.
        kinds: word -> what makes the value of that name, for a field that holds another recipe.
        words: what a text may be, for a field that is one of some words.
        optional: whether None is allowed too.
    """

    meaning: str
    unit: str
    allowed: str
    label: str
    check: Check
    kinds: Mapping[str, Callable[..., Any]] = dataclasses.field(default_factory=dict)
    words: tuple[str, ...] = ()
    optional: bool = False

    def title(self, name: str) -> str:
        """What messages call it: its label or name, and its unit."""
        return f"{self.label or name} [{self.unit}]" if self.unit else self.label or name


class Declared(NamedTuple):
    """A parameter of a class.

    Attributes:
        name: of the field.
        parameter: what is declared of it.
        default: its default value, or `dataclasses.MISSING`.
    """

    name: str
    parameter: Parameter
    default: Any


def real(
    meaning: str,
    unit: str = "",
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    below: float = math.inf,
    optional: bool = False,
    label: str = "",
    default: Any = MISSING,
) -> Any:
    """A finite number in [low, high] and (above, below); None too where it is `optional`."""

    def check(title: str, value: Any) -> Any:
        number(title, value, low=low, high=high, above=above, below=below)
        return value

    allowed = _range(low, high, above, below)
    return _field(meaning, unit, allowed, label, check, optional, default)


def whole(
    meaning: str,
    unit: str = "",
    *,
    low: int,
    high: int | None = None,
    optional: bool = False,
    label: str = "",
    default: Any = MISSING,
) -> Any:
    """An integer in [low, high]; None too where it is `optional`."""

    def check(title: str, value: Any) -> Any:
        integer(title, value, low=low, high=high)
        return value

    allowed = f"integer ≥ {low}" if high is None else f"integer {low} … {high}"
    return _field(meaning, unit, allowed, label, check, optional, default)


def word(
    meaning: str,
    among: Sequence[str],
    *,
    optional: bool = False,
    label: str = "",
    default: Any = MISSING,
) -> Any:
    """One of some words."""

    def check(title: str, value: Any) -> Any:
        return choice(title, value, among)

    made = _field(meaning, "", " | ".join(among), label, check, optional, default)
    return _with(made, words=tuple(among))


def switch(meaning: str, *, label: str = "", default: Any = MISSING) -> Any:
    """True or false."""

    def check(title: str, value: Any) -> Any:
        instance(title, value, bool)
        return value

    made = _field(meaning, "", " | ".join(SWITCH), label, check, False, default)
    return _with(made, words=SWITCH)


def text(meaning: str, *, label: str = "", default: Any = MISSING) -> Any:
    """Any text."""

    def check(title: str, value: Any) -> Any:
        instance(title, value, str)
        return value

    return _field(meaning, "", "text", label, check, False, default)


def reals(
    meaning: str,
    unit: str = "",
    *,
    low: float = -math.inf,
    high: float = math.inf,
    optional: bool = False,
    label: str = "",
    default: Any = MISSING,
) -> Any:
    """Any sequence of finite numbers in [low, high], kept as a tuple."""

    def check(title: str, value: Any) -> Any:
        found = numbers(title, value)
        for i, one in enumerate(found):
            number(f"{title}[{i}]", one, low=low, high=high)
        return found

    allowed = "numbers" if _range(low, high) == "number" else f"numbers {_range(low, high)}"
    return _field(meaning, unit, allowed, label, check, optional, default)


def part(
    meaning: str,
    kind: type | tuple[type, ...],
    *,
    kinds: Mapping[str, Callable[..., Any]] | None = None,
    optional: bool = False,
    label: str = "",
    default: Any = MISSING,
    default_factory: Any = MISSING,
) -> Any:
    """Another object, of class or protocol `kind`.

    Args:
        meaning: in a few words.
        kind: what it must be an instance of.
        kinds: word -> what makes it, for command lines and files.
        optional: whether None is allowed too.
        label: what messages call it.
        default, default_factory: as of `dataclasses.field`.
    """

    def check(title: str, value: Any) -> Any:
        instance(title, value, kind)
        return value

    classes = kind if isinstance(kind, tuple) else (kind,)
    allowed = " | ".join(kinds or (one.__name__ for one in classes))
    made = _field(meaning, "", allowed, label, check, optional, default, default_factory)
    return _with(made, kinds=dict(kinds or {}))


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
) -> Any:
    """A field with a check of its own; `allowed` says in words what that lets through."""
    return _field(meaning, unit, allowed, label, check, optional, default, default_factory)


@overload
def declared(cls: type[_T], /) -> type[_T]: ...


@overload
def declared(*, kw_only: bool = False, eq: bool = True) -> Callable[[type[_T]], type[_T]]: ...


@dataclass_transform(
    frozen_default=True,
    field_specifiers=(
        real, whole, word, switch, text, reals, part, checked, dataclasses.field, Field,
    ),
)  # fmt: skip
def declared(
    cls: type[_T] | None = None, /, *, kw_only: bool = False, eq: bool = True
) -> type[_T] | Callable[[type[_T]], type[_T]]:
    """Make a frozen dataclass that checks its declared fields when it is made."""

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
            kind.__post_init__ = check_all  # type: ignore[attr-defined]
        about = kind.__doc__
        made = dataclass(frozen=True, kw_only=kw_only, eq=eq)(kind)
        made.__doc__ = _documented(about or "", made)
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
    """A recipe as command lines and files name it: `dim:gate=harmonious,order=lanes`.

    It has the parameters that differ from their defaults. A value without a text of its own, such
    as a matrix, is named by its class and a digest, so that different recipes have different names.
    """
    arguments = _arguments(recipe)
    return f"{name}:{arguments}" if arguments else name


def _arguments(recipe: Any) -> str:
    values = ((it, getattr(recipe, it.name)) for it in parameters(recipe.__class__))
    return ",".join(
        f"{it.name}={spelled_value(value, it.parameter.kinds)}"
        for it, value in values
        if it.default is MISSING or value != it.default
    )


def spelled_value(value: Any, kinds: Mapping[str, Callable[..., Any]]) -> str:
    """One value of a spelling; `kinds` are the words for nested recipes, as of `part`."""
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
    # An object may have a `spelling` of its own, which a maker in `kinds` takes.
    own: str = getattr(value, "spelling", "")
    return own or f"{type(value).__name__}#{hashlib.sha256(repr(value).encode()).hexdigest()[:8]}"


def _is_word(text: str) -> bool:
    reserved = keyword.iskeyword(text) or text.lower() in (*SWITCH, "none")
    return text.isascii() and text.isidentifier() and not reserved


@cache
def _checks(kind: Any) -> tuple[tuple[str, str, Check], ...]:
    return tuple((name, it.title(name), it.check) for name, it, _ in parameters(kind))


def _field(
    meaning: str,
    unit: str,
    allowed: str,
    label: str,
    check: Check,
    optional: bool,
    default: Any,
    default_factory: Any = MISSING,
) -> Any:
    def check_unless_none(title: str, value: Any) -> Any:
        return None if value is None else check(title, value)

    if optional:
        allowed = f"{allowed} | none"
    metadata = {
        _KEY: Parameter(
            meaning, unit, allowed, label, check_unless_none if optional else check,
            optional=optional,
        )
    }  # fmt: skip
    if default_factory is not MISSING:
        return dataclasses.field(default_factory=default_factory, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def _with(field: Any, **more: Any) -> Any:
    """The same field with more said of it."""
    metadata = {_KEY: dataclasses.replace(field.metadata[_KEY], **more)}
    if field.default_factory is not MISSING:
        return dataclasses.field(default_factory=field.default_factory, metadata=metadata)
    return dataclasses.field(default=field.default, metadata=metadata)


def _default(field: Field[Any]) -> Any:
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _documented(about: str, kind: type) -> str:
    """The docstring of a class with its parameters."""
    lines = [
        f"    {name}: {it.meaning}{f' [{it.unit}]' if it.unit else ''} ({it.allowed})"
        + ("." if default is MISSING else f"; {show(default)} by default.")
        for name, it, default in parameters(kind)
    ]
    head = about.strip() or f"{kind.__name__}."
    return "\n".join([head, "", "Parameters:", *lines]) if lines else head


def _range(
    low: float,
    high: float,
    above: float = -math.inf,
    below: float = math.inf,
) -> str:
    least = f"≥ {low:g}" if math.isfinite(low) else ""
    most = f"≤ {high:g}" if math.isfinite(high) else ""
    if math.isfinite(above) and above >= low:
        least = f"> {above:g}"
    if math.isfinite(below) and below <= high:
        most = f"< {below:g}"
    if least.startswith("≥") and most.startswith("≤"):
        return f"{low:g} … {high:g}"
    return ", ".join(filter(None, (least, most))) or "number"
