"""Whether results can be written where the user wants them, asked before any work is done."""

from __future__ import annotations

import importlib.util
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from minisim.errors import FileError, InputError, MissingExtraError, choice

TABLE_SUFFIXES = (".csv", ".parquet")


def check_file(path: str | os.PathLike[str]) -> Path:
    """Return `path` when a file can be written there; leaves no trace.

    Raises:
        FileError: its folder is missing or not writable, or the path is no ordinary file.
    """
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


def check_table(path: str | os.PathLike[str]) -> Path:
    """`check_file` for a table; raises also for a suffix other than .csv and .parquet."""
    suffix = choice(f"suffix of {os.fspath(path)}:", Path(path).suffix.lower(), TABLE_SUFFIXES)
    if suffix == ".parquet" and importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError(
            "Parquet needs pyarrow: pip install 'minisim[parquet]' (or write .csv)"
        )
    return check_file(path)


def check_fcd(path: str | os.PathLike[str]) -> Path:
    """`check_file` for floating-car data; raises also for a suffix other than .xml."""
    choice(f"suffix of {os.fspath(path)}:", Path(path).suffix.lower(), [".xml"])
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


def make_folder(path: str | os.PathLike[str]) -> Path:
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


def _probe(folder: Path) -> None:
    """Write and remove a temporary file: the only sure test, permissions tell half of it."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
