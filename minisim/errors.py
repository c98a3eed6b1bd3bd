"""What minisim raises, and the checks that turn bad input into one clear sentence.

A message names the value, its origin and what is allowed, so the command line prints it unchanged.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import traceback
from collections.abc import Callable, Iterable, Mapping, Set
from numbers import Integral, Real
from pathlib import Path
from typing import Any

#: The name to install minisim by: the package index has an unrelated project called minisim.
DISTRIBUTION = "minisim-traffic"

#: What users call values of these classes.
_WORDS: Mapping[type, str] = {
    bool: "true or false", int: "a whole number", float: "a number", str: "a text",
    type(None): "none",
}  # fmt: skip


class MinisimError(Exception):
    """Parent of everything minisim raises on purpose."""


class InputError(MinisimError, ValueError):
    """A value that a caller gave is not allowed."""


class FileError(MinisimError):
    """A file cannot be read or written, or its content is broken."""


class CollisionError(MinisimError):
    """Two bodies touched, and the run does not record that and go on.

    Attributes:
        collisions: the `minisim.engine.collision.Collision`s of the last step.
        replay: repeats the run until a little later and returns a `Run` with the trajectories of
            the last seconds, 10 by default. None on a copy from another process.
    """

    def __init__(
        self, text: str, collisions: tuple[Any, ...] = (), replay: Callable[..., Any] | None = None
    ) -> None:
        super().__init__(text)
        self.collisions = collisions
        self.replay = replay

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (*self.args, self.collisions)


class ControllerError(MinisimError):
    """A controller broke its contract (`minisim.control`)."""


class MissingExtraError(MinisimError):
    """An optional dependency is needed and not installed."""


def extra(name: str) -> str:
    """The command that installs an extra: one of the keys of `optional-dependencies`."""
    return f"pip install '{DISTRIBUTION}[{name}]'"


class ExecutorError(MinisimError):
    """An executor gave up on runs. They have not failed and may be tried again."""


class SumoError(MinisimError):
    """SUMO, or a tool that comes with it, refused or died."""


def number(
    name: str,
    value: object,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    below: float = math.inf,
) -> float:
    """Return `value` as a finite float inside [low, high] and (above, below), or raise.

    Raises:
        InputError: not a real number, not finite, or out of range.
    """
    # The usual case first, since every command is checked and `isinstance` with Real is slow.
    if type(value) is float and low <= value <= high and above < value < below:
        return value or 0.0  # not -0.0, which would be spelt in another way
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{name} must be a number, got {show(value)}")
    try:
        result = float(value)
    except OverflowError:
        raise InputError(f"{name} is too large: {show(value)}") from None
    if not math.isfinite(result):
        raise InputError(f"{name} must be a finite number, got {show(value)}")
    if not (low <= result <= high and above < result < below):
        words = ("at least", "at most", "above", "below")
        allowed = " and ".join(limits(low, high, above, below, words))
        raise InputError(f"{name} must be {allowed}, got {show(value)}")
    return result or 0.0


def limits(
    low: float, high: float, above: float, below: float, words: tuple[str, str, str, str]
) -> list[str]:
    """The finite limits of a range, each after its word or sign (≥, ≤, >, <)."""
    least = f"{words[2]} {above:g}" if above >= low else f"{words[0]} {low:g}"
    most = f"{words[3]} {below:g}" if below <= high else f"{words[1]} {high:g}"
    return [limit for limit in (least, most) if "inf" not in limit]


def integer(name: str, value: object, *, low: int, high: int | None = None) -> int:
    """Return `value` as an int inside [low, high], or raise `InputError`."""
    if type(value) is int or (isinstance(value, Integral) and not isinstance(value, bool)):
        result = int(value)
        if low <= result and (high is None or result <= high):
            return result
    allowed = f"an integer of at least {low}" if high is None else f"an integer {low} … {high}"
    raise InputError(f"{name} must be {allowed}, got {show(value)}")


def choice(name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of `allowed`; otherwise raise, suggesting the nearest one."""
    options = list(allowed)
    if isinstance(value, str) and value in options:
        return value
    known = f"{', '.join(options)}{nearest(value, options)}"
    raise InputError(f"unknown {name} {show(value)}; allowed: {known}")


def nearest(value: object, allowed: Iterable[str]) -> str:
    """A question that suggests the nearest of `allowed`, whatever its case; "" if none is near."""
    options = {option.casefold(): option for option in allowed}
    text = value.casefold() if isinstance(value, str) else ""
    close = difflib.get_close_matches(text, options, n=1, cutoff=0.5)
    return f"; did you mean {options[close[0]]!r}?" if close else ""


def instance(name: str, value: object, kind: type | tuple[type, ...]) -> None:
    """Raise `InputError` unless `value` is a `kind`.

    A class is not an instance of a protocol, even if it has the methods.
    """
    if not isinstance(value, kind) or isinstance(value, type):
        kinds = kind if isinstance(kind, tuple) else (kind,)
        wanted = " or ".join(map(kind_word, kinds))
        raise InputError(f"{name} must be {wanted}, got {show(value)}")


def kind_word(kind: type) -> str:
    """What messages call a value of this class, as a user would type it."""
    article = "an" if kind.__name__[0] in "AEIOaeio" else "a"
    return _WORDS.get(kind, f"{article} {kind.__name__}")


def plural(count: int, thing: str, several: str = "") -> str:
    """A count of things: "1 run", "2 runs"; `several` is their plural if that is not with an s."""
    return f"{count} {thing if count == 1 else several or f'{thing}s'}"


def printable(name: str, value: object, *, empty: bool = False) -> str:
    """Return `value` if it is a text of one line without control characters, or raise.

    `empty` says whether "" is allowed. Lone surrogates are refused, too.
    """
    if not isinstance(value, str):
        raise InputError(f"{name} must be a text, got {show(value)}")
    if not value.isprintable() or not (value or empty):
        wanted = "of one line, without control characters" if value else "that is not empty"
        raise InputError(f"{name} must be a text {wanted}, got {show(value)}")
    return value


def items(name: str, value: object, of: str, *, ordered: bool = True) -> list[Any]:
    """Return the items of `value`, or raise; `of` says what they are.

    Texts and mappings are refused, and so are sets if the items are `ordered`.
    """
    refused = str | bytes | Mapping | Set if ordered else str | bytes | Mapping
    if isinstance(value, Iterable) and not isinstance(value, refused):
        try:
            return list(value)
        except TypeError:  # a zero-dimensional array claims to be iterable
            pass
    raise InputError(f"{name} must be a sequence of {of}, got {show(value)}")


def numbers(name: str, value: object) -> tuple[float, ...]:
    """Return `value`, any sequence of finite numbers, as a tuple of floats, or raise."""
    given = items(name, value, "numbers")
    return tuple(number(f"{name}[{i}]", item) for i, item in enumerate(given))


def show(value: object) -> str:
    """`repr(value)` without addresses in memory, cut to 200 characters."""
    try:
        text = re.sub(r" at 0x[0-9A-Fa-f]+", "", repr(value))
    except ValueError:  # Python refuses to print integers of thousands of digits
        return f"a {type(value).__name__} too large to print"
    except (Exception, SystemExit) as error:  # a caller's code may raise anything
        return f"a {type(value).__name__} whose repr raises {type(error).__name__}"
    return text if len(text) <= 200 else f"{text[:200]}…"


def told(error: BaseException, folder: str | os.PathLike[str] = "/") -> str:
    """An error of a caller's own code, after the last line in the folder that led to it."""
    if isinstance(error, SyntaxError):
        return f"{Path(error.filename or '').name}, line {error.lineno}: SyntaxError: {error.msg}"
    lines = [
        f"{Path(frame.filename).name}, line {frame.lineno}: "
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).is_relative_to(folder)
    ]
    return f"{lines[-1] if lines else ''}{type(error).__name__}: {error}"
