"""Reads recipes from text and tables, as `minisim.names.spelled` writes them.

    dim:gate=harmonious,priorities=(3,2,1,0),perception=noisy(intent_error=0.15,kind=symmetric)

Values are numbers, words, quoted texts, lists in brackets, and nested recipes. `true`, `false` and
`none` may be upper or lower case. Text is parsed as Python source and never evaluated. A table, as
in TOML, means the same: `{name = "dim", gate = "harmonious", perception = {name = "noisy",
intent_error = 0.15}}`. The parameter says what a value means (`minisim.parameters`).
"""

from __future__ import annotations

import ast
import inspect
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from minisim.errors import InputError, MinisimError, choice, kind_word, show

_CONSTANTS = {"true": True, "false": False, "none": None}
_VARIABLE = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)

#: Annotations that are checked if a class declares no parameters.
_SIMPLE = (float, int, str, bool)


@dataclass(frozen=True)
class Call:
    """A recipe as written: a name, with positional and named arguments."""

    name: str
    places: tuple[Any, ...] = ()
    named: Mapping[str, Any] = field(default_factory=dict)
    text: str = field(default="", compare=False)

    def __repr__(self) -> str:
        return self.text or self.name


def parse_arguments(name: str, text: str) -> Call:
    """`key=value,…`, the arguments of the recipe `name`; raises `InputError`."""
    source = f"_({text})"
    try:
        tree = ast.parse(source, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        tree = None
    if not isinstance(tree, ast.Call) or not isinstance(tree.func, ast.Name):
        wrong = "; a digest (#…) stands for a value that only Python can give" * ("#" in text)
        wrong += "; a bracket is missing" * (text.count("(") != text.count(")"))
        wanted = f"key=value, with commas between them and paths in quotes{wrong}"
        raise InputError(f"cannot read {show(text)}, the parameters of {name}: write {wanted}")
    return _call(name, tree, source)


def call_of(value: Mapping[str, Any]) -> Call:
    """The recipe given by a table with a `name`; raises `InputError`."""
    named = {str(key): one for key, one in value.items()}
    name = named.pop("name", None)
    if not isinstance(name, str):
        raise InputError(
            f"a table that describes a recipe needs a text as its name; got {show(value)}"
        )
    return Call(name, named=named)


def read(
    title: str, value: Any, kinds: Mapping[str, Callable[..., Any]], nothing: Sequence[str] = ()
) -> Any:
    """The recipe that a text or table stands for; any other value is returned unchanged.

    Args:
        title: what messages call the recipe.
        value: such as "noisy(delay=0.1)"; a table needs no name if there is only one kind.
        kinds: word -> what makes the recipe of that name. Another word is an `InputError`.
        nothing: words that mean None.
    """
    if isinstance(value, Mapping):
        value = call_of({**({"name": next(iter(kinds))} if len(kinds) == 1 else {}), **value})
    if isinstance(value, str) and "(" in value:
        (value,) = parse_arguments(title, value).places or (value,)
    call = Call(value) if isinstance(value, str) else value
    if not isinstance(call, Call):
        return value
    word = choice(title, call.name.lower(), (*kinds, *nothing))
    return None if word in nothing else build(f"{title}={word}", kinds[word], call)


def build(title: str, make: Callable[..., Any], call: Call) -> Any:
    """Call `make`, a class or function, with the arguments of `call`; messages call it `title`.

    Declared parameters (`minisim.parameters`) take words and nested recipes; other values must fit
    a simple annotation. Raises `InputError` for an unknown parameter or a value not allowed.
    """
    try:
        signature = inspect.signature(make)
    except (TypeError, ValueError) as error:
        raise InputError(f"{title} cannot be made from parameters: {error}") from None
    given = bound(title, signature, call.places, call.named)
    if not any(field.metadata for field in getattr(make, "__dataclass_fields__", {}).values()):
        hints = _hints(make)
        for name, value in given.arguments.items():
            _check_simple(f"{name} of {title}", hints.get(name), value)
    try:
        return make(*given.args, **given.kwargs)
    except MinisimError as error:
        raise InputError(f"{title}: {error}") from None
    except (Exception, SystemExit) as error:  # the caller's own class may raise anything
        raise InputError(f"{title} cannot be made: {type(error).__name__}: {error}") from error


def bound(
    title: str, signature: inspect.Signature, places: Sequence[Any], named: Mapping[str, Any]
) -> inspect.BoundArguments:
    """The arguments by parameter; `InputError` for an unknown, missing or surplus one."""
    taken = [it for it in signature.parameters.values() if it.kind not in _VARIABLE]
    names = [it.name for it in taken]
    if inspect.Parameter.VAR_KEYWORD not in {it.kind for it in signature.parameters.values()}:
        for key in named:
            if not names:
                raise InputError(f"{title} has no parameters, got {key}")
            choice(f"{title} parameter", key, names)
    try:
        given = signature.bind_partial(*places, **named)
    except TypeError as error:
        raise InputError(f"{title}: {error}") from None
    missing = [it.name for it in taken if it.default is it.empty and it.name not in given.arguments]
    if missing:
        written = f"; write {title}({'=…,'.join(missing)}=…)" if {*title} & {*":="} else ""
        raise InputError(f"{title} needs {' and '.join(missing)}{written}")
    return given


def _hints(make: Callable[..., Any]) -> dict[str, Any]:
    """Annotations by parameter; empty if one of them cannot be resolved."""
    try:
        of = vars(make).get("__init__", make) if isinstance(make, type) else make
        return typing.get_type_hints(of)
    except Exception:  # the annotations are the caller's own, and may be anything
        return {}


def _check_simple(title: str, hint: Any, value: Any) -> None:
    """Check a value that is annotated as float, int, str or bool, or as a union of these."""
    if isinstance(value, Call):
        raise InputError(f"{title} has no recipe {value}; a text that looks like one needs quotes")
    union = typing.get_origin(hint) in (typing.Union, types.UnionType)
    kinds = typing.get_args(hint) if union else (hint,)
    if any(kind not in (*_SIMPLE, types.NoneType) for kind in kinds):
        return
    if not any(
        isinstance(value, (float, int) if kind is float else kind)
        for kind in kinds
        if (kind is bool) == isinstance(value, bool)  # True is not a number here
    ):
        names = " or ".join(map(kind_word, kinds))
        raise InputError(f"{title} must be {names}, got {show(value)}")


def _call(name: str, node: ast.Call, source: str) -> Call:
    named: dict[str, Any] = {}
    for keyword in node.keywords:
        if keyword.arg is None:
            raise _unreadable(name, keyword.value, source)
        if keyword.arg in named:
            raise InputError(f"{name} is given {keyword.arg} twice")
        named[keyword.arg] = _parsed(name, keyword.value, source)
    places = tuple(_parsed(name, argument, source) for argument in node.args)
    *_, last = "", *(_written(it, source) for it in (*node.args, *node.keywords))
    if last and "," in _written(node, source).rpartition(last)[2]:
        raise InputError(f"the parameters of {name} end with a comma; leave it out")
    inner = _written(node, source).partition("(")[2]
    return Call(name, places, named, f"{name}({inner}")


def _parsed(name: str, node: ast.expr, source: str) -> Any:
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
            return tuple(_parsed(name, element, source) for element in elements)
        case ast.Call(func=ast.Name(id=inner)):
            return _call(inner, node, source)
    raise _unreadable(name, node, source)


def _written(node: ast.AST, source: str) -> str:
    return ast.get_source_segment(source, node) or ""


def _unreadable(name: str, node: ast.expr, source: str) -> InputError:
    return InputError(
        f"cannot read {show(_written(node, source))} among the parameters of {name}: values are "
        "numbers, words, quoted texts such as 'my/file.csv', lists in brackets, and recipes such "
        "as noisy(delay=0.1)"
    )
