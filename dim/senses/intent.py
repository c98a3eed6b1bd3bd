"""How a vehicle's intent is shown, how others read it, and how sure they are.

A driver may turn without a signal, which no other vehicle can know. A shown intent may be misread,
by each reader on its own or by all alike. A table of probabilities, true manoeuvre × read
manoeuvre, describes both, and gives how likely a reading is right.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from minisim.control import Site
from minisim.junction.turns import Turn, lane_turns, straightest
from minisim.streams import Draws

#: How a shown intent is misread. "missed": a turn's signal is not seen, so the turn is taken for
#: straight on; straight on is always read right. "symmetric": a manoeuvre is taken for any other
#: one alike, as classifiers of manoeuvres err.
KINDS = ("missed", "symmetric")

#: Probabilities of an error that are worth comparing, from none to that of a missing turn signal.
RATES = (0.0, 0.01, 0.02, 0.05, 0.10, 0.15, 0.25)

#: What a draw is for.
_SIGNAL, _READ, _SURE, _MISTAKEN = range(4)

Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Lane:
    """Intents of one approach lane.

    Attributes:
        straight: the manoeuvre that needs no signal.
        silent: of each manoeuvre, the probability that it is driven without a signal.
        error, kind: how often, and how (see `KINDS`), a shown intent is misread.
        doubt: of each manoeuvre, the share of its readings that are wrong if all are equally
            frequent.
    """

    straight: int
    silent: tuple[float, ...]
    error: float
    kind: str
    doubt: tuple[float, ...]

    @classmethod
    def of(
        cls, site: Site, lane: int, error: float, kind: str, unsignalled: tuple[float, float]
    ) -> Lane:
        """The lane of a site; `unsignalled` is the share of turns to the near and the far side."""
        straight = straightest(site.intersection, lane)
        near, far = unsignalled
        share = {Turn.NEAR: near, Turn.THROUGH: 0.0, Turn.FAR: far}
        silent = tuple(share[turn] for turn in lane_turns(site.intersection, lane))
        table = confusion(straight, silent, error, kind)
        return cls(straight, silent, error, kind, doubts(table))

    def read(self, draws: Draws, manoeuvre: int, vehicle: int, *when: int) -> int:
        """What is read; the same for the same vehicle and `when`, such as observer and moment.

        A vehicle that is misread at a small error is also misread at a larger one.
        """
        shown = manoeuvre
        if draws.uniform(_SIGNAL, vehicle) < self.silent[manoeuvre - 1]:
            shown = self.straight
        return self._misread(shown, draws.uniform(_READ, vehicle, *when))

    def confidence(
        self, draws: Draws, manoeuvre: int, read: int, vehicle: int, *when: int
    ) -> float:
        """How sure the reader is: of many readings with this confidence, this share is right."""
        chances = draws.uniform(_SURE, vehicle, *when), draws.uniform(_MISTAKEN, vehicle, *when)
        return confidence(self.doubt[read - 1], read == manoeuvre, chances)

    def _misread(self, shown: int, chance: float) -> int:
        if chance >= self.error or (self.kind == "missed" and shown == self.straight):
            return shown
        if self.kind == "missed":
            return self.straight
        others = [m for m in range(1, len(self.silent) + 1) if m != shown]
        return others[int(chance / self.error * len(others))]


def confusion(straight: int, silent: tuple[float, ...], error: float, kind: str) -> Table:
    """Probabilities of what each manoeuvre is read as: rows true, columns read, shape (k, k)."""
    k = len(silent)

    def reads(shown: int, read: int) -> float:
        if kind == "missed" and shown == straight:
            return float(read == shown)
        if read == shown:
            return 1.0 - error
        return error * (read == straight) if kind == "missed" else error / (k - 1)

    every = range(1, k + 1)
    return tuple(
        tuple((1.0 - s) * reads(true, read) + s * reads(straight, read) for read in every)
        for true, s in zip(every, silent, strict=True)
    )


def doubts(table: Table) -> tuple[float, ...]:
    """How likely each reading is wrong, by Bayes' rule for equally frequent manoeuvres."""
    columns = list(zip(*table, strict=True))
    return tuple(
        1.0 - column[m] / sum(column) if sum(column) > 0.0 else 0.0
        for m, column in enumerate(columns)
    )


def confidence(doubt: float, right: bool, chances: tuple[float, float]) -> float:
    """A calibrated confidence: of all readings with confidence c, the share c is right.

    Calibration: Guo, Pleiss, Sun, Weinberger, "On calibration of modern neural networks", ICML
    2017, eq. 1. For readings that are wrong with probability e, let confidences have the density
    a·c^(a−1) on (0, 1), a = (1−e)/e. Their mean is 1−e, and they spread as a classifier's do.
    Calibration then multiplies the density by c/(1−e) for right readings and by (1−c)/e for wrong
    ones: Beta(a+1, 1), the distribution of U^e, and Beta(a, 2), that of U^e·V^(e/(1−e)), for
    uniform U and V.

    Args:
        doubt: e, how likely such a reading is wrong.
        right: whether this one is right.
        chances: U and V.
    """
    if doubt <= 0.0:
        return 1.0
    if doubt >= 1.0:
        return 0.0
    u, v = chances
    sure = math.pow(u, doubt)
    return sure if right else sure * math.pow(v, doubt / (1.0 - doubt))


def leftover_error(doubt: float, threshold: float) -> float:
    """The share of readings that are wrong and at least as sure as a threshold.

    ∫ (1−c)·a·c^(a−1) dc from t to 1 = e − t^a + (1−e)·t^(a+1), see `confidence`.

    Args:
        doubt: e, the share of wrong readings, in [0, 1].
        threshold: t, in [0, 1].
    """
    if doubt <= 0.0 or doubt >= 1.0:
        return float(doubt >= 1.0 and threshold <= 0.0)
    a = (1.0 - doubt) / doubt
    return float(doubt - threshold**a + (1.0 - doubt) * threshold ** (a + 1.0))
