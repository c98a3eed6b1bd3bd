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
help texts. Values may also be words, as on command lines and in files: `Dim(monitor="on")`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass
from functools import cache
from typing import Any, NamedTuple, TypeVar, dataclass_transform, overload

from minisim.errors import InputError, show
from minisim.fields import KEY, Parameter
from minisim.fields import MaybeReals as MaybeReals
from minisim.fields import Reals as Reals
from minisim.fields import Spelled as Spelled
from minisim.fields import Switch as Switch
from minisim.fields import Takes as Takes
from minisim.fields import checked as checked
from minisim.fields import part as part
from minisim.fields import real as real
from minisim.fields import reals as reals
from minisim.fields import switch as switch
from minisim.fields import text as text
from minisim.fields import whole as whole
from minisim.fields import word as word
from minisim.spelling import bound

_T = TypeVar("_T")


class Declared(NamedTuple):
    """A parameter of a class; `default` is `dataclasses.MISSING` if it has none."""

    name: str
    parameter: Parameter
    default: Any


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
    """Make a frozen dataclass whose constructor raises `InputError` for any wrong argument."""

    def make(kind: type[_T]) -> type[_T]:
        between = kind.__dict__.get("__post_init__")

        def check_all(self: Any) -> None:
            for name, it, _ in parameters(self.__class__):
                value = getattr(self, name)
                fit = it.check(it.title(name), value)
                if fit is not value:
                    object.__setattr__(self, name, fit)
            if between is not None:
                between(self)

        if between is not None or not hasattr(kind, "__post_init__"):
            kind.__post_init__ = check_all  # type: ignore[attr-defined]  # of any class
        about = kind.__doc__ or ""
        made = dataclass(frozen=True, kw_only=kw_only)(kind)
        made.__doc__ = _documented(about, made)
        _check_arguments(made)
        return made

    return make if cls is None else make(cls)


@cache
def parameters(kind: Any) -> tuple[Declared, ...]:
    """The declared parameters of a class that its constructor takes, in order."""
    if not dataclasses.is_dataclass(kind):
        return ()
    return tuple(
        Declared(field.name, field.metadata[KEY], default_of(field))
        for field in dataclasses.fields(kind)
        if field.init and KEY in field.metadata
    )


def refuse_idle(recipe: Any, need: str, *names: str) -> None:
    """Raise `InputError` for one of these parameters that is set, though it needs another one."""
    for name, _, default in parameters(recipe.__class__):
        if name in names and getattr(recipe, name) != default:
            raise InputError(f"{name} has an effect only with {need}; leave it out")


def _check_arguments(made: type) -> None:
    """Let the constructor of a dataclass refuse arguments by `InputError`, not `TypeError`."""
    make = made.__init__  # type: ignore[misc]  # a dataclass's own
    signature = inspect.signature(made)

    @functools.wraps(make)
    def init(self: Any, *places: Any, **named: Any) -> None:
        try:
            make(self, *places, **named)
            return
        except TypeError as error:
            wrong = error
        bound(made.__name__, signature, places, named)
        raise wrong

    made.__init__ = init  # type: ignore[misc]  # in its place


def default_of(field: Field[Any]) -> Any:
    """The default of a dataclass's field, `MISSING` if it has none."""
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _documented(about: str, kind: type) -> str:
    lines = [
        f"    {name}: {it.meaning}{f' [{it.unit}]' if it.unit else ''} ({it.allowed})"
        + ("." if default is MISSING else f"; {_shown(default)} by default.")
        for name, it, default in parameters(kind)
    ]
    head = inspect.cleandoc(about) or f"{kind.__name__}."
    return "\n".join([head, "", "Parameters:", *lines]) if lines else head


def _shown(default: Any) -> str:
    """A default in a few words: a recipe's class, with … if it has parameters of its own."""
    if not dataclasses.is_dataclass(default):
        return show(default)
    kind: Any = type(default)
    plain = all(getattr(default, name) == given for name, _, given in parameters(kind))
    return f"{kind.__name__}({'' if plain else '…'})"
