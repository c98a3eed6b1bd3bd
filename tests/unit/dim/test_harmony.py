"""The harmony matrix: from geometry, from files, and from the paper."""

from __future__ import annotations

import pickle
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from dim import HarmonyMatrix
from minisim.errors import FileError, InputError
from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType
from scenarios import PAPER
from scenarios.library import MAKERS

#: The paper's table "Harmony matrix for a four-way intersection", row by row.
PAPER_TABLE = """
a1 0 0 0 1 1 1 1 1 0 1 0 1
a2 0 0 0 0 0 0 1 1 0 1 0 0
a3 0 0 0 1 0 0 0 0 1 1 0 0
b1 1 0 1 0 0 0 1 1 1 1 1 0
b2 1 0 0 0 0 0 0 0 0 1 1 0
b3 1 0 0 0 0 0 1 0 0 0 0 1
c1 1 1 0 1 0 1 0 0 0 1 1 1
c2 1 1 0 1 0 0 0 0 0 0 0 0
c3 0 0 1 1 0 0 0 0 0 1 0 0
d1 1 1 1 1 1 0 1 0 1 0 0 0
d2 0 0 0 1 1 0 1 0 0 0 0 0
d3 1 0 0 0 0 1 1 0 0 0 0 0
"""


def four() -> list[list[int]]:
    """The 4-arm matrix as plain numbers, to be broken by a test."""
    values: list[list[int]] = HarmonyMatrix.paper(4).values.astype(int).tolist()
    return values


@pytest.mark.parametrize("vehicle", [VehicleType(), PAPER.vehicle], ids=["default", "paper"])
@pytest.mark.parametrize("n", [3, 4, 5])
def test_geometry_gives_the_papers_matrix_entry_by_entry(n: int, vehicle: VehicleType) -> None:
    ours = HarmonyMatrix.from_geometry(MAKERS[n]().intersection, vehicle)
    theirs = HarmonyMatrix.paper(n)
    assert ours.disagreements(theirs) == ()
    assert ours == theirs


def test_the_paper_matrix_of_four_arms_is_the_printed_table() -> None:
    matrix = HarmonyMatrix.paper(4)
    for line in PAPER_TABLE.strip().splitlines():
        label, *entries = line.split()
        for other, entry in zip(matrix.movements.names, entries, strict=True):
            assert matrix.harmony(label, other) == (entry == "1"), (label, other)


@pytest.mark.parametrize("n", [1, 2, 6, 12])
def test_the_paper_has_three_matrices(n: int) -> None:
    with pytest.raises(InputError, match=f"3, 4 and 5 arms, not for {n}"):
        HarmonyMatrix.paper(n)


def test_values_are_read_only_and_owned() -> None:
    source = np.array(four())
    matrix = HarmonyMatrix(4, source)
    source[:] = 0
    assert matrix == HarmonyMatrix.paper(4)
    assert matrix.values.dtype == np.bool_
    with pytest.raises(ValueError, match="read-only"):
        matrix.values[0, 3] = False


def test_equal_by_content_hashable_and_picklable() -> None:
    matrix = HarmonyMatrix(4, four())  # type: ignore[arg-type]
    other = pickle.loads(pickle.dumps(matrix))
    assert matrix == other == HarmonyMatrix.paper(4)
    assert len({matrix, other, HarmonyMatrix.paper(4), HarmonyMatrix.paper(5)}) == 2
    assert not other.values.flags.writeable
    assert matrix != "a matrix"
    assert repr(matrix) == repr(other) != repr(HarmonyMatrix.paper(3))
    assert type(HarmonyMatrix(np.int64(4), other.values).n) is int  # type: ignore[arg-type]
    assert "4 arms, 26 pairs" in repr(matrix)


def test_disagreements_name_each_unordered_pair_once() -> None:
    values = four()
    values[0][3] = values[3][0] = 0  # a1 b1
    values[10][11] = values[11][10] = 0
    values[2][5] = values[5][2] = 1  # a3 b3
    matrix = HarmonyMatrix(4, values)  # type: ignore[arg-type]
    pairs = matrix.disagreements(HarmonyMatrix.paper(4))
    assert [(str(a), str(b)) for a, b in pairs] == [("a1", "b1"), ("a3", "b3")]
    with pytest.raises(InputError, match="4 and 5 arms"):
        matrix.disagreements(HarmonyMatrix.paper(5))


@pytest.mark.parametrize("unknown", ["e1", "a4", "a0", "", "A1", Movement(4, 1), Movement(0, 0), 7])
def test_unknown_movement(unknown: object) -> None:
    with pytest.raises(InputError, match=r"a lane a … d and a manoeuvre 1 … 3"):
        HarmonyMatrix.paper(4).harmony("a1", unknown)  # type: ignore[arg-type]


def broken(row: int, column: int, value: float, *, mirrored: bool = False) -> list[list[float]]:
    values: list[list[float]] = [list(map(float, line)) for line in four()]
    values[row][column] = value
    if mirrored:
        values[column][row] = value
    return values


@pytest.mark.parametrize(
    ("n", "values", "message"),
    [
        (4, four()[:-1], "12 × 12, got 11 × 12"),
        (4, [row[:-1] for row in four()], "12 × 12, got 12 × 11"),
        (4, [*four()[:-1], [0, 1]], "^a harmony matrix must be square, but its rows differ in len"),
        (4, 1, "12 × 12, got 1"),
        (3, four(), "3 arms is 6 × 6, got 12 × 12"),
        (4, [["x"] * 12] * 12, "entries 0 and 1"),
        (4, broken(0, 4, 2.0, mirrored=True), "a1 with b2 is 2"),
        (4, broken(0, 4, 0.5, mirrored=True), "a1 with b2 is 0.5"),
        (4, broken(0, 4, np.nan, mirrored=True), "a1 with b2 is nan"),
        (4, broken(0, 4, 0.0), "a1 with b2 is 0 but 1 the other way round: .* must be symmetric"),
        (4, broken(3, 5, 1.0, mirrored=True), "b1 with b3 is 1, but they share a lane"),
        (4, broken(7, 7, 1.0), "c2 with c2 is 1, but they share a lane"),
        (2, [[0, 0], [0, 0]], "number of arms must be an integer 3 … 12, got 2"),
        (13, [[0]], "number of arms"),
        (4.0, four(), "number of arms"),
    ],
)
def test_what_is_not_a_harmony_matrix(n: object, values: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        HarmonyMatrix(n, values)  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [3, 4, 5])
def test_files_round_trip(n: int, tmp_path: Path) -> None:
    matrix = HarmonyMatrix.paper(n)
    path = tmp_path / "m.csv"
    matrix.to_csv(path)
    published = resources.files("dim").joinpath("data", f"harmony_{n}way.csv").read_bytes()
    assert path.read_bytes() == matrix.to_text().encode() == published.replace(b"\r\n", b"\n")
    assert HarmonyMatrix.from_csv(str(path)) == matrix
    assert list(tmp_path.iterdir()) == [path]


def test_spreadsheet_habits_are_read(tmp_path: Path) -> None:
    text = HarmonyMatrix.paper(3).to_text()
    habits = text.replace("a1", '"a1"').replace(",", ", ").replace("0\n", "0 \n")
    path = tmp_path / "m.csv"
    path.write_bytes(("\ufeff" + habits.replace("\n", "\r\n") + "\r\n\r\n").encode())
    assert HarmonyMatrix.from_csv(path) == HarmonyMatrix.paper(3)


GOOD = HarmonyMatrix.paper(3).to_text()


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        ("", FileError, "line 1: empty"),
        (GOOD.replace("b2,1,0,0,0,0,0", "b2,1,0,0,0,0"), FileError, "line 5: 6 cells, .* has 7"),
        (GOOD.replace("b2,1,0", "b2,1,0,0"), FileError, "line 5: 8 cells"),
        (GOOD[:40], FileError, "line 3: 3 cells, .* has 7"),
        (GOOD.replace("b2,1", 'b2,"1'), FileError, "line 7"),
        (GOOD.replace("b2,1", "b2,\udcff"), FileError, "line 5: not UTF-8"),
        (GOOD.replace("b2,1", "b2,2"), InputError, "line 5: the harmony of b2 with a1 is '2'"),
        (GOOD.replace("b2,1", "b2,1.0"), InputError, "'1.0'; allowed: 0 or 1"),
        (GOOD.replace("b2,1", "b2,0"), InputError, "m.csv: the harmony of a1 with b2 is 1 but"),
        (GOOD.replace("a1,0", "a1,1"), InputError, "a1 with a1 is 1, but they share a lane"),
        (GOOD.replace("\nb2,", "\nb3,"), InputError, "line 5: the row is labelled 'b3'.*'b2'"),
        (GOOD.replace(",b2", ",b7"), InputError, "line 1: column 5 is 'b7', expected 'b2'"),
        (GOOD.rsplit("c2", 1)[0], InputError, "line 6: not square: .* 6 movements, but 5 rows"),
        (",a1,a2,b1\na1,0,0,1\n", InputError, "line 1: 3 movements; .* n\\(n−1\\)"),
    ],
)
def test_broken_files(text: str, kind: type[Exception], message: str, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(kind, match=message) as caught:
        HarmonyMatrix.from_csv(path)
    assert type(caught.value) is kind
    assert "m.csv" in str(caught.value)


@pytest.mark.parametrize("path", ["missing/m.csv", ".", "", "nul\0"])
def test_unusable_paths(path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match=r"^cannot read harmony matrix.*: [^\[]+$"):
        HarmonyMatrix.from_csv(path)
    with pytest.raises(FileError, match=r"^cannot write "):
        HarmonyMatrix.paper(3).to_csv(path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", [0, 1.5, None, b"m.csv"])
def test_a_path_is_text(path: object) -> None:
    with pytest.raises(InputError, match=r"^harmony matrix file must be"):
        HarmonyMatrix.from_csv(path)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^path of a harmony matrix must be"):
        HarmonyMatrix.paper(3).to_csv(path)  # type: ignore[arg-type]
