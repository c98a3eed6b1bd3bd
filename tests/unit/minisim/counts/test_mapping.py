"""A mapping whose words match nothing is refused: what a user says is not ignored."""

from __future__ import annotations

from pathlib import Path

import pytest

from minisim.errors import FileError, InputError
from tests.builders import AMERICAN, BRITISH, GERMAN, read_count


@pytest.mark.parametrize(
    ("text", "mapping", "message"),
    [
        (GERMAN, {"classes": {"pkws": "car"}}, r"has no class 'pkws'; it has .*mean 'pkw'\?"),
        (GERMAN, {"turns": {"AG": "left"}}, r"has no turn 'AG'; it has AG\.\.\(1\), AL"),
        (GERMAN, {"count": "spur"}, r"has count = 'spur', but the counts are in the columns rad"),
        (GERMAN, {"class": "spur"}, r"has class = 'spur', but the counts are in"),
        (GERMAN, {"interval": 15}, r"has interval = 15, but the intervals of .* have ends"),
        (AMERICAN, {"turn": "NBL"}, r"has turn = 'NBL', but the counts are in the columns NBT"),
        (AMERICAN, {"classes": {"car": "bus"}}, r"no class 'car'; it names no class"),
        (AMERICAN, {"turns": {"L": "right"}}, r"no turn 'L'; it names no turn"),
        (BRITISH, {"classes": {"cars": "car"}}, r"no class 'cars'; it has .*'Car'"),
        (BRITISH, {"turns": {"left": 1}}, r"no turn 'left'; it names no turn"),
    ],
)
def test_words_that_match_nothing_are_refused(
    tmp_path: Path, text: str, mapping: dict[str, object], message: str
) -> None:
    if text is BRITISH:
        classes = {"Pedal Cycle": "left out", **dict(mapping.get("classes", {}))}  # type: ignore
        mapping = {**mapping, "classes": classes}
    with pytest.raises(InputError, match=message) as caught:
        read_count(tmp_path, text, mapping)
    assert "sheet.csv" in str(caught.value)


@pytest.mark.parametrize("turn", ["strait", 1.5, True, ""])
def test_a_turn_is_a_word_or_a_number(tmp_path: Path, turn: object) -> None:
    with pytest.raises(InputError, match=r"turns: 'AL\.\.\(1\)' must be left, through, right"):
        read_count(tmp_path, GERMAN, {"turns": {"AL..(1)": turn}})


def test_an_arm_without_counts_is_named(tmp_path: Path) -> None:
    mapping = {"arms": ["A", "B", "C", "D", "E"], "turns": {}}
    exits = {f"{a}{b}..(1)": k for a in "ABCD" for k, b in enumerate("LGR", 1)}
    count = read_count(tmp_path, GERMAN, {**mapping, "turns": exits})
    assert count.arms == ("A", "B", "C", "D", "E")
    assert "arms of the mapping of which nothing was counted: E" in count.notes


def test_a_mapping_is_a_table_in_toml(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text("classes = {")
    (tmp_path / "sheet.csv").write_text(GERMAN)
    from minisim.counts import read_counts

    with pytest.raises(FileError, match=r"map\.toml is not valid TOML"):
        read_counts(tmp_path / "sheet.csv", tmp_path / "map.toml")
