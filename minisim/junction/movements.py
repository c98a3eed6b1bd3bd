"""Movements and their indices. Only this module computes an index from lane and manoeuvre."""

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

    With several types of vehicles, those of each in turn: type k on manoeuvre j counts as
    manoeuvre k(n−1) + j of its lane.

    A movement's index is its place in this order: its row and column in every table, and its bit
    in every integer that stands for a set of movements. `movements_of` makes them.
    """

    n: int  #: number of arms
    types: int  #: and of types of vehicles
    names: tuple[str, ...]  #: such as a1
    origins: Ints  #: arm of origin by index, shape (m,)
    manoeuvres: Ints  #: likewise
    exits: Ints  #: arm of exit, likewise
    apart: Bools  #: whether two movements come from different arms, shape (m, m)
    index_of: Ints  #: index by lane and manoeuvre, shape (n, m/n + 1); −1 for manoeuvre 0
    #: The same as nested tuples, which are faster for single look-ups.
    rows: tuple[tuple[int, ...], ...]
    #: Bit by lane and manoeuvre; manoeuvre 0 means unknown and has the bits of all in its lane.
    bits: tuple[tuple[int, ...], ...]
    _numbers: dict[Movement | str, int]

    def __new__(cls, n: int, types: int = 1) -> Movements:
        """All movements of n arms, once per type."""
        turns = n - 1
        self = super().__new__(
            cls,
            (Movement(i, k * turns + j)
             for k in range(types) for i in range(n) for j in range(1, n)),
        )  # fmt: skip
        self.n, self.types = n, types
        self.names = tuple(map(str, self))
        self.origins, self.manoeuvres = np.array(self, dtype=np.int64).T.copy()
        self.exits = (self.origins + (self.manoeuvres - 1) % turns + 1) % n
        self.apart = self.origins[:, None] != self.origins[None, :]
        self.index_of = np.full((n, types * turns + 1), -1, dtype=np.int64)
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
        return movements_of, (self.n, self.types)

    @property
    def choices(self) -> int:
        """How many different movements a lane has, those of each type counted."""
        return self.types * (self.n - 1)

    def typed(self, kind: int, manoeuvre: int) -> int:
        """The manoeuvre as which a manoeuvre of vehicles of type `kind` counts."""
        return kind * (self.n - 1) + manoeuvre

    def number(self, movement: Movement | str) -> int:
        """Index of a movement, such as `Movement(0, 1)` or `"a1"`; raises `InputError`."""
        try:
            return self._numbers[movement]
        except (KeyError, TypeError):
            raise InputError(
                f"no movement {show(movement)} in an intersection of {self.n} arms: a lane a … "
                f"{ARM_NAMES[self.n - 1]} and a manoeuvre 1 … {self.types * (self.n - 1)}, "
                "such as a1"
            ) from None


def movements_of(n: int, types: int = 1) -> Movements:
    """The movements of a junction of n arms, once per type of vehicle."""
    return _made(n, types)


@lru_cache
def _made(n: int, types: int) -> Movements:
    return Movements(n, types)
