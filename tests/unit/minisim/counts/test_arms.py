"""Arms that are misspelt."""

from __future__ import annotations

from pathlib import Path

import pytest

from minisim.errors import FileError, InputError
from tests.builders import GERMAN, read_count

NAMED = (
    GERMAN.replace(",A,", ",North,")
    .replace("\nA,", "\nNorth,")
    .replace("\nB,", "\nEast,")
    .replace("\nC,", "\nSouth,")
    .replace("\nD,", "\nWest,")
)


def test_a_misspelt_point_of_the_compass_is_no_further_arm(tmp_path: Path) -> None:
    text = NAMED.replace("\nNorth,1,AG", "\nNroth,1,AG", 1)
    with pytest.raises(FileError, match=r"line 3: unknown arm 'Nroth'; did you mean 'north'\?"):
        read_count(tmp_path, text)


def test_letters_are_not_points_of_the_compass(tmp_path: Path) -> None:
    """E and W among others are names."""
    text = GERMAN.replace("\nD,1,D", "\nE,1,E")
    assert read_count(tmp_path, text).arms == ("A", "B", "C", "E")


def test_a_mapping_without_an_arm_of_the_sheet_names_the_line(tmp_path: Path) -> None:
    mapping = {"arms": ["North", "Eest", "South", "West"]}
    turns = {f"{a}{b}..(1)": k for a in "ABCD" for k, b in enumerate("LGR", 1)}
    with pytest.raises(
        InputError, match=r"line 5: the arm 'East' is missing among the arms .*mean 'Eest'\?"
    ):
        read_count(tmp_path, NAMED, {**mapping, "turns": turns})
