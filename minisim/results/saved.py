"""A run on disk: one zip file of JSON and Parquet, without pickle.

One file rather than a folder: a rename puts it in place whole or not at all, and zip's checksums
tell damage. It holds `run.json`, `trips.parquet`, `trace.parquet` and `rows.parquet`.

Scenario and controller are written as class and fields where they are made of our own classes
(`PACKAGES`), and come back as they were. Others come back as stand-ins with their name and text.
A file never makes anything be imported but modules of ours.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import io
import json
import math
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn

import numpy as np

from minisim.control import Controller, Plan, Session, Site
from minisim.engine.collision import Collision
from minisim.errors import FileError, InputError, MinisimError, MissingExtraError, instance, show
from minisim.files import replacing
from minisim.results.run import Run
from minisim.results.trips import TRIP_ARRAYS, Trips

if TYPE_CHECKING:
    import numpy.typing as npt

#: What the file says it is, and the layout that this version writes.
MARK: Final = "minisim run"
LAYOUT: Final = 1

#: Packages whose classes are written as class and fields, and made again from them.
PACKAGES: Final = ("minisim", "dim", "baselines", "scenarios")

_HEAD: Final = "run.json"

#: What reading damaged content raises.
_BROKEN: Final = (
    zipfile.BadZipFile, ValueError, KeyError, TypeError, AttributeError, IndexError, EOFError,
    OverflowError, RecursionError, NotImplementedError, ImportError, MinisimError,
)  # fmt: skip


@dataclass(frozen=True)
class SavedScenario:
    """Stands in for a scenario of others' making: what it was, but not how to run it again."""

    name: str
    profile_name: str
    density: float
    horizon: float
    warmup: float
    depart_speed: float | None
    text: str

    def site(self, seed: int) -> NoReturn:  # noqa: ARG002  (a scenario's argument)
        """Raises `InputError`."""
        raise self._gone()

    def arrivals(self, seed: int) -> NoReturn:  # noqa: ARG002  (a scenario's argument)
        """Raises `InputError`."""
        raise self._gone()

    def _gone(self) -> InputError:
        return InputError(
            f"scenario {self.name!r} was saved as a text and cannot be run again: {self.text}"
        )

    def __repr__(self) -> str:
        return self.text


@dataclass(frozen=True)
class SavedController:
    """Stands in for a controller of others' making: its name and text, but not its rules."""

    name: str
    text: str

    def start(self, site: Site) -> Session:  # noqa: ARG002  (Controller's argument)
        """Raises `InputError`."""
        raise InputError(
            f"controller {self.name!r} was saved as a text and cannot be run again: {self.text}"
        )

    def __repr__(self) -> str:
        return self.text


def save(run: Run, path: str | os.PathLike[str]) -> None:
    """Write a run; see `Run.save`."""
    instance("output file", path, (str, os.PathLike))
    _need_pyarrow()
    head = {
        "mark": MARK,
        "layout": LAYOUT,
        "provenance": run.provenance,  # for people; the rest says it again
        "environment": dict(run.environment),
        "host": dict(run.host),
        "scenario": _written_or(run.scenario, _scenario_text),
        "controller": _written_or(run.controller, _controller_text),
        "seed": run.seed,
        "site": written(run.site),
        "plan": written(run.plan),
        "collisions": [list(collision) for collision in run.collisions],
        "record": run.record,
        "counts": written(dict(run.counts)),
        "end": run.columns.end,
    }
    trips = {name: getattr(run.columns, name) for name in TRIP_ARRAYS}
    if run.kinds:
        trips["kind"] = np.array(run.kinds)
    with replacing(path) as part, zipfile.ZipFile(part, "w") as file:
        file.writestr(_HEAD, json.dumps(head, indent=1))
        file.writestr("trips.parquet", _parquet(trips))
        for name, records in (("trace", run.trace), ("rows", run.rows)):
            columns = {field: records[field] for field in records.dtype.names or ()}
            file.writestr(f"{name}.parquet", _parquet(columns))


def load(path: str | os.PathLike[str]) -> Run:
    """Read a run; see `Run.load`."""
    instance("saved run", path, (str, os.PathLike))
    _need_pyarrow()
    place = os.fspath(path)
    try:
        data = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"cannot read {place}: {reason}") from error
    if not data.startswith(b"PK"):
        raise FileError(f"{place} is not a saved run of minisim")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as file:
            head: Any = json.loads(file.read(_HEAD)) if _HEAD in file.namelist() else None
            mark = head.get("mark") if isinstance(head, dict) else None
            layout = head["layout"] if mark == MARK else 0
            if layout == LAYOUT:
                return _run(head, file)
    except _BROKEN as error:
        raise FileError(f"{place} is damaged: {type(error).__name__}: {error}") from error
    if mark != MARK:
        raise FileError(f"{place} is not a saved run of minisim")
    raise FileError(
        f"{place} has layout {show(layout)}, this version of minisim reads layout {LAYOUT}"
    )


def _run(head: Mapping[str, Any], file: zipfile.ZipFile) -> Run:
    trips = _columns(file, "trips")
    kinds = trips.pop("kind", None)
    site, plan = made(head["site"]), made(head["plan"])
    instance("site", site, Site)
    instance("plan", plan, Plan)
    return Run(
        scenario=made(head["scenario"]),
        controller=made(head["controller"]),
        seed=int(head["seed"]),
        site=site,
        plan=plan,
        collisions=tuple(_collision(*values) for values in head["collisions"]),
        columns=Trips(end=float(head["end"]), **{name: trips[name] for name in TRIP_ARRAYS}),  # type: ignore[arg-type]
        record=head["record"],
        trace=_records(_columns(file, "trace")),
        rows=_records(_columns(file, "rows")),
        counts=made(head["counts"]),
        kinds=() if kinds is None else tuple(kinds.tolist()),
        host=dict(head["host"]),
        environment=dict(head["environment"]),
    )


def _collision(time: float, *pairs: Any) -> Collision:
    return Collision(time, *map(tuple, pairs))


def written(value: object) -> Any:
    """A value as JSON; `made` is the way back.

    Raises:
        InputError: something that is no number, text, array, collection or dataclass of ours.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, np.generic):
        return written(value.item())
    if isinstance(value, int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"float": repr(value)}
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        items = [written(item) for item in value.ravel().tolist()]
        return {"array": value.dtype.str, "shape": list(value.shape), "items": items}
    if type(value) in (tuple, list, frozenset):
        return {type(value).__name__: [written(item) for item in value]}  # type: ignore[attr-defined]
    if isinstance(value, Mapping):
        return {"mapping": [[written(key), written(item)] for key, item in value.items()]}
    if _is_ours(type(value)):
        kind = type(value)
        return {
            "class": f"{kind.__module__}:{kind.__qualname__}",
            "fields": {name: written(getattr(value, name)) for name in _fields(kind)},
        }
    raise InputError(f"{show(value)} cannot be saved: it is not made of classes of minisim")


def made(data: Any) -> Any:
    """The value that `written` wrote.

    Raises:
        InputError: something else.
    """
    match data:
        case None | bool() | str() | int() | float():
            return data
        case {"float": "inf" | "-inf" | "nan" as text}:
            return float(text)
        case {"array": str(kind), "shape": [*shape], "items": [*items]}:
            return np.array([made(item) for item in items], dtype=kind).reshape(shape)
        case {"tuple": [*items]}:
            return tuple(map(made, items))
        case {"list": [*items]}:
            return list(map(made, items))
        case {"frozenset": [*items]}:
            return frozenset(map(made, items))
        case {"mapping": [*pairs]}:
            return {made(key): made(item) for key, item in pairs}
        case {"class": str(name), "fields": dict(fields)}:
            kind = _class(name)
            if set(fields) != set(_fields(kind)):
                raise InputError(f"{name} has other fields")
            return kind(**{key: made(item) for key, item in fields.items()})
    raise InputError(f"{show(data)} is no value of a run")


def _fields(kind: Any) -> tuple[str, ...]:
    """What the constructor of a dataclass or named tuple takes."""
    if is_dataclass(kind):
        return tuple(field.name for field in dataclasses.fields(kind) if field.init)
    names: tuple[str, ...] = kind._fields
    return names


def _is_ours(kind: type) -> bool:
    """Whether it is a frozen dataclass or a named tuple of our packages."""
    if kind.__module__.partition(".")[0] not in PACKAGES or "<locals>" in kind.__qualname__:
        return False
    frozen = getattr(kind, "__dataclass_params__", None)
    return frozen.frozen if frozen is not None else issubclass(kind, tuple)


def _class(name: str) -> Any:
    """The class of ours that a file names; nothing else is looked at, nor imported."""
    module, _, qualname = name.partition(":")
    if module.partition(".")[0] not in PACKAGES or not qualname.isidentifier():
        raise InputError(f"{show(name)} is no class of minisim")
    kind = getattr(importlib.import_module(module), qualname, None)
    if not isinstance(kind, type) or kind.__module__ != module or not _is_ours(kind):
        raise InputError(f"{show(name)} is no class of minisim")
    return kind


def _written_or(value: object, stand_in: Any) -> Any:
    try:
        return written(value)
    except InputError:
        return written(stand_in(value))


def _scenario_text(scenario: Any) -> SavedScenario:
    return SavedScenario(
        name=scenario.name,
        profile_name=scenario.profile_name,
        density=float(scenario.density),
        horizon=float(scenario.horizon),
        warmup=float(scenario.warmup),
        depart_speed=None if scenario.depart_speed is None else float(scenario.depart_speed),
        text=repr(scenario),
    )


def _controller_text(controller: Controller) -> SavedController:
    return SavedController(controller.name, repr(controller))


def _need_pyarrow() -> None:
    if importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError("saved runs need pyarrow: pip install 'minisim[parquet]'")


def _parquet(columns: Mapping[str, npt.NDArray[Any]]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({name: np.ascontiguousarray(column) for name, column in columns.items()})
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
    return buffer.getvalue()


def _columns(file: zipfile.ZipFile, name: str) -> dict[str, npt.NDArray[Any]]:
    import pyarrow.parquet as pq

    table = pq.read_table(io.BytesIO(file.read(f"{name}.parquet")))
    return {key: table.column(key).to_numpy() for key in table.column_names}


def _records(columns: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Columns as one structured array."""
    size = len(next(iter(columns.values()), ()))
    records = np.empty(size, [(name, column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        records[name] = column
    return records
