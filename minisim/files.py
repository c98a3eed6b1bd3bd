"""Files on disk: whether they can be written, and writers that never leave half a file.

A writer writes beside its target and then renames, so a reader sees the old file or the new one.
"""

from __future__ import annotations

import importlib.util
import os
import stat
import tempfile
import uuid
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from minisim.errors import FileError, InputError, MissingExtraError, choice, extra, instance

if TYPE_CHECKING:
    import pandas as pd

#: What a caller may pass as a file.
AnyPath = str | os.PathLike[str]

#: Most bytes that are read from a file, unless its reader says otherwise.
LARGEST: Final = 64 * 2**20

#: Suffixes of the formats in which tables are written.
TABLE_SUFFIXES: Final = (".csv", ".parquet")

#: Decimals in CSV: micrometres and microseconds, and 0.3 instead of 0.30000000000000004.
CSV_DECIMALS: Final = 6


def read_file(what: str, path: AnyPath, most: int = LARGEST) -> bytes:
    """The content of an ordinary file or a pipe; a device may have no end.

    Raises:
        FileError: it cannot be read, is something else, or has more than `most` bytes (a pipe more
            than `LARGEST`). Messages call the content `what`.
    """
    instance(f"{what} file", path, (str, os.PathLike))
    with _refused(f"read {what} from {os.fspath(path)}"):
        known = os.stat(path)
        pipe = stat.S_ISFIFO(known.st_mode)
        if not (pipe or stat.S_ISREG(known.st_mode) or stat.S_ISDIR(known.st_mode)):
            raise ValueError("it is neither an ordinary file nor a pipe")
        with open(path, "rb") as file:  # which refuses a folder
            most = LARGEST if pipe else most
            data = file.read(most + 1 if pipe else -1) if known.st_size <= most else None
        if data is None or len(data) > most:
            raise ValueError(f"it has more than {most >> 20} MiB")
    return data


@contextmanager
def replacing(path: AnyPath) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, and put it in place at the end.

    If the block raises, `path` stays as it was and the temporary file is removed. A symbolic link
    stays: the file that it points to is replaced.

    Raises:
        FileError: its folder is missing or not writable, or `path` is not an ordinary file.
    """
    instance("output file", path, (str, os.PathLike))
    with _refused(f"write {os.fspath(path)!r}"):
        target = Path(path).resolve()
        ordinary = target.is_file() or not target.exists()
    if not ordinary:
        raise FileError(f"cannot write {path}: it is not an ordinary file")
    if not target.parent.is_dir():
        raise FileError(f"cannot write {path}: {_no_folder(path)}")
    temporary = target.with_name(f".{target.stem}-{uuid.uuid4().hex}{target.suffix}")
    try:
        try:
            yield temporary
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"cannot write {path}: {_reason(error)}") from error


def _no_folder(path: AnyPath) -> str:
    """Which folder is missing for a file: its own, or that of the file that it links to."""
    own = Path(path).parent
    return f"there is no folder {Path(path).resolve().parent if own.is_dir() else own}"


@contextmanager
def _refused(what: str) -> Iterator[None]:
    """If the block fails, raise a `FileError` that says what cannot be done."""
    try:
        yield
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a NUL in the name
        raise FileError(f"cannot {what}: {_reason(error)}") from error


def write_text(path: AnyPath, text: str) -> None:
    """Write text in UTF-8, whole or not at all; raises `FileError`."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def write_table(frame: pd.DataFrame, path: AnyPath) -> None:
    """Write a table, whole or not at all, as CSV or Parquet depending on the suffix of `path`.

    Raises `InputError` for another suffix, `MissingExtraError` for Parquet without pyarrow, and
    `FileError` for a file that cannot be written.
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

    `words` are the indices of the left-aligned columns; the others are right-aligned.
    """
    rule = ["---" if k in words else "---:" for k in range(len(headings))]
    cells = ([" ".join(cell.replace("|", "\\|").split()) for cell in row] for row in rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in (headings, rule, *cells))


def check_file(path: AnyPath, *suffixes: str) -> Path:
    """Return `path` if a file can be written there; leave no trace.

    Raises:
        InputError: `path` has none of `suffixes`, if there are any.
        FileError: its folder is missing or not writable, or it is not an ordinary file.
    """
    if suffixes:
        _check_suffix(path, suffixes)
    target = Path(path)
    with _refused(f"write {target}"):
        if target.is_dir():
            raise ValueError("it is a folder")
        if target.exists() and not target.is_file():
            raise ValueError("it is not an ordinary file")
        if not target.parent.is_dir():
            raise ValueError(_no_folder(target))
        _probe(target.parent)
    return target


def check_table(path: AnyPath) -> Path:
    """`check_file` for a table; also raises what `write_table` raises."""
    _table_suffix(path)
    return check_file(path)


def check_apart(files: Mapping[str, Path | None]) -> None:
    """Raise `InputError` if two options (name -> file) name the same file, perhaps by links."""
    seen: dict[str, str] = {}
    for option, path in files.items():
        if path is None:
            continue
        first = seen.setdefault(os.path.normcase(os.path.realpath(path)), option)
        if first != option:
            raise InputError(f"{first} and {option} name the same file {path}; give two files")


def make_folder(path: AnyPath) -> Path:
    """Make a writable folder, along with its parents; raises `FileError`."""
    folder = Path(path)
    with _refused(f"write to folder {folder}"):
        if folder.exists() and not folder.is_dir():
            raise ValueError("it is a file")
        folder.mkdir(parents=True, exist_ok=True)
        _probe(folder)
    return folder


def _table_suffix(path: AnyPath) -> str:
    instance("output file", path, (str, os.PathLike))
    suffix = _check_suffix(path, TABLE_SUFFIXES)
    if suffix == ".parquet" and importlib.util.find_spec("pyarrow") is None:
        raise MissingExtraError(f"Parquet needs pyarrow: {extra('parquet')} (or write .csv)")
    return suffix


def _check_suffix(path: AnyPath, allowed: Sequence[str]) -> str:
    return choice(f"suffix of {os.fspath(path)}:", Path(path).suffix.lower(), allowed)


def _probe(folder: Path) -> None:
    """Write and remove a temporary file: permissions do not show whether that works."""
    with tempfile.TemporaryFile(dir=folder):
        pass


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
