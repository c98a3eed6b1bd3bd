"""Titles above a header, sums, and columns from … to."""

from __future__ import annotations

from pathlib import Path

import pytest

from minisim.errors import FileError
from tests.builders import AMERICAN, GERMAN, read_count

#: A title, "from" and "to" as times, sums of rows and of columns.
WITH_SUMS = "\n".join([
    "Verkehrszählung, Kepler / Haupt;;;;;;",
    "Datum:;08.05.2012;;;;;",
    "",
    "Zeit von;Zeit bis;Zufahrt;Richtung;Pkw;Bus;Summe Kfz",
    *(f"{start};{end};{arm};{turn};{n};1;{n + 1}"
      for start, end, n in (("06:00", "06:15", 20), ("06:15", "06:30", 40))
      for arm in ("Nord", "Ost", "Süd", "West") for turn in ("L", "G", "R")),
    "06:00;06:30;Summe Nord;;180;6;186",
    "06:00;06:30;Nord;Summe;180;6;186",
    "Gesamt;;;;720;24;744",
    "Summe;744",
    "Anteil in %;;;;100;0;100",
])  # fmt: skip


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_titles_and_sums_are_named_and_left_out(tmp_path: Path, encoding: str) -> None:
    count = read_count(tmp_path, WITH_SUMS, encoding=encoding)
    assert count.arms == ("N", "E", "S", "W")
    assert count.edges == (21_600, 22_500, 23_400)
    assert count.vehicles.sum() == 12 * (20 + 40 + 2)
    assert count.left_out == {"Summe Kfz (a sum or a share, not a class)": 12 * (21 + 41)}
    assert "rows of totals or shares, left out: 5, the first in line 29" in count.notes
    assert any(note.startswith("above the header, not used: Verkehrsz") for note in count.notes)


def test_sums_of_a_sheet_of_movements(tmp_path: Path) -> None:
    lines = AMERICAN.splitlines()
    text = "\n".join([
        "Intersection count\t" * 3, f"{lines[0]}\tInt. Total", f"{lines[1]}\t384",
        f"{lines[2]}\t500",
        "Grand Total\t" + "\t".join(["30"] * 17),
    ])  # fmt: skip
    count = read_count(tmp_path, text)
    assert count.vehicles.sum() == 4 * (95 + 125)
    assert "rows of totals or shares, left out: 1, the first in line 5" in count.notes
    assert "columns not used: Int. Total" in count.notes


@pytest.mark.parametrize(("start", "end"), [("from", "to"), ("von", "bis"), ("Von", "Bis")])
def test_times_say_what_from_and_to_mean(tmp_path: Path, start: str, end: str) -> None:
    text = GERMAN.replace("intervall_start", start).replace("intervall_ende", end)
    assert read_count(tmp_path, text).edges == (21_600, 22_500, 23_400)


def test_an_empty_approach_is_refused(tmp_path: Path) -> None:
    """As where a spreadsheet has merged cells."""
    with pytest.raises(FileError, match="line 3: the approach is empty; each row needs one"):
        read_count(tmp_path, GERMAN.replace("\nA,1,AG", "\n,1,AG", 1))


def test_a_column_without_a_name_is_named(tmp_path: Path) -> None:
    assert (
        "columns not used: those without a name"
        in read_count(tmp_path, GERMAN.replace("spur", "", 1)).notes
    )
