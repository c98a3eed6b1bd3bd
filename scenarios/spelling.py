"""Recipes read from text and tables, as `minisim.parameters.spelled` writes them.

    dim:gate=harmonious,priorities=(3,2,1,0),perception=noisy(intent_error=0.15,kind=symmetric)

Values are numbers, words, quoted texts, lists in brackets, and nested recipes. `true`, `false` and
`none` may be in any case; `on` and `off` switch a part on and off. A text is parsed as Python
source and never evaluated. A table, as TOML has it, means the same: `{name = "dim", gate =
"harmonious", perception = {name = "noisy", intent_error = 0.15}}`.
"""

from __future__ import annotations

import ast
import inspect
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from minisim.errors import InputError, MinisimError, choice, show
from minisim.parameters import SWITCH, Parameter, parameters

_CONSTANTS = {"true": True, "false": False, "none": None}
_ON_OFF = {"on": True, "off": False}
_VARIABLE = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)

#: Annotations that are checked where a class declares no parameters.
_SIMPLE = (float, int, str, bool)


@dataclass(frozen=True)
class Call:
    """A recipe as written: a name, and arguments by position and by name."""

    name: str
    places: tuple[Any, ...] = ()
    named: Mapping[str, Any] = field(default_factory=dict)
    text: str = field(default="", compare=False)

    def __repr__(self) -> str:
        return self.text or self.name


def parse_arguments(name: str, text: str) -> Call:
    """`key=value,…`, the arguments of the recipe `name`; raises `InputError`."""
    try:
        tree = ast.parse(f"_({text})", mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        tree = None
    if not isinstance(tree, ast.Call) or not isinstance(tree.func, ast.Name):
        digest = "; a digest (#…) stands for a value that only Python can give" * ("#" in text)
        raise InputError(
            f"cannot read {show(text)}, the parameters of {name}: they are written key=value, with "
            f"commas between them{digest}"
        )
    return _call(name, tree)


def call_of(value: Mapping[str, Any]) -> Call:
    """A table with a `name` as a recipe; raises `InputError`."""
    named = {str(key): one for key, one in value.items()}
    name = named.pop("name", None)
    if not isinstance(name, str):
        raise InputError(f"a table that describes a recipe needs a name, a text; got {show(value)}")
    return Call(name, named=named)


def build(title: str, make: Callable[..., Any], call: Call) -> Any:
    """Call `make` with the arguments of `call`.

    Args:
        title: what messages call the recipe.
        make: a class or function. Declared parameters (`minisim.parameters`) take words and nested
            recipes; the values of others must fit a simple annotation.
        call: the arguments.

    Raises:
        InputError: no such parameter (with the nearest one), or a value that is not allowed.
    """
    try:
        signature = inspect.signature(make)
    except (TypeError, ValueError) as error:
        raise InputError(f"{title} cannot be made from parameters: {error}") from None
    kinds = {it.name: it.kind for it in signature.parameters.values()}
    names = [name for name, kind in kinds.items() if kind not in _VARIABLE]
    if inspect.Parameter.VAR_KEYWORD not in kinds.values():
        for key in call.named:
            if not names:
                raise InputError(f"{title} has no parameters, got {key}")
            choice(f"{title} parameter", key, names)
    try:
        given = signature.bind(*call.places, **call.named)
    except TypeError as error:
        raise InputError(f"{title}: {error}") from None
    declared = {it.name: it.parameter for it in parameters(make)}
    hints = {} if declared else _hints(make)
    for name, value in given.arguments.items():
        if name in declared:
            given.arguments[name] = _value(name, declared[name], value)
        else:
            _check_simple(f"{name} of {title}", hints.get(name), value)
    try:
        return make(*given.args, **given.kwargs)
    except MinisimError as error:
        raise InputError(f"{title}: {error}") from None
    except Exception as error:  # a class of the caller's own may raise anything
        raise InputError(f"{title} cannot be made: {type(error).__name__}: {error}") from error


def _value(name: str, parameter: Parameter, value: Any) -> Any:
    """What a written value means for a declared parameter, which checks it later."""
    if isinstance(value, Mapping):
        only = {"name": next(iter(parameter.kinds))} if len(parameter.kinds) == 1 else {}
        value = call_of({**only, **value})
    text = value.lower() if isinstance(value, str) else None
    if parameter.words == SWITCH and text is not None:
        return {**_CONSTANTS, **_ON_OFF}.get(text, value)
    if parameter.optional and (text == "none" or (parameter.kinds and text == "off")):
        return None
    if not parameter.kinds:
        return value
    if text is not None and "(" in text:  # a table's text
        (value,) = parse_arguments(name, value).places or (value,)
    call = Call(value) if isinstance(value, str) else value
    if not isinstance(call, Call):
        return value
    word = choice(name, call.name.lower(), parameter.kinds)
    return build(f"{name}={word}", parameter.kinds[word], call)


def _hints(make: Callable[..., Any]) -> dict[str, Any]:
    """Annotations by parameter; none where one of them cannot be resolved."""
    try:
        return typing.get_type_hints(
            vars(make).get("__init__", make) if isinstance(make, type) else make
        )
    except Exception:  # the annotations are the caller's own, and may be anything
        return {}


def _check_simple(title: str, hint: Any, value: Any) -> None:
    """Check a value where its annotation is float, int, str or bool, or one of them or None."""
    union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    kinds = typing.get_args(hint) if union else (hint,)
    if any(kind not in (*_SIMPLE, types.NoneType) for kind in kinds):
        return
    if not any(
        isinstance(value, (float, int) if kind is float else kind)
        for kind in kinds
        if (kind is bool) == isinstance(value, bool)  # True is no number here
    ):
        names = " or ".join("None" if kind is types.NoneType else kind.__name__ for kind in kinds)
        raise InputError(f"{title} must be a {names}, got {show(value)}")


def _call(name: str, node: ast.Call) -> Call:
    named: dict[str, Any] = {}
    for keyword in node.keywords:
        if keyword.arg is None:
            raise _unreadable(name, keyword.value)
        if keyword.arg in named:
            raise InputError(f"{name} is given {keyword.arg} twice")
        named[keyword.arg] = _parsed(name, keyword.value)
    places = tuple(_parsed(name, argument) for argument in node.args)
    inner = ast.unparse(node).partition("(")[2]
    return Call(name, places, named, f"{name}({inner}")


def _parsed(name: str, node: ast.expr) -> Any:
    """The value of a piece of source."""
    match node:
        case ast.Constant(value=bool() | int() | float() | str() | None as value):
            return value
        case ast.Name(id=word):
            return _CONSTANTS.get(word.lower(), word)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=ast.Constant(value=value)) if (
            isinstance(value, int | float) and not isinstance(value, bool)
        ):
            return -value if isinstance(sign, ast.USub) else value
        case ast.Tuple(elts=elements) | ast.List(elts=elements):
            return tuple(_parsed(name, element) for element in elements)
        case ast.Call(func=ast.Name(id=inner)):
            return _call(inner, node)
    raise _unreadable(name, node)


def _unreadable(name: str, node: ast.expr) -> InputError:
    return InputError(
        f"cannot read {show(ast.unparse(node))} among the parameters of {name}: values are "
        "numbers, words, quoted texts, lists in brackets, and recipes such as noisy(delay=0.1)"
    )
