"""Results on disk: one SQLite file, one row per run.

Every run is a transaction of its own, written ahead (WAL) and forced to the disk, so that a killed
sweep loses no row. Several processes may write at once: each waits for the other's transaction, and
a run that two of them computed is one row. SQLite needs a local disk, which locks files reliably.

A key connects a row with its recipe. The row is valid while the version of the results is the same.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from minisim.errors import FileError, instance, plural, show
from scenarios.recipe import Recipe
from scenarios.sweep.keys import description_of, digest_of, results_version
from scenarios.sweep.rows import Outcome, Row

if TYPE_CHECKING:
    import pandas as pd

#: In the header of the file: the mark of a store ("DIMs"), and the layout of its table.
APPLICATION = 0x44494D73
SCHEMA = 1

#: How long to wait for another's transaction, and when opening [s]. A sweep's takes milliseconds.
PATIENCE = 30.0
OPENING = 3.0

#: Columns by which rows are ordered; every row has them.
ORDER = ("scenario", "profile", "split", "density", "controller", "horizon_s", "seed")

COLUMNS = ("key", "version", "error", "experiment", "provenance", "row")

_CREATE = f"""
BEGIN EXCLUSIVE;
CREATE TABLE IF NOT EXISTS runs (
    key TEXT PRIMARY KEY, version TEXT NOT NULL, error TEXT, experiment TEXT NOT NULL,
    provenance TEXT NOT NULL, row TEXT NOT NULL
) WITHOUT ROWID;
PRAGMA application_id = {APPLICATION};
PRAGMA user_version = {SCHEMA};
COMMIT;
"""

#: How a file begins; layout and mark are at bytes 60 and 68 (SQLite, "Database File Format", 1.3).
_MAGIC = b"SQLite format 3\0"


class Store:
    """Rows in a file; close it, or use it in a `with` statement.

    `create` makes the file if there is none. Raises `FileError` if it is missing, not a store, of
    another layout or damaged; the file stays as it was.
    """

    def __init__(self, path: str | os.PathLike[str], *, create: bool = True) -> None:
        instance("store", path, (str, os.PathLike))
        self.path = Path(path)
        fresh = _is_fresh(self.path)
        if fresh and not create:
            raise FileError(f"there is no store {self.path}")
        with self._guarded("open"):
            self._database = sqlite3.connect(
                self.path, timeout=OPENING, isolation_level=None, cached_statements=16
            )
        try:
            with self._guarded("open"):
                self._prepare(fresh)
        except BaseException:
            self._database.close()
            raise

    def put(self, recipe: Recipe, outcome: Outcome) -> None:
        """Store an outcome, in place of an earlier one of the same recipe.

        Raises `FileError`, for example if the disk is full or another process holds the store, and
        `InputError` as `canonical`. Earlier rows stay.
        """
        description, row = description_of(recipe), outcome.row
        provenance, text = json.dumps(outcome.provenance), json.dumps(row, allow_nan=False)
        values = (
            digest_of(description), row["version"], row["error"], description, provenance, text,
        )  # fmt: skip
        with self._guarded("write"):
            self._database.execute("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?, ?)", values)

    def valid(self, keys: Iterable[str]) -> dict[str, Row]:
        """Key -> row of those that need not be computed again: neither failed nor outdated."""
        wanted = set(keys)
        rows = self._select("key, row", "WHERE error IS NULL AND version = ?")
        return {key: self._row(row) for key, row in rows if key in wanted}

    def __len__(self) -> int:
        ((count,),) = self._select("count(*)", "")
        return int(count)

    @property
    def outdated(self) -> str:
        """How many rows of other versions of the results there are, in words; empty if none."""
        ((count,),) = self._select("count(*)", "WHERE version != ?")
        rows = plural(count, "row")
        told = f"{self.path} also keeps {rows} of another version of minisim, not used here"
        return told if count else ""

    def frame(self) -> pd.DataFrame:
        """The rows of this version, with the columns of `sweep`, sorted by `ORDER`."""
        import pandas as pd

        rows = [self._row(row) for (row,) in self._select("row", "WHERE version = ?")]
        frame = pd.DataFrame(rows)
        return frame.sort_values(list(ORDER), ignore_index=True) if rows else frame

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _prepare(self, fresh: bool) -> None:
        if fresh:
            # Before WAL is on, the roll-back journal makes the header part of the transaction.
            self._database.executescript(_CREATE)
        columns = tuple(name for _, name, *_ in self._database.execute("PRAGMA table_info(runs)"))
        if columns != COLUMNS:
            raise FileError(f"{self.path} is not a store of minisim; it was left as it is")
        problem = self._database.execute("PRAGMA quick_check(1)").fetchone()[0]
        if problem != "ok":
            raise FileError(f"store {self.path} is damaged: {problem}")
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = FULL")
        self._database.execute(f"PRAGMA busy_timeout = {round(1000 * PATIENCE)}")

    def _select(self, what: str, where: str) -> Iterator[Any]:
        """Tuples of the table; `?` is the version of the results."""
        versions = (results_version(),) * where.count("?")
        with self._guarded("read"):
            yield from self._database.execute(f"SELECT {what} FROM runs {where}", versions)

    def _row(self, text: str) -> Row:
        try:
            row: Row = json.loads(text)
        except ValueError as error:
            raise FileError(f"store {self.path} is damaged: {error}") from error
        if not isinstance(row, dict) or not row.keys() >= {*ORDER, "version", "error"}:
            raise FileError(f"store {self.path} is damaged: {show(text)} is not a row")
        return row

    @contextmanager
    def _guarded(self, what: str) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError, ValueError) as error:
            message = f"cannot {what} store {self.path}: {error}"
            if what == "write":
                message += "; what was stored before is safe, and the same sweep goes on from there"
            raise FileError(message) from error


def _is_fresh(path: Path) -> bool:
    """Whether there is no store yet; raises `FileError` for a file that is not a store.

    SQLite itself would begin to repair another program's file.
    """
    try:
        if not path.parent.is_dir():
            raise FileError(f"cannot open store {path}: there is no folder {path.parent}")
        if not path.exists():
            return True
        if not path.is_file():
            raise FileError(f"cannot open store {path}: it is not an ordinary file")
        with path.open("rb") as file:
            header = file.read(100)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot open store {path}: {error}") from error
    if not header:
        return True
    schema, application = (int.from_bytes(header[k : k + 4], "big") for k in (60, 68))
    if header[:16] != _MAGIC or application != APPLICATION:
        raise FileError(f"{path} is not a store of minisim; it was left as it is")
    if schema != SCHEMA:
        raise FileError(
            f"store {path} has layout {schema}, this version of minisim reads layout {SCHEMA}; "
            "it was left as it is"
        )
    return False
