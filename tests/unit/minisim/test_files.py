"""Files: writers that never leave half of one, and checks before any work is done."""

from __future__ import annotations

import os
import re
import stat
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from dim import HarmonyMatrix
from minisim.errors import FileError, InputError
from minisim.files import (
    check_apart,
    check_file,
    check_table,
    make_folder,
    markdown_table,
    read_file,
    replacing,
    write_table,
    write_text,
)
from minisim.recorded import read_arrivals
from minisim.results.run import Run
from scenarios.sweep import read_experiments


def test_nothing_is_seen_before_all_is_written(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    with replacing(path) as temporary:
        temporary.write_text("new", encoding="utf-8")
        assert not path.exists()
        assert temporary.parent == path.parent
    assert path.read_text(encoding="utf-8") == "new"
    assert os.listdir(tmp_path) == ["out.txt"]


def test_a_symbolic_link_keeps_pointing_to_the_file(tmp_path: Path) -> None:
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.touch()
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text(encoding="utf-8") == "new"


@pytest.mark.parametrize("link", [False, True])
def test_the_folder_that_is_missing_is_named(link: bool, tmp_path: Path) -> None:
    file = gone = tmp_path / "none" / "file.txt"
    if link:
        file = tmp_path / "link.txt"
        file.symlink_to(gone)
    for write in (lambda: write_text(file, "text"), lambda: check_file(gone)):
        with pytest.raises(FileError, match=re.escape(f": there is no folder {gone.parent}") + "$"):
            write()


def test_a_table_is_read_back(tmp_path: Path) -> None:
    frame = pd.DataFrame({"a": [0.1 + 0.2, 2.0], "b": ["x", None]})
    write_table(frame, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == b"a,b\n0.3,x\n2.0,\n"


@pytest.mark.parametrize("use", [check_table, lambda path: write_table(pd.DataFrame(), path)])
def test_a_table_has_one_of_two_suffixes(use: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"allowed: \.csv, \.parquet; did you mean '\.csv'"):
        use(tmp_path / "t.cvs")


def test_a_markdown_cell_stays_in_its_column() -> None:
    lines = markdown_table(("name", "n"), [("a|b\nc", "1")]).splitlines()
    assert lines == ["| name | n |", "| --- | ---: |", r"| a\|b c | 1 |"]


def test_a_check_leaves_no_trace_and_says_what_cannot_be_written(tmp_path: Path) -> None:
    assert check_file(tmp_path / "new.xml", ".xml", ".csv") == tmp_path / "new.xml"
    assert not list(tmp_path.iterdir())
    for path, why in (
        (tmp_path, "it is a folder"),
        (tmp_path / "none" / "x.csv", "there is no folder"),
        (os.devnull, "it is not an ordinary file"),
    ):
        with pytest.raises(FileError, match=f"cannot write .*: {why}"):
            check_file(path)
    with pytest.raises(InputError, match=r"allowed: \.xml"):
        check_file(tmp_path / "x.csv", ".xml")


def test_a_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    assert stat.S_ISDIR(make_folder(tmp_path / "a" / "b").stat().st_mode)
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="it is a file"):
        make_folder(tmp_path / "file")


def test_two_options_never_name_one_file(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "real")
    check_apart({"--a": tmp_path / "real", "--b": tmp_path / "other", "--c": None})
    with pytest.raises(InputError, match="--a and --b name the same file"):
        check_apart({"--a": tmp_path / "real", "--b": tmp_path / "link"})


def test_only_ordinary_files_and_pipes_are_read(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"12345")
    assert read_file("notes", file) == read_file("notes", file, 5) == b"12345"
    with pytest.raises(FileError, match=r"cannot read notes from \S*file: it has more than 0 MiB$"):
        read_file("notes", file, 4)
    for path in (tmp_path, tmp_path / "none", "a\0b", "x" * 5000):
        with pytest.raises(FileError, match="cannot read notes from"):
            read_file("notes", path)
    with pytest.raises(InputError, match="notes file must be"):
        read_file("notes", 3)  # type: ignore[arg-type]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_no_device_is_read() -> None:
    readers = (read_arrivals, read_experiments, HarmonyMatrix.from_csv, Run.load)
    for read, device in product(readers, ("/dev/full", "/dev/zero")):
        with pytest.raises(FileError, match="neither an ordinary file nor a pipe"):
            read(device)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes are POSIX's")
def test_a_pipe_is_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as writer:
        writer.submit(pipe.write_bytes, b"demand_time_s,lane,manoeuvre\n0,a,1\n")
        assert len(read_arrivals(pipe)) == 1
