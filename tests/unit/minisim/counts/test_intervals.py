"""What is assumed of intervals, and those that cross midnight."""

from __future__ import annotations

from pathlib import Path

import pytest

from minisim.errors import FileError
from tests.builders import read_count


def sheet(*times: str) -> str:
    """From every arm of three to every other, at these times."""
    pairs = [(a, b) for a in "123" for b in "123" if a != b]
    return "time,from,to,car\n" + "".join(f"{time},{a},{b},9\n" for time in times for a, b in pairs)


def test_a_length_taken_from_the_starts_is_named(tmp_path: Path) -> None:
    count = read_count(tmp_path, sheet("7:00", "7:30"))
    assert count.edges == (25_200, 27_000, 28_800)
    assert (
        "intervals have no ends: 30 min each, as from one start to the next; a mapping can say "
        "otherwise (interval)"
    ) in count.notes


def test_a_length_that_is_given_is_not(tmp_path: Path) -> None:
    count = read_count(tmp_path, sheet("7:00", "7:30"), {"interval": 30})
    assert not any("intervals have no ends" in note for note in count.notes)
    with pytest.raises(FileError, match="07:00-07:15 and 07:30-07:45 leave a hole"):
        read_count(tmp_path, sheet("7:00", "7:30"), {"interval": 15})


def test_one_start_needs_a_length(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="length of the interval is unknown"):
        read_count(tmp_path, sheet("7:00"))
    assert read_count(tmp_path, sheet("7:00"), {"interval": 60}).edges == (25_200, 28_800)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        (("23:45-24:00", "00:00-00:15"), "before midnight or after it, which are two days"),
        (("23:45-00:00", "00:00-00:15"), "before midnight or after it, which are two days"),
        (("23:30-23:45", "23:45-00:15"), "23:45-00:15 must .*past midnight must end at 24:00"),
    ],
)
def test_midnight_ends_a_day(tmp_path: Path, times: tuple[str, ...], message: str) -> None:
    with pytest.raises(FileError, match=message):
        read_count(tmp_path, sheet(*times))


def test_a_part_of_the_day_ends_at_midnight(tmp_path: Path) -> None:
    count = read_count(tmp_path, sheet("23:45-00:00", "00:00-00:15"), {"from": "12:00"})
    assert count.edges == (85_500, 86_400)
