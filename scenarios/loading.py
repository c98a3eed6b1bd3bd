"""Classes of the caller's own, named `module:Class`, from the working directory or installed.

Python finds a module of the working directory only where that is on the search path, and a worker
process does not have it there. So it is put there for as long as the module is imported, and
objects of the module's classes are pickled with the folder that they came from.
"""

from __future__ import annotations

import copyreg
import importlib
import io
import pickle
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from minisim.errors import InputError, choice

#: File -> its text when it was last imported here.
_texts: dict[Path, bytes] = {}


def load_class(module: str, name: str) -> type:
    """A class by the name of its module, or the path of its file, and its own name.

    Raises:
        InputError: no such module or class, or one that cannot be imported; the message names file
            and line where there is one.
    """
    file = _file_of(module)
    loaded = _imported(module) if file is None else _from_file(*file)
    kind = getattr(loaded, name, None)
    if isinstance(kind, type):
        return kind
    classes = [
        key for key, value in vars(loaded).items()
        if isinstance(value, type) and not key.startswith("_")
    ]  # fmt: skip
    if classes:
        choice(f"class of {module}", name, classes)
    raise InputError(f"{module} has no class {name!r}, and no other either")


def _file_of(module: str) -> tuple[Path, str] | None:
    """The folder to import from and the module's name there; None where it is elsewhere.

    Raises:
        InputError: a path to no file.
    """
    if module.endswith(".py"):
        path = Path(module)
        if not path.is_file():
            raise InputError(f"cannot read {module}: no such file")
        return path.absolute().parent, path.stem
    return (Path.cwd(), module) if _source(Path.cwd(), module).is_file() else None


def _imported(module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise InputError(
                f"no module {module!r}: there is no {module.replace('.', '/')}.py in the working "
                "directory, and none of that name is installed"
            ) from None
        raise InputError(f"cannot import {module}: {_told(error)}") from error


def _from_file(folder: Path, name: str) -> ModuleType:
    """Import a module of a folder; again where its text has changed."""
    file = _source(folder, name)
    try:
        text = file.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror}") from None
    known = sys.modules.get(name)
    _check_own(known, file)
    if known is not None and _texts.get(file, text) == text:
        return known
    with _found_in(folder):
        try:
            module = importlib.reload(known) if known else importlib.import_module(name)
        except (Exception, SystemExit) as error:
            raise InputError(f"cannot import {name}: {_told(error, folder)}") from error
    _check_own(module, file)
    _texts[file] = text
    for kind in vars(module).values():
        if isinstance(kind, type) and kind.__module__ == name:
            copyreg.pickle(kind, _Reduce(folder, name))
    return module


def _source(folder: Path, name: str) -> Path:
    """The file of a module."""
    place = folder.joinpath(*name.split("."))
    package = place / "__init__.py"
    return package if package.is_file() else place.with_name(f"{place.name}.py")


def _check_own(module: ModuleType | None, file: Path) -> None:
    """Raise `InputError` where a module is not the one of the file."""
    origin = getattr(module, "__file__", None) or ""
    if module is not None and Path(origin).resolve() != file.resolve():
        raise InputError(
            f"{file} has the name of another module, {module.__name__}; rename the file"
        )


@contextmanager
def _found_in(folder: Path) -> Iterator[None]:
    """The folder is where Python looks first. No byte code: its age is known to a second only."""
    before, written = list(sys.path), sys.dont_write_bytecode
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:] = before
        sys.dont_write_bytecode = written


def _told(error: BaseException, folder: Path = Path("/")) -> str:
    """What went wrong, and the last line of the folder's files that led there."""
    if isinstance(error, SyntaxError):
        return f"{Path(error.filename or '').name}, line {error.lineno}: SyntaxError: {error.msg}"
    lines = [
        f"{Path(frame.filename).name}, line {frame.lineno}: "
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).is_relative_to(folder)
    ]
    return f"{lines[-1] if lines else ''}{type(error).__name__}: {error}"


class _Reduce:
    """How objects of a folder's module are pickled: with the folder and the module's name."""

    def __init__(self, folder: Path, name: str) -> None:
        self._origin = str(folder), name

    def __call__(self, value: object) -> tuple[Any, ...]:
        buffer = io.BytesIO()
        pickler = pickle.Pickler(buffer, pickle.HIGHEST_PROTOCOL)
        pickler.dispatch_table = {
            kind: reduce
            for kind, reduce in copyreg.dispatch_table.items()
            if not (isinstance(reduce, _Reduce) and reduce._origin == self._origin)
        }
        pickler.dump(value)
        return _restored, (*self._origin, buffer.getvalue())


def _restored(folder: str, name: str, data: bytes) -> Any:
    """An object again, in this process or another on the same machine."""
    if name not in sys.modules:
        _from_file(Path(folder), name)
    return pickle.loads(data)
