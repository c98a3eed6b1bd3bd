"""Files on disk: whether they can be written, and writers that never leave half a file.

A writer writes beside its target and then renames. A reader sees the old file or the whole new
one, whatever happens in between.
"""

from __future__ import annotations

import importlib.util
import os
import tempfile
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from minisim.errors import FileError, InputError, MissingExtraError, choice, instance

if TYPE_CHECKING:
    import pandas as pd

#: A file as a caller may name it.
AnyPath = str | os.PathLike[str]

#: Suffixes of the formats in which tables are written.
TABLE_SUFFIXES: Final = (".csv", ".parquet")

#: Decimals in CSV: micrometres and microseconds, and 0.3 instead of 0.30000000000000004.
CSV_DECIMALS: Final = 6


@contextmanager
def replacing(path: AnyPath) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and put it in place at the end.

    When the block raises, `path` stays as it was and the temporary file goes. A symbolic link
    stays a link: the file that it names is replaced.

    Raises:
        FileError: the folder cannot be written, or `path` is no ordinary file.
    """
    target = _target(path)
    temporary = target.with_name(f".{target.stem}-{uuid.uuid4().hex}{target.suffix}")
    try:
        try:
            yield temporary
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"cannot write {path}: {_reason(error)}") from error


def write_text(path: AnyPath, text: str) -> None:
    """Write a text in UTF-8, whole or not at all; raises `FileError`."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def write_table(frame: pd.DataFrame, path: AnyPath) -> None:
    """Write a table as CSV or Parquet, by the suffix of `path`, whole or not at all.

    Raises:
        InputError: another suffix.
        MissingExtraError: Parquet without pyarrow.
        FileError: the file cannot be written; nothing is left behind.
    """
    suffix = _table_suffix(path)
    with replacing(path) as part:
        if suffix == ".csv":
            frame.round(CSV_DECIMALS).to_csv(part, index=False, lineterminator="\n")
        else:
            frame.to_parquet(part, index=False, engine="pyarrow")


def markdown_table(
    headings: Sequence[str], rows: Iterable[Sequence[str]], words: Collection[int] = (0,)
) -> str:
    """A Markdown table in which each cell stays in its column, whatever it holds.

    `words` are the indices of the columns aligned to the left; the others are aligned to the right.
    """
    rule = ["---" if k in words else "---:" for k in range(len(headings))]
    cells = ([" ".join(cell.replace("|", "\\|").split()) for cell in row] for row in rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in (headings, rule, *cells))


def check_file(path: AnyPath, *suffixes: str) -> Path:
    """Return `path` when a file can be written there; leaves no trace.

    Args:
        path: of the file.
        suffixes: that it may have; any where none is given.

    Raises:
        InputError: another suffix.
        FileError: its folder is missing or not writable, or the path is no ordinary file.
    """
    if suffixes:
        _check_suffix(path, suffixes)
    target = Path(path)
    try:
        if target.is_dir():
            raise FileError(f"cannot write {target}: it is a folder")
        if target.exists() and not target.is_file():
            raise FileError(f"cannot write {target}: it is not an ordinary file")
        if not target.parent.is_dir():
            raise FileError(f"cannot write {target}: there is no folder {target.parent}")
        _probe(target.parent)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot write {target}: {_reason(error)}") from error
    return target


def check_table(path: AnyPath) -> Path:
    """`check_file` for a table; raises also as `write_table`."""
    _table_suffix(path)
    return check_file(path)


def check_apart(files: Mapping[str, Path | None]) -> None:
    """Raise `InputError` when two options (name -> file) mean one file: it would be overwritten.

    Links are followed.
    """
    seen: dict[str, str] = {}
    for option, path in files.items():
        if path is None:
            continue
        first = seen.setdefault(os.path.normcase(os.path.realpath(path)), option)
        if first != option:
            raise InputError(f"{first} and {option} name the same file {path}; give two files")


def make_folder(path: AnyPath) -> Path:
    """Make a folder, with its parents, that files can be written to; raises `FileError`."""
    folder = Path(path)
    try:
        if folder.exists() and not folder.is_dir():
            raise FileError(f"cannot write to folder {folder}: it is a file")
        folder.mkdir(parents=True, exist_ok=True)
        _probe(folder)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot write to folder {folder}: {_reason(error)}") from error
    return folder


def _table_suffix(path: AnyPath) -> str:
    instance("output file", path, (str, os.PathLike))
    suffix = _check_suffix(path, TABLE_SUFFIXES)
    if suffix == ".parquet" and importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError(
            "Parquet needs pyarrow: pip install 'minisim[parquet]' (or write .csv)"
        )
    return suffix


def _check_suffix(path: AnyPath, allowed: Sequence[str]) -> str:
    return choice(f"suffix of {os.fspath(path)}:", Path(path).suffix.lower(), allowed)


def _target(path: AnyPath) -> Path:
    """The file that `path` names, through symbolic links; raises `FileError`."""
    instance("output file", path, (str, os.PathLike))
    try:
        target = Path(path).resolve()
        ordinary = target.is_file() or not target.exists()
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a NUL in the name
        raise FileError(f"cannot write {os.fspath(path)!r}: {error}") from error
    if not ordinary:
        raise FileError(f"cannot write {path}: it is not an ordinary file")
    return target


def _probe(folder: Path) -> None:
    """Write and remove a temporary file; permissions alone do not tell whether that works."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
