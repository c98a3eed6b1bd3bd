"""`njit`: numba's compiler, or plain Python where numba is missing or switched off.

Switch it off with the environment variable `MINISIM_JIT=0`: every kernel then runs as the
Python that stands in the file, step by step in a debugger if need be.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Literal, TypeVar, cast

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
    """Compile `function` (cached on disk), or return it as it is."""
    return _compile(function, inline="never")


def njit_inline(function: _F) -> _F:
    """The same for a helper of the inner loop, pasted into its compiled callers.

    LLVM alone does not, and every call would hand over `Law` field by field and count a
    reference to each array: that takes longer than the arithmetic.
    """
    return _compile(function, inline="always")


def _compile(function: _F, inline: Literal["never", "always"]) -> _F:
    if not COMPILED:
        return function
    import numba

    compiler = numba.njit(cache=True, error_model="numpy", inline=inline)
    return cast(_F, compiler(function))
