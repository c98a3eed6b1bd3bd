"""Movements and their indices. Only this module works out an index from lane and manoeuvre."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.errors import InputError, show

Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

ARM_NAMES = "abcdefghijkl"


class Movement(NamedTuple):
    """From arm `origin` (0 = a) into the `manoeuvre`-th arm clockwise; written `a1`, `c3`."""

    origin: int
    manoeuvre: int

    def __str__(self) -> str:
        return f"{ARM_NAMES[self.origin]}{self.manoeuvre}"


class Movements(tuple[Movement, ...]):
    """The m = n(n−1) movements of a junction of n arms: a1, a2, …, b1, b2, …

    A movement's place in this order is its index: its row and column in every table, and its bit
    in every integer that stands for a set of movements. `movements_of` makes them.

    Attributes:
        n: number of arms.
        names: such as a1.
        origins, manoeuvres, exits: arm of origin, manoeuvre and arm of exit by index, shape (m,).
        apart: whether two movements come from different arms, shape (m, m).
        index_of: index by lane and manoeuvre, shape (n, n); −1 for manoeuvre 0.
        rows: the same as nested tuples, which are quicker for one look-up at a time.
        bits: bit by lane and manoeuvre. Manoeuvre 0 stands for an unknown one and has the bits of
            all movements of its lane.
    """

    n: int
    names: tuple[str, ...]
    origins: Ints
    manoeuvres: Ints
    exits: Ints
    apart: Bools
    index_of: Ints
    rows: tuple[tuple[int, ...], ...]
    bits: tuple[tuple[int, ...], ...]
    _numbers: dict[Movement | str, int]

    def __new__(cls, n: int) -> Movements:
        """All movements of n arms."""
        self = super().__new__(cls, (Movement(i, j) for i in range(n) for j in range(1, n)))
        self.n = n
        self.names = tuple(map(str, self))
        self.origins, self.manoeuvres = np.array(self, dtype=np.int64).T.copy()
        self.exits = (self.origins + self.manoeuvres) % n
        self.apart = self.origins[:, None] != self.origins[None, :]
        self.index_of = np.full((n, n), -1, dtype=np.int64)
        self.index_of[self.origins, self.manoeuvres] = range(len(self))
        for table in (self.origins, self.manoeuvres, self.exits, self.apart, self.index_of):
            table.setflags(write=False)
        self.rows = tuple(map(tuple, self.index_of.tolist()))
        self.bits = tuple(
            (sum(1 << k for k in row[1:]), *(1 << k for k in row[1:])) for row in self.rows
        )
        self._numbers = {m: k for k, m in enumerate(self)}
        self._numbers.update({name: k for k, name in enumerate(self.names)})
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return movements_of, (self.n,)

    def number(self, movement: Movement | str) -> int:
        """Index of a movement, such as `Movement(0, 1)` or `"a1"`; raises `InputError`."""
        try:
            return self._numbers[movement]
        except (KeyError, TypeError):
            raise InputError(
                f"no movement {show(movement)} in an intersection of {self.n} arms: a lane a … "
                f"{ARM_NAMES[self.n - 1]} and a manoeuvre 1 … {self.n - 1}, such as a1"
            ) from None

    def of_lane(self, lane: int) -> tuple[int, ...]:
        """Indices of a lane's movements, manoeuvre 1 first."""
        return self.rows[lane][1:]


@lru_cache
def movements_of(n: int) -> Movements:
    """The movements of a junction of n arms."""
    return Movements(n)
