"""Keys of recipes, by which a store tells runs apart."""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from functools import cache
from numbers import Integral, Real
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from minisim.errors import InputError, show
from minisim.version import __version__
from scenarios.recipe import Recipe

#: Raise it by one when recipes give different rows while the version of the package stays the same.
#: Stored rows are then computed again.
RESULTS = 10

#: Packages whose changes `RESULTS` counts.
OURS = ("minisim", "dim", "baselines", "scenarios")


def results_version() -> str:
    """The version of rows; they depend on it and on their recipe."""
    return f"{__version__}/{RESULTS}"


def description_of(recipe: Recipe) -> str:
    """Every parameter as JSON, equal for equal recipes; raises `InputError` as `canonical`."""
    return json.dumps(canonical(recipe), separators=(",", ":"), allow_nan=True)


def key_of(recipe: Recipe) -> str:
    """The key of a recipe in a store; raises `InputError` as `canonical`."""
    return digest_of(description_of(recipe))


def content_of(recipe: Recipe) -> str | None:
    """A digest of all but label, seed and recorded arrivals; None if it cannot be described."""
    scenario = recipe.scenario
    if scenario.recorded is not None:
        scenario = replace(scenario, recorded=None)
    try:
        return digest_of(json.dumps(canonical([scenario, recipe.driven])))[:16]
    except InputError:
        return None


def digest_of(description: str) -> str:
    """SHA-256 of a description."""
    return hashlib.sha256(description.encode()).hexdigest()


def canonical(value: object) -> Any:
    """The parameters of a recipe as JSON values, equal for equal recipes.

    Dataclasses become their class and fields; those that are not ours also the version of their
    code (`_code`). Other objects do too, with their attributes for fields, if their class has a
    `version`. Numbers become floats, since 350 and 350.0 are the same density. Arrays become
    their type, shape and SHA-256. Raises `InputError` for a value of another kind.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if type(value) is float or isinstance(value, Integral | Real):  # the first is faster
        number = float(value)
        return number + 0.0 if number == value or math.isnan(number) else str(value)  # no -0.0
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufU":
        plain = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
        digest = hashlib.sha256(plain.tobytes()).hexdigest()
        return {"array": plain.dtype.str, "shape": list(plain.shape), "sha256": digest}
    kind: Any = type(value)
    named = _fields(kind)
    if named is None and isinstance(getattr(kind, "version", None), str | int):
        named = tuple(vars(value)) if hasattr(value, "__dict__") else None
    if named is not None:
        told = {name: canonical(getattr(value, name)) for name in named}
        return {"class": f"{kind.__module__}.{kind.__qualname__}", **_code(kind), **told}
    if inspect.isfunction(value):
        code = _code(value)
        return {
            "function": f"{value.__module__}.{value.__qualname__}",
            "defaults": canonical([value.__defaults__, value.__kwdefaults__]),
            "encloses": canonical([cell.cell_contents for cell in value.__closure__ or ()]),
            **(code if "version" in code else {"rule": _rule(value), **code}),
        }
    if isinstance(value, tuple | list):
        return [canonical(item) for item in value]
    if isinstance(value, Mapping):
        pairs = [[canonical(key), canonical(item)] for key, item in value.items()]
        return {"mapping": sorted(pairs, key=json.dumps)}
    if isinstance(value, set | frozenset):
        return {"set": sorted((canonical(item) for item in value), key=json.dumps)}
    raise InputError(
        f"{show(value)} cannot be stored: {type(value).__qualname__} is not a dataclass, so its "
        "parameters are unknown; make it a frozen dataclass, whose fields are numbers, texts, "
        "functions, arrays, other dataclasses, and collections of them, or give it a `version`"
    )


@cache
def _fields(kind: type) -> tuple[str, ...] | None:
    """Names of the fields of a dataclass; None of another class."""
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else None


def _rule(function: FunctionType) -> str:
    """A digest of a function's instructions, constants and plain globals: lambdas share a name."""

    def told(code: CodeType) -> list[Any]:
        known = {name: function.__globals__.get(name) for name in code.co_names}
        return [
            code.co_code, code.co_names, [constant(value) for value in code.co_consts],
            {name: it for name, it in known.items() if isinstance(it, bool | int | float | str)},
        ]  # fmt: skip

    def constant(value: object) -> Any:
        if isinstance(value, CodeType):
            return told(value)
        return sorted(map(repr, value)) if isinstance(value, frozenset) else value

    return digest_of(repr(told(function.__code__)))


@cache
def _code(kind: type | FunctionType) -> dict[str, Any]:
    """The `version` of a class or function, or else a digest of its modules' text.

    It is empty for our own classes, whose changes `RESULTS` counts. The rules of a controller are
    usually in its session, so the whole file counts, but not what it imports. Raises `InputError`
    if there is neither a version nor a file, or if a function made a class without a version.
    """
    modules = sorted({
        parent.__module__
        for parent in (kind.__mro__ if isinstance(kind, type) else (kind,))
        if parent.__module__.partition(".")[0] not in sys.stdlib_module_names | {*OURS}
    })  # fmt: skip
    if not modules:
        return {}
    version = getattr(kind, "version", None)
    if isinstance(version, str | int):
        return {"version": canonical(version)}
    if isinstance(kind, type) and "<locals>" in kind.__qualname__:
        raise InputError(
            f"{kind.__qualname__} cannot be stored: a function makes this class, perhaps with "
            "values that are not in its fields; move it to the top of its module, or give it a "
            "`version` that says what it was made with"
        )
    try:
        texts = "".join(inspect.getsource(sys.modules[name]) for name in modules)
    except (OSError, TypeError, KeyError) as error:
        raise InputError(
            f"{kind.__qualname__} cannot be stored: its code is not in a file, so a change would "
            "go unnoticed; give it a text or an integer `version`"
        ) from error
    return {"code": hashlib.sha256(texts.encode()).hexdigest()}
