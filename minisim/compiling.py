"""Tells a user at a terminal that compiling takes long, before anything large is loaded."""

from __future__ import annotations

import os
import sys
from functools import lru_cache
from importlib.util import find_spec
from multiprocessing import parent_process
from pathlib import Path


def switched_off() -> bool:
    """Whether the user wants kernels to stay plain Python (`MINISIM_JIT=0`)."""
    return os.environ.get("MINISIM_JIT", "1") == "0"


@lru_cache
def announce() -> None:
    """Tell it, once in this process."""
    if parent_process() is None and sys.stderr is not None and sys.stderr.isatty():
        sys.stderr.write("minisim: compiling, once after installation; this takes a while\n")


def announce_if_new() -> None:
    """Tell it if nothing is compiled yet, before numba is loaded, which alone takes a while."""
    if switched_off() or find_spec("numba") is None:
        return
    sources = Path(__file__).parent / "engine"
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        kept = Path(chosen).glob(f"*/{_KERNEL}")
    elif os.access(sources, os.W_OK):
        kept = sources.glob(f"__pycache__/{_KERNEL}")
    else:  # numba keeps it elsewhere
        return
    if not any(kept):
        announce()


#: Names of numba's indices of the compiled kernel, for this Python.
_KERNEL = f"kernel.advance-*.py3{sys.version_info.minor}*.nbi"
