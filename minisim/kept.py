"""Compiled code on disk, which outlives no source that it was compiled from.

It contains the functions that it calls and the constants that it reads, from any module, but numba
checks only the file of the function itself. Our cache recompiles when any source in the function's
folder or in this one changes.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from minisim.apart import Function, wait_for
from minisim.compiling import announce


@lru_cache
def cache_class() -> Any:
    """The class of the cache; numba is loaded only when it is needed."""
    import numba
    from numba.core.caching import FunctionCache, IndexDataCacheFile
    from numba.core.runtime.nrt import rtsys

    class Files(IndexDataCacheFile):
        """An index, and the code for each signature, which several processes may write at once.

        numba numbers the codes, and writes the index first: who reads meanwhile gets the code of
        older sources, or of another signature.
        """

        def save(self, key: Any, data: Any) -> None:
            """Write the code, under a name that no other code has, then the index."""
            own: Any = self  # numba has no types
            kept = own._load_index()
            if not kept:
                self._remove_old()
            digest = hashlib.sha256(repr((self._source_stamp, key)).encode()).digest()
            name = own._data_name(int.from_bytes(digest[:8]))
            own._save_data(name, data)
            own._save_index({**kept, key: name})

        def _remove_old(self) -> None:
            for old in Path(self._cache_path).glob(f"{Path(self._index_name).stem}.*.nbc"):
                old.unlink(missing_ok=True)

    class SourcesCache(FunctionCache):
        """numba's cache on disk, valid only as long as none of our sources changes."""

        def __init__(self, function: Function, apart: Sequence[Function]) -> None:
            super().__init__(function)  # type: ignore[no-untyped-call]  # numba has no types
            self._apart, self._parameters = apart, list(inspect.signature(function).parameters)
            self.begin: Callable[[Sequence[tuple[Function, Any]]], None] = lambda _: None
            folder = Path(inspect.getfile(function)).parent
            sources = numba.__version__, digest_of(folder), digest_of(Path(__file__).parent)
            make: Any = Files
            files = make(self._cache_path, self._impl.filename_base, sources)
            files._version = sources  # where it differs, numba does not read classes that are gone
            self._cache_file = files

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            """The code on disk; None if there is none, and it has to be compiled."""
            # numba's would first load what only its compiler needs, all of scipy.linalg included.
            rtsys.initialize(target_context)  # for code that makes arrays
            own: Any = self
            wait_for(own._py_func)
            with own._guard_against_spurious_io_errors():
                found = own._load_overload(sig, target_context)
            if found is None:
                announce()
                self.begin([(part, self._types(part, sig)) for part in self._apart])
            return found

        def _types(self, part: Function, sig: Sequence[Any]) -> tuple[Any, ...]:
            types = dict(zip(self._parameters, sig, strict=True))
            return tuple(types[name] for name in inspect.signature(part).parameters)

    return SourcesCache


@lru_cache
def digest_of(folder: Path) -> bytes:
    """Digest of all Python sources in a folder and its subfolders, as they are on disk now."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        name = file.relative_to(folder).as_posix().encode()
        digest.update(name + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return digest.digest()
