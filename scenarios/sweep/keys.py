"""Keys of recipes: what tells one run from another in a store."""

from __future__ import annotations

import hashlib
import inspect
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from numbers import Integral, Real
from types import FunctionType
from typing import Any

import numpy as np

from minisim.errors import InputError, show
from minisim.version import __version__
from scenarios.recipe import Recipe

#: Raised by one when the same recipe gives another row than before, while the version of the
#: package stays: rows of older results are then computed again.
RESULTS = 3

#: Packages whose code `RESULTS` speaks for.
OURS = ("minisim", "dim", "baselines", "scenarios")


def results_version() -> str:
    """What rows depend on besides their recipe."""
    return f"{__version__}/{RESULTS}"


def description_of(recipe: Recipe) -> str:
    """Every parameter as JSON: two recipes are the same when their descriptions are.

    Raises:
        InputError: a controller that is not made of dataclasses, numbers, texts and arrays.
    """
    return json.dumps(canonical(recipe), separators=(",", ":"), allow_nan=True)


def key_of(recipe: Recipe) -> str:
    """The name of a recipe in a store; raises `InputError` as `description_of`."""
    return digest_of(description_of(recipe))


def digest_of(description: str) -> str:
    """SHA-256 of a description."""
    return hashlib.sha256(description.encode()).hexdigest()


def canonical(value: object) -> Any:
    """The parameters of a recipe as JSON values, alike for equal recipes.

    Dataclasses become their class and fields, with what tells versions of their code apart where
    they are not ours (`_code`). Numbers become floats, since 350 and 350.0 are the same density.
    Arrays become their type, shape and SHA-256.

    Raises:
        InputError: anything else: it could not be looked up again.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Integral | Real):
        return _canonical_number(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        plain = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
        digest = hashlib.sha256(plain.tobytes()).hexdigest()
        return {"array": plain.dtype.str, "shape": list(plain.shape), "sha256": digest}
    if is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        return {
            "class": f"{kind.__module__}.{kind.__qualname__}",
            **_code(kind),
            **{field.name: canonical(getattr(value, field.name)) for field in fields(value)},
        }
    if inspect.isfunction(value):
        return {
            "function": f"{value.__module__}.{value.__qualname__}",
            "line": value.__code__.co_firstlineno,  # tells two lambdas apart
            "defaults": canonical([value.__defaults__, value.__kwdefaults__]),
            "encloses": canonical([cell.cell_contents for cell in value.__closure__ or ()]),
            **_code(value),
        }
    if isinstance(value, tuple | list):
        return [canonical(item) for item in value]
    if isinstance(value, Mapping):
        pairs = [[canonical(key), canonical(item)] for key, item in value.items()]
        return {"mapping": sorted(pairs, key=json.dumps)}
    if isinstance(value, set | frozenset):
        return {"set": sorted((canonical(item) for item in value), key=json.dumps)}
    raise InputError(
        f"{show(value)} cannot be stored: recipes are made of dataclasses, numbers, texts, "
        "functions, arrays and collections of them"
    )


@cache
def _code(kind: type | FunctionType) -> dict[str, Any]:
    """What tells versions of a class or function apart: its `version`, or the text of its modules.

    Nothing for our own classes, for which `RESULTS` speaks. The rules of a controller are usually
    in its session, so the whole file counts; what that imports does not.

    Raises:
        InputError: no version, and no file, as in an interactive session.
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
    try:
        texts = "".join(inspect.getsource(sys.modules[name]) for name in modules)
    except (OSError, TypeError, KeyError) as error:
        raise InputError(
            f"{kind.__qualname__} cannot be stored: its code is in no file, so that a change would "
            "go unnoticed; give it a text or an integer `version`"
        ) from error
    return {"code": hashlib.sha256(texts.encode()).hexdigest()}


def _canonical_number(value: Real | Integral) -> float | str:
    number = float(value)
    return number + 0.0 if number == value or math.isnan(number) else str(value)
