"""Which movements can be driven at the same time: the paper's harmony matrix.

A matrix comes from the geometry (movements are in harmony if the corridors that vehicles sweep on
them stay a clearance apart), from a file, or from the paper.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from minisim.errors import FileError, InputError, instance, integer, number, plural, show
from minisim.files import read_file, write_text
from minisim.fleet import Fleet, Vehicles
from minisim.junction.conflicts import CLEARANCE, conflicts
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES, Bools, Movement, Movements, movements_of
from minisim.vehicle import VehicleType

PAPER_ARMS = (3, 4, 5)  #: arm counts for which the authors published a matrix


@dataclass(frozen=True, eq=False, repr=False)
class HarmonyMatrix:
    """Harmony between all n(n−1) movements of a junction of n arms.

    It may tell types of vehicles apart, since all can see whether a vehicle is a bus.

    Raises `InputError`, with the entry, unless it is symmetric and all 0 or 1 (0 within a lane).
    """

    n: int  #: number of arms, 3 … 12
    #: Shape (m, m), m = n(n−1), read-only, in the order a1, a2, …, b1, …; True is harmony. With
    #: types, (types·m, types·m), see `Movements`.
    values: Bools
    types: int = 1  #: number of types that it tells apart

    def __post_init__(self) -> None:
        n = integer("number of arms", self.n, low=3, high=len(ARM_NAMES))
        object.__setattr__(self, "n", n)
        object.__setattr__(self, "types", integer("number of types", self.types, low=1))
        values = _checked(self.values, self.movements)
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @classmethod
    def from_geometry(
        cls,
        intersection: Intersection,
        vehicles: Vehicles | None = None,
        clearance: float = CLEARANCE,
        by_type: bool = False,
    ) -> HarmonyMatrix:
        """Harmony if the corridors that vehicles sweep stay over `clearance` (0 … 10 m) apart.

        A corridor is that of all types together, or `by_type` of each.
        """
        instance("intersection", intersection, Intersection)
        vehicles = VehicleType() if vehicles is None else vehicles
        instance("vehicles", vehicles, (VehicleType, Fleet))
        # Movements of one arm share their start: they are at distance 0 and in conflict too.
        clearance = number("clearance [m]", clearance, low=0, high=10)
        return _measured(intersection, vehicles, clearance, bool(by_type))

    @classmethod
    def paper(cls, n: int) -> HarmonyMatrix:
        """The authors' own matrix for 3, 4 or 5 arms (the paper prints the one for 4)."""
        if integer("number of arms", n, low=1) not in PAPER_ARMS:
            raise InputError(f"the paper has matrices for 3, 4 and 5 arms, not for {show(n)}")
        return _paper(int(n))

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> HarmonyMatrix:
        """Read a matrix: a header `,a1,a2,…`, then one line per movement, `a1,0,0,1,…`.

        Raises `FileError` if it is unreadable or not such a table (with the line), `InputError`
        for labels or entries that do not make a harmony matrix (with the entry).
        """
        return _parse(read_file("harmony matrix", path), f"harmony matrix {path!s}")

    def to_text(self) -> str:
        """The matrix as `from_csv` reads it."""
        names = self.movements.names
        rows = zip(names, self.values.astype(int).astype(str).tolist(), strict=True)
        lines = [",".join(["", *names]), *(",".join([label, *row]) for label, row in rows)]
        return "\n".join(lines) + "\n"

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the matrix, whole or not at all; raises `FileError` if that is impossible."""
        instance("path of a harmony matrix", path, (str, os.PathLike))
        write_text(path, self.to_text())

    @property
    def movements(self) -> Movements:
        """All n(n−1) movements of each type, in the order of rows and columns."""
        return movements_of(self.n, self.types)

    @property
    def choices(self) -> int:
        """How many different participants a lane can have."""
        return self.movements.choices

    def index(self, movement: Movement | str) -> int:
        """Row of a movement, such as `Movement(0, 1)` or `"a1"`; raises `InputError` if unknown."""
        return self.movements.number(movement)

    def harmony(self, first: Movement | str, second: Movement | str) -> bool:
        """Whether both can be driven together; raises `InputError` for an unknown movement."""
        return bool(self.values[self.index(first), self.index(second)])

    def disagreements(self, other: HarmonyMatrix) -> tuple[tuple[Movement, Movement], ...]:
        """The unordered pairs on which two matrices differ; raises `InputError` if n differs."""
        instance("other", other, HarmonyMatrix)
        if other.n != self.n:
            raise InputError(f"cannot compare matrices of {self.n} and {other.n} arms")
        differ = np.triu(self.values != other.values)
        return tuple((self.movements[r], self.movements[c]) for r, c in _where(differ))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, HarmonyMatrix):
            return NotImplemented
        return self.n == other.n and bool(np.array_equal(self.values, other.values))

    def __hash__(self) -> int:
        return hash((self.n, self.values.tobytes()))

    def __reduce__(self) -> tuple[type[HarmonyMatrix], tuple[int, Bools, int]]:
        # An unpickled array would be writable: go through the constructor.
        return HarmonyMatrix, (self.n, self.values, self.types)

    @property
    def spelling(self) -> str:
        """The matrix's name on command lines and in controller names; empty if not the paper's."""
        paper = self.n in PAPER_ARMS and self == HarmonyMatrix.paper(self.n)
        return f"paper({self.n})" if paper else ""

    def __repr__(self) -> str:
        # A controller's repr is kept as provenance, where the digest tells matrices apart.
        digest = hashlib.sha256(self.values.tobytes()).hexdigest()[:8]
        pairs = int(self.values.sum()) // 2
        return f"<HarmonyMatrix of {self.n} arms, {plural(pairs, 'pair')} in harmony, {digest}>"


@lru_cache(maxsize=256)
def _measured(
    intersection: Intersection, vehicles: Vehicles, clearance: float, by_type: bool
) -> HarmonyMatrix:
    values = ~conflicts(intersection, vehicles, clearance, by_type)
    return HarmonyMatrix(intersection.n, values, len(vehicles.types) if by_type else 1)


@lru_cache(maxsize=len(PAPER_ARMS))
def _paper(n: int) -> HarmonyMatrix:
    name = f"harmony_{n}way.csv"
    data = resources.files("dim").joinpath("data", name).read_bytes()
    return _parse(data, name)


def _checked(values: npt.ArrayLike, movements: Movements) -> Bools:
    """A bool copy of `values`, after every check that a harmony matrix must pass."""
    size, labels = len(movements), movements.names
    try:
        array = np.asarray(values)
    except ValueError:
        raise InputError("a harmony matrix must be square, but its rows differ in length") from None
    if array.shape != (size, size):
        raise InputError(
            f"a harmony matrix of {movements.n} arms is {size} × {size}, "
            f"got {' × '.join(map(str, array.shape)) or show(values)}"
        )
    if array.dtype.kind not in "biuf":
        raise InputError(f"a harmony matrix has entries 0 and 1, got {array.dtype} entries")
    for row, column in _where((array != 0) & (array != 1)):
        _refuse(labels, row, column, f"is {array[row, column]}; allowed: 0 or 1")
    result: Bools = array.astype(np.bool_)
    for row, column in _where(result != result.T):
        here = int(result[row, column])
        why = f"is {here} but {1 - here} the other way round: the matrix must be symmetric"
        _refuse(labels, row, column, why)
    for row, column in _where(result & ~movements.apart):
        _refuse(labels, row, column, "is 1, but they share a lane: it must be 0")
    return result


def _where(bad: Bools) -> Iterator[tuple[int, int]]:
    return ((r, c) for r, c in np.argwhere(bad).tolist())


def _refuse(labels: tuple[str, ...], row: int, column: int, why: str) -> NoReturn:
    raise InputError(f"the harmony of {labels[row]} with {labels[column]} {why}")


def _parse(data: bytes, where: str) -> HarmonyMatrix:
    rows = _table(data, where)
    line, header = rows[0]
    n = _arms(len(header) - 1, f"{where}, line {line}")
    labels = movements_of(n).names
    for k, (got, wanted) in enumerate(zip(header[1:], labels, strict=True), start=2):
        if got != wanted:
            raise InputError(f"{where}, line {line}: column {k} is {got!r}, expected {wanted!r}")
    if len(rows) - 1 != len(labels):
        raise InputError(
            f"{where}, line {rows[-1][0]}: not square: the header names {len(labels)} movements, "
            f"but {plural(len(rows) - 1, 'row')} {'follows' if len(rows) == 2 else 'follow'}"
        )
    values = [
        _row(cells, label, labels, f"{where}, line {line}")
        for (line, cells), label in zip(rows[1:], labels, strict=True)
    ]
    try:
        return HarmonyMatrix(n, np.array(values))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _table(data: bytes, where: str) -> list[tuple[int, list[str]]]:
    """The non-blank lines, each with its number; all have as many cells as the first."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FileError(f"{where}, line {line}: not UTF-8 text") from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, skipinitialspace=True)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader if cells]
    except csv.Error as error:
        raise FileError(f"{where}, line {reader.line_num}: {error}") from None
    if not rows:
        raise FileError(f"{where}, line 1: empty; expected a header such as ,a1,a2,b1,…")
    width = len(rows[0][1])
    for line, cells in rows:
        if len(cells) != width:
            raise FileError(
                f"{where}, line {line}: {plural(len(cells), 'cell')}, but the header has {width}"
            )
    return rows


def _arms(columns: int, where: str) -> int:
    for n in range(3, len(ARM_NAMES) + 1):
        if len(movements_of(n)) == columns:
            return n
    raise InputError(f"{where}: {columns} movements; n arms have n(n−1), so 6, 12, 20, …")


def _row(cells: list[str], label: str, labels: tuple[str, ...], where: str) -> list[int]:
    if cells[0] != label:
        raise InputError(f"{where}: the row is labelled {cells[0]!r}, expected {label!r}")
    for other, cell in zip(labels, cells[1:], strict=True):
        if cell not in ("0", "1"):
            raise InputError(
                f"{where}: the harmony of {label} with {other} is {cell!r}; allowed: 0 or 1"
            )
    return [int(cell) for cell in cells[1:]]
