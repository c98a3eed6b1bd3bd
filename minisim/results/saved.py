"""A run on disk: one zip file of JSON and Parquet, without pickle.

The file holds `run.json`, `trips.parquet`, `trace.parquet` and `rows.parquet`. It is written whole
or not at all. Zip's comment at its end is a digest of all before it, which reveals damage.

Objects of our own classes (`PACKAGES`) are written as class and fields, and come back as they
were; other scenarios and controllers as stand-ins. Reading imports only our own modules.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import io
import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, ClassVar, Final, NoReturn

import numpy as np
import pandas as pd

from minisim.errors import FileError, InputError, MissingExtraError, extra, instance, show
from minisim.files import read_file, replacing
from minisim.results.run import Run
from minisim.results.trips import TRIP_ARRAYS, Trips

#: The type of file, and the layout that this version writes.
MARK: Final = "minisim run"
LAYOUT: Final = 4

#: Packages whose classes are written as class and fields.
PACKAGES: Final = ("minisim", "dim", "baselines", "scenarios")

#: The fields of a run that hold plain values.
_VALUES: Final = (
    "seed", "site", "plan", "collisions", "record", "record_window", "counts", "exchange",
    "host", "environment", "reasons", "heads", "given",
)  # fmt: skip


@dataclass(frozen=True, repr=False)
class _StandIn:
    """What a scenario or controller was, but not how to run it again."""

    what: ClassVar[str]
    name: str
    text: str

    def __repr__(self) -> str:
        return self.text

    def refuse(self, *_: Any, **__: Any) -> NoReturn:
        """Stands in for each method; raises `InputError`."""
        raise InputError(
            f"{self.what} {self.name!r} was saved as a text and cannot be run again: {self.text}"
        )


@dataclass(frozen=True, repr=False)
class SavedController(_StandIn):
    """Stands in for a controller whose class is not ours."""

    what = "controller"
    start = _StandIn.refuse


@dataclass(frozen=True, repr=False)
class SavedScenario(_StandIn):
    """Stands in for a scenario whose class is not ours."""

    what = "scenario"
    profile_name: str
    density: float
    horizon: float
    warmup: float
    depart_speed: float | None
    site = arrivals = _StandIn.refuse


def save(run: Run, path: str | os.PathLike[str]) -> None:
    """Write a run; see `Run.save`."""
    instance("output file", path, (str, os.PathLike))
    _need_pyarrow()
    head = {
        "mark": MARK,
        "layout": LAYOUT,
        "provenance": run.provenance,  # for people; not read back
        "scenario": _written_or(run.scenario, SavedScenario),
        "controller": _written_or(run.controller, SavedController),
        **{name: written(getattr(run, name)) for name in _VALUES},
        "end": run.columns.end,
    }
    trips = {name: getattr(run.columns, name) for name in TRIP_ARRAYS}
    if run.kinds:
        trips["kind"] = run.kinds
    whole = io.BytesIO()
    with replacing(path) as part:
        with zipfile.ZipFile(whole, "w") as file:
            file.writestr("run.json", json.dumps(head, indent=1))
            for name, table in (("trips", trips), ("trace", run.trace), ("rows", run.rows)):
                file.writestr(f"{name}.parquet", _parquet(table))
            file.comment = _digest(b"")
        part.write_bytes(_signed(whole.getvalue()))


def load(path: str | os.PathLike[str]) -> Run:
    """Read a run; see `Run.load`."""
    _need_pyarrow()
    data = read_file("saved run", path, 2**32)
    place = os.fspath(path)
    foreign = FileError(f"{place} is not a saved run of minisim")
    if not data.startswith(b"PK"):
        raise foreign
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            head: Any = json.loads(file.read("run.json")) if "run.json" in file.namelist() else {}
            if head.get("mark") != MARK:
                raise foreign
            if (layout := head["layout"]) != LAYOUT:
                ours = f"this version of minisim reads layout {LAYOUT}"
                raise FileError(f"{place} has layout {show(layout)}, {ours}")
            if data != _signed(data):
                raise FileError(f"{place} is damaged: it is not what was saved")
            return _run(head, file)
    except FileError:
        raise
    except InputError as error:
        raise FileError(f"{place} cannot be read by this version of minisim: {error}") from error
    except Exception as error:  # damage can show up anywhere
        raise FileError(f"{place} is damaged and cannot be read") from error


def _run(head: Mapping[str, Any], file: zipfile.ZipFile) -> Run:
    tables = (io.BytesIO(file.read(f"{name}.parquet")) for name in ("trips", "trace", "rows"))
    trips, trace, rows = map(pd.read_parquet, tables)
    columns: dict[str, Any] = {name: trips[name].to_numpy() for name in TRIP_ARRAYS}
    return Run(
        **{name: made(head[name]) for name in ("scenario", "controller", *_VALUES)},
        columns=Trips(end=float(head["end"]), **columns),
        trace=np.asarray(trace.to_records(index=False)),
        rows=np.asarray(rows.to_records(index=False)),
        kinds=tuple(trips.get("kind", ())),
    )


def written(value: object) -> Any:
    """A value as JSON that `made` can read; raises `InputError` for classes that are not ours."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": repr(value)}
    if value is None or isinstance(value, bool | str | int | float):
        return value
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return {"array": value.dtype.str, "items": written(value.tolist())}
    if type(value) is list:
        return [written(item) for item in value]
    if type(value) in (tuple, frozenset):
        return {type(value).__name__: [written(item) for item in value]}  # type: ignore[attr-defined]  # a collection
    if isinstance(value, Mapping):
        return {"mapping": [[written(key), written(item)] for key, item in value.items()]}
    if _is_ours(kind := type(value)):
        return {
            "class": f"{kind.__module__}:{kind.__qualname__}",
            "fields": {name: written(getattr(value, name)) for name in _fields(kind)},
        }
    raise InputError(f"{show(value)} cannot be saved: it is not made of classes of minisim")


def made(data: Any) -> Any:
    """The value that `written` wrote; raises `InputError` for any other data."""
    match data:
        case None | bool() | str() | int() | float():
            return data
        case [*items]:
            return [made(item) for item in items]
        case {"float": "inf" | "-inf" | "nan" as text}:
            return float(text)
        case {"array": str(kind), "items": [*items]}:
            return np.array(made(items), dtype=kind)
        case {"tuple": [*items]}:
            return tuple(map(made, items))
        case {"frozenset": [*items]}:
            return frozenset(map(made, items))
        case {"mapping": [*pairs]}:
            return {made(key): made(item) for key, item in pairs}
        case {"class": str(name), "fields": dict(given)}:
            kind = _class(name)
            if set(given) != set(_fields(kind)):
                raise InputError(f"{name} has other fields")
            return kind(**{key: made(item) for key, item in given.items()})
    raise InputError(f"{show(data)} is not a value of a run")


def _fields(kind: Any) -> tuple[str, ...]:
    """What the constructor of a dataclass or named tuple takes."""
    if is_dataclass(kind):
        return tuple(field.name for field in fields(kind) if field.init)
    return tuple(kind._fields)


def _is_ours(kind: type) -> bool:
    """Whether `kind` is a frozen dataclass or a named tuple from our packages."""
    if kind.__module__.partition(".")[0] not in PACKAGES or "<locals>" in kind.__qualname__:
        return False
    frozen = getattr(kind, "__dataclass_params__", None)
    return frozen.frozen if frozen is not None else issubclass(kind, tuple)


def _class(name: str) -> Any:
    """The class of ours that a file names; nothing else is looked at or imported."""
    module, _, qualname = name.partition(":")
    ours = module.partition(".")[0] in PACKAGES and qualname.isidentifier()
    kind = getattr(importlib.import_module(module), qualname, None) if ours else None
    if not isinstance(kind, type) or kind.__module__ != module or not _is_ours(kind):
        raise InputError(f"{show(name)} is not a class of minisim")
    return kind


def _written_or(value: Any, stand_in: type[_StandIn]) -> Any:
    """The value or, if it is not of our own classes, a stand-in with what is known about it."""
    try:
        return written(value)
    except InputError:
        known = {name: getattr(value, name) for name in _fields(stand_in) if name != "text"}
        return written(stand_in(text=repr(value), **known))


def _need_pyarrow() -> None:
    if importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError(f"saved runs need pyarrow: {extra('parquet')}")


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest().encode()


def _signed(data: bytes) -> bytes:
    """The file with the right digest in the place of its own."""
    rest = data[: -len(_digest(b""))]
    return rest + _digest(rest)


def _parquet(columns: Any) -> bytes:
    return bytes(pd.DataFrame(columns).to_parquet(index=False, engine="pyarrow"))
