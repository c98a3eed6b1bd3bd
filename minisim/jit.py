"""`njit`: numba's compiler, or plain Python if numba is missing or switched off.

The environment variable `MINISIM_JIT=0` switches it off, so that a debugger can follow.

Compiled code is kept on disk (`minisim.kept`).
"""

from __future__ import annotations

import gc
import warnings
from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from importlib import import_module
from typing import Any, TypeVar, cast

from minisim.apart import Function, elsewhere
from minisim.compiling import switched_off
from minisim.kept import cache_class

_F = TypeVar("_F", bound=Function)


def _enabled() -> bool:
    if switched_off():
        return False
    try:
        import numba
    except ImportError:
        return False
    return not getattr(numba.config, "DISABLE_JIT", False)


#: Whether kernels are compiled in this process.
COMPILED = _enabled()


def njit(function: _F) -> _F:
    """Compile `function` (cached on disk), or return it unchanged. For functions called by Python.

    Compiled code must not allocate: it does not count references to arrays, which would take longer
    than the arithmetic.
    """
    return _compile(function)


def njit_with(*apart: Function) -> Callable[[_F], _F]:
    """`njit` for a function with large parts, which are `njit_apart`, in the order of their calls.

    Where there is a second core, a second process compiles them meanwhile. The function hands its
    arguments on to them under the same names.
    """

    def decorate(function: _F) -> _F:
        return _compile(function, apart)

    return decorate


def njit_apart(function: _F) -> _F:
    """`njit_inline` for a part of `njit_with`, which is compiled and cached by itself."""
    return _compile(function, forceinline=True)


def njit_inner(function: _F) -> _F:
    """The same for a function that compiled code calls; called by Python, it runs uncompiled.

    It is compiled, and cached, only as a part of its callers: in half of the time.
    """
    return _inner(function)


def njit_inline(function: _F) -> _F:
    """`njit_inner` for a helper in the inner loop, which becomes part of its compiled callers.

    LLVM does not choose to do so, and a call that passes `Law` field by field costs more than the
    arithmetic.
    """
    return _inner(function, forceinline=True)


def allocating(function: _F) -> _F:
    """`njit` for a function that makes arrays; other compiled code would never free them."""
    return _compile(function, _nrt=True)


def direct(
    function: Callable[..., Any], kind: Hashable, arguments: Sequence[object]
) -> Callable[..., Any]:
    """`function` for arguments of exactly these types, which are not checked again.

    Arguments of one `kind` always have the same types. numba looks at every field of every argument
    at each call, which for the kernel takes three times as long as the call itself.
    """
    if not (COMPILED and _known()):
        return function
    if (function, kind) not in _ENTRIES:
        import numba

        compiled: Any = function
        _ENTRIES[function, kind] = compiled.compile(tuple(map(numba.typeof, arguments)))
    return _ENTRIES[function, kind]


_ENTRIES: dict[tuple[object, Hashable], Callable[..., Any]] = {}


def _inner(function: _F, **options: object) -> _F:
    if not (COMPILED and _known()):
        return _compile(function)
    import numba

    parts, dispatcher = _inner_classes()
    chosen: dict[str, Any] = {**_OPTIONS, **options, "pipeline_class": parts}
    chosen |= dict.fromkeys(("no_cpython_wrapper", "no_cfunc_wrapper"), True)
    compiled: Any = numba.njit(**chosen)(function)
    compiled.__class__ = dispatcher
    return cast(_F, compiled)


@lru_cache
def _inner_classes() -> tuple[type, type]:
    """How functions that only compiled code calls are compiled, and what Python sees of them."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import Compiler
    from numba.core.registry import CPUDispatcher

    class Part(JITCodeLibrary):
        """Code that is optimised, and made machine code, as a part of its callers only.

        numba would do both for each function with all that it calls, again and again on the way up.
        """

        def _optimize_final_module(self) -> None:
            pass

        def _finalize_final_module(self) -> None:
            own: Any = self
            own._finalize_dynamic_globals()
            own._finalized = True

        def get_pointer_to_function(self, _name: str) -> int:
            own: Any = self
            own._ensure_finalized()
            return 0

        @property
        def codegen(self) -> Part:
            return self

        def set_env(self, name: str, environment: object) -> None:
            """Do nothing: it has no address."""

    class Parts(Compiler):
        """Compiles a function as a part."""

        def compile_extra(self, func: Callable[..., object]) -> Any:
            own: Any = self
            part: Any = Part
            own.state.library = part(own.state.targetctx.codegen(), func.__qualname__)
            extra: Any = super().compile_extra
            return extra(func)

    class Inner(CPUDispatcher):
        """A function that only compiled code can call compiled."""

        def __call__(self, *args: object, **kwargs: object) -> object:
            # numba would follow a null pointer.
            return self.py_func(*args, **kwargs)

    return Parts, Inner


def _compile(function: _F, apart: Sequence[Function] = (), **options: object) -> _F:
    if not COMPILED:
        return function
    import numba

    if not _known():
        return cast(_F, numba.njit(error_model="numpy")(function))
    chosen: dict[str, Any] = {**_OPTIONS, **options}
    compiled: Any = numba.njit(**chosen)(function)
    compiled.__class__ = _outer_class()
    compiled._cache = cache_class()(function, apart)  # what `cache=True` does, with our class
    return cast(_F, compiled)


@lru_cache
def _outer_class() -> type:
    """How functions that Python calls are compiled: without collecting garbage meanwhile.

    numba keeps nearly all that it makes until it is done, so a fifth of the time would go into
    looking through it.
    """
    from numba.core.registry import CPUDispatcher

    class Outer(CPUDispatcher):
        """A function that Python calls."""

        def compile(self, sig: Any) -> Any:
            own: Any = self
            collects = gc.isenabled()
            gc.disable()
            try:
                with elsewhere() as own._cache.begin:
                    return super().compile(sig)
            finally:
                if collects:
                    gc.enable()

    return Outer


_OPTIONS = {"error_model": "numpy", "_nrt": False}

#: What we use of numba that it does not document. Tried: numba 0.60.0 with NumPy 2.0.2, the oldest
#: that we allow, and 0.68.1 with 2.4.6.
_INNER_PARTS = {
    "caching.FunctionCache": ("_guard_against_spurious_io_errors", "_load_overload"),
    "caching.IndexDataCacheFile": ("_data_name", "_load_index", "_save_data", "_save_index"),
    "codegen.JITCodeLibrary": (
        "_ensure_finalized",
        "_finalize_dynamic_globals",
        "_finalize_final_module",
        "_optimize_final_module",
    ),
    "compiler.Compiler": ("compile_extra",),
    "cpu.CPUTargetOptions": ("_nrt", "forceinline", "no_cfunc_wrapper", "no_cpython_wrapper"),
    "registry.CPUDispatcher": ("compile",),
    "runtime.nrt.rtsys": ("initialize",),
}


@lru_cache
def _known() -> bool:
    """Whether this numba has all of them; without them it gives the same runs, more slowly."""
    import numba

    try:
        for name, parts in _INNER_PARTS.items():
            module, _, owner = name.rpartition(".")
            for part in parts:
                getattr(getattr(import_module(f"numba.core.{module}"), owner), part)
    except (ImportError, AttributeError):
        told = f"minisim does not know numba {numba.__version__}: each process compiles anew"
        warnings.warn(told, stacklevel=2)
        return False
    return True
