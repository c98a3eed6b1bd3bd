"""A caller's own classes and metrics: `module:Name`, from the working directory or installed.

Python may not search the working directory, and a worker process never does. So the directory is
on the search path while one of its modules is imported, and objects of the module's classes and
its metrics are pickled together with their folder.
"""

from __future__ import annotations

import copyreg
import importlib
import io
import os
import pickle
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from minisim.errors import InputError, nearest, told
from minisim.results.asked import Asked, asked_metrics, listed, metric_of
from minisim.results.metric import Metric
from minisim.results.metrics import METRICS

#: File -> its text at the last import.
_texts: dict[Path, bytes] = {}


def load_class(module: str, name: str) -> type:
    """A class, given its own name and the name of its module or the path of its file.

    `InputError` for no such module or class, or one that cannot be imported, with file and line.
    """
    loaded = _module(*_place(module))
    kind = getattr(loaded, name, None)
    if isinstance(kind, type):
        return kind
    raise _missing(module, name, "controller", _controllers(loaded))


def controllers_in(module: str) -> list[str]:
    """The names of the controllers that a module defines; raises `InputError` as `load_class`."""
    return _controllers(_module(*_place(module)))


def has_source(module: str) -> bool:
    """Whether this is the path of a file, or a module in the working directory."""
    return os.path.isfile(module) or os.path.isfile(_source(Path.cwd(), module))


def is_maker(kind: type) -> bool:
    """Whether a class can make controllers, as far as it shows."""
    return hasattr(kind, "start") and not getattr(kind, "_is_protocol", False)


def _controllers(module: ModuleType) -> list[str]:
    """Those that the module or its parts define, not what it imports from elsewhere."""
    names = getattr(module, "__all__", vars(module))  # a package may load them on first use
    return [
        key for key, value in ((name, getattr(module, name, None)) for name in names)
        if isinstance(value, type) and is_maker(value) and not key.startswith("_")
        and f"{value.__module__}.".startswith(f"{module.__name__}.")
    ]  # fmt: skip


def metrics_named(metrics: str | Iterable[Asked]) -> tuple[str | Metric, ...]:
    """The metrics asked for, ours by name; `module:name` is a caller's; raises `InputError`."""
    asked = asked_metrics(_loaded(it) for it in listed(metrics))
    return tuple(it.name if it.name in METRICS else it for it in asked)


def _loaded(metric: Asked) -> Asked:
    if not isinstance(metric, str) or ":" not in metric:
        return metric
    module, name = metric.rsplit(":", 1)
    return _metric(*_place(module), name)


def _metric(folder: str, module: str, name: str) -> Metric:
    """A metric by its place, in this process or in another one on the same machine."""
    loaded = _module(folder, module)
    made = getattr(loaded, name, None)
    if not isinstance(made, Metric | FunctionType):
        public = {key: it for key, it in vars(loaded).items() if not key.startswith("_")}
        others = [key for key, it in public.items() if isinstance(it, Metric | FunctionType)]
        raise _missing(module, name, "metric", others)
    metric = made if isinstance(made, Metric) else metric_of(made)
    object.__setattr__(metric, "place", (folder, module, name))
    return metric


def _pickled_metric(metric: Metric) -> Any:
    place = getattr(metric, "place", None)
    return object.__reduce_ex__(metric, 4) if place is None else (_metric, place)


copyreg.pickle(Metric, _pickled_metric)


def _missing(module: str, name: str, what: str, others: list[str]) -> InputError:
    """What is wrong if a module has nothing of this name, and which of the others is nearest."""
    if not others:
        return InputError(f"{module} has no {name!r}, and no other {what} either")
    allowed = f"allowed: {', '.join(others)}{nearest(name, others)}"
    return InputError(f"unknown {what} of {module} {name!r}; {allowed}")


def _module(folder: str, name: str) -> ModuleType:
    return _from_file(Path(folder), name) if folder else _imported(name)


def _place(module: str) -> tuple[str, str]:
    """The folder of a module or of the path of its file, "" if installed, and its name."""
    if module.endswith(".py"):
        path = Path(module)
        if not os.path.isfile(path):
            raise InputError(f"cannot read {module}: no such file")
        return str(path.absolute().parent), path.stem
    return str(Path.cwd()) if os.path.isfile(_source(Path.cwd(), module)) else "", module


def _imported(module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except (Exception, SystemExit) as error:
        if isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(f"{error.name}."):
            raise InputError(
                f"no module {module!r}: there is no {module.replace('.', '/')}.py in the working "
                "directory, and none of that name is installed"
            ) from None
        raise InputError(f"cannot import {module}: {told(error)}") from error


def _from_file(folder: Path, name: str) -> ModuleType:
    """Import a module from a folder, and again if its text has changed."""
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
            raise InputError(f"cannot import {name}: {told(error, folder)}") from error
    _check_own(module, file)
    _texts[file] = text
    for kind in vars(module).values():
        if isinstance(kind, type) and kind.__module__ == name:
            copyreg.pickle(kind, partial(_pickled, str(folder), name))
    return module


def _source(folder: Path, name: str) -> Path:
    place = folder.joinpath(*name.split("."))
    package = place / "__init__.py"
    return package if package.is_file() else place.with_name(f"{place.name}.py")


def _check_own(module: ModuleType | None, file: Path) -> None:
    """Raise `InputError` if a module was imported from another file."""
    origin = getattr(module, "__file__", None) or ""
    if module is not None and Path(origin).resolve() != file.resolve():
        raise InputError(f"{file} has the name of another module, {module.__name__}; rename it")


@contextmanager
def _found_in(folder: Path) -> Iterator[None]:
    """Search the folder first, and write no bytecode: Python checks its age only to a second."""
    before, written = list(sys.path), sys.dont_write_bytecode
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path[:] = before
        sys.dont_write_bytecode = written


def _pickled(folder: str, name: str, value: object) -> tuple[Any, ...]:
    """Pickle an object of a module together with the module's folder and name."""
    buffer = io.BytesIO()
    pickler = pickle.Pickler(buffer, pickle.HIGHEST_PROTOCOL)
    pickler.dispatch_table = {
        kind: reduce for kind, reduce in copyreg.dispatch_table.items() if kind.__module__ != name
    }
    pickler.dump(value)
    return _restored, (folder, name, buffer.getvalue())


def _restored(folder: str, name: str, data: bytes) -> Any:
    """The object, in this process or in another one on the same machine."""
    if name not in sys.modules:
        _from_file(Path(folder), name)
    return pickle.loads(data)
