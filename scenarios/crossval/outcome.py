"""What one run gave, and SUMO's runs on disk: they take nearly all the time of a comparison."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from minisim.errors import FileError
from minisim.files import replacing
from minisim.results.trips import Trips
from scenarios.crossval.cases import Case
from scenarios.sweep.keys import description_of, digest_of, results_version

#: Folder of the kept runs, inside that of the report.
KEPT = "sumo"


class Outcome(NamedTuple):
    """What a run gave: its trips, or its error.

    Attributes:
        trips: None where it failed.
        collisions: pairs that touched.
        sumo: version of SUMO, empty for the other host.
        error: empty where it went well.
    """

    trips: Trips | None = None
    collisions: int = 0
    sumo: str = ""
    error: str = ""


def kept_file(folder: Path, case: Case, seed: int, version: str) -> Path:
    """Where SUMO's run of a case is kept; another scenario, controller or version, another file."""
    key = digest_of("\n".join([description_of(case.recipe(seed)), results_version(), version]))
    return folder / KEPT / f"{key[:24]}.npz"


def read_outcome(file: Path) -> Outcome | None:
    """A run that was kept; None where it is not there, or not whole."""
    try:
        with np.load(file, allow_pickle=False) as data:
            columns = {name: data[name] for name in Trips._fields}
            columns |= {name: float(columns[name]) for name in ("end", "start")}
            return Outcome(Trips(**columns), int(data["collisions"]), str(data["sumo"]))
    except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
        return None


def write_outcome(file: Path, outcome: Outcome) -> None:
    """Keep a run that went well, whole or not at all; raises `FileError`."""
    if outcome.trips is None:
        return
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"cannot write {file}: {error.strerror or error}") from error
    with replacing(file) as part:
        np.savez_compressed(
            part,
            collisions=outcome.collisions,
            sumo=outcome.sumo,
            **outcome.trips._asdict(),
        )
