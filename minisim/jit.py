"""`njit`: numba's compiler, or plain Python if numba is missing or switched off.

The environment variable `MINISIM_JIT=0` switches it off, so that a debugger can follow.

Compiled code is cached on disk. It contains the functions that it calls and the constants that it
reads, from any module, but numba checks only the file of the function itself. Our cache recompiles
when any source in the function's folder or in this one changes.
"""

from __future__ import annotations

import hashlib
import inspect
import os
from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

_F = TypeVar("_F", bound=Callable[..., object])


def _enabled() -> bool:
    if os.environ.get("MINISIM_JIT", "1") == "0":
        return False
    try:
        import numba
    except ImportError:
        return False
    return not getattr(numba.config, "DISABLE_JIT", False)


#: Whether kernels are compiled in this process.
COMPILED = _enabled()


def njit(function: _F) -> _F:
    """Compile `function` (cached on disk), or return it unchanged.

    Compiled code must not allocate: it does not count references to arrays, which would take longer
    than the arithmetic.
    """
    return _compile(function, inline="never")


def njit_inline(function: _F) -> _F:
    """The same for a helper in the inner loop, which is pasted into its compiled callers.

    LLVM does not do so, and a call that passes `Law` field by field costs more than the arithmetic.
    """
    return _compile(function, inline="always")


def allocating(function: _F) -> _F:
    """`njit` for a function that makes arrays."""
    return _compile(function, inline="never", counting=True)


def direct(
    function: Callable[..., Any], kind: Hashable, arguments: Sequence[object]
) -> Callable[..., Any]:
    """`function` for arguments of exactly these types, which are not checked again.

    Arguments of one `kind` always have the same types. numba looks at every field of every argument
    at each call, which for the kernel takes three times as long as the call itself.
    """
    if not COMPILED:
        return function
    if (function, kind) not in _ENTRIES:
        import numba

        compiled: Any = function
        _ENTRIES[function, kind] = compiled.compile(tuple(map(numba.typeof, arguments)))
    return _ENTRIES[function, kind]


_ENTRIES: dict[tuple[object, Hashable], Callable[..., Any]] = {}


def _compile(function: _F, inline: Literal["never", "always"], counting: bool = False) -> _F:
    if not COMPILED:
        return function
    import numba

    options: dict[str, Any] = {"error_model": "numpy", "inline": inline, "_nrt": counting}
    compiled: Any = numba.njit(**options)(function)
    compiled._cache = _cache_class()(function)  # what `cache=True` does, with our class
    return cast(_F, compiled)


@lru_cache
def _cache_class() -> Any:
    import numba
    from numba.core.caching import FunctionCache

    class SourcesCache(FunctionCache):
        """numba's cache on disk, valid only as long as none of our sources changes."""

        def __init__(self, function: Callable[..., object]) -> None:
            super().__init__(function)  # type: ignore[no-untyped-call]  # numba has no types
            folder = Path(inspect.getfile(function)).parent
            sources = numba.__version__, _digest(folder), _digest(Path(__file__).parent)
            # If the version differs, numba does not read the rest, whose classes may be gone.
            self._cache_file._version = self._cache_file._source_stamp = sources

    return SourcesCache


@lru_cache
def _digest(folder: Path) -> bytes:
    """Digest of all Python sources in a folder and its subfolders, as they are on disk now."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        name = file.relative_to(folder).as_posix().encode()
        digest.update(name + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return digest.digest()
