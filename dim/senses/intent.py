"""How a vehicle's intent is shown, how others read it, and how sure they are.

A driver may turn without a signal, and a shown intent may be misread, by each reader on its own or
by all alike. A table of probabilities, true × read manoeuvre, tells how sure a reading is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from minisim.control import Site
from minisim.junction.turns import Turn, lane_turns, straightest
from minisim.streams import Draws

#: How a shown intent is misread. "missed": a turn's signal is not seen, so the turn is taken for
#: straight on; straight on is always read correctly. "symmetric": a manoeuvre is equally likely to
#: be taken for any other one, as manoeuvre classifiers err.
KINDS = ("missed", "symmetric")

#: Error probabilities worth comparing, from zero to that of a missing turn signal.
RATES = (0.0, 0.01, 0.02, 0.05, 0.10, 0.15, 0.25)

_SIGNAL, _READ, _SURE, _MISTAKEN = range(4)  # what a draw is for

Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Lane:
    """Intents of one approach lane."""

    straight: int  #: the manoeuvre that needs no signal
    silent: tuple[float, ...]  #: probability that each manoeuvre is driven without a signal
    error: float  #: how often a shown intent is misread
    kind: str  #: in what way it is misread, see `KINDS`
    doubt: tuple[float, ...]  #: see `doubts`

    @classmethod
    def of(
        cls, site: Site, lane: int, error: float, kind: str, unsignalled: tuple[float, float]
    ) -> Lane:
        """A lane of a site; `unsignalled` is the share of turns to the near and the far side."""
        straight = straightest(site.intersection, lane)
        near, far = unsignalled
        share = {Turn.NEAR: near, Turn.THROUGH: 0.0, Turn.FAR: far}
        silent = tuple(share[turn] for turn in lane_turns(site.intersection, lane))
        table = confusion(straight, silent, error, kind)
        return cls(straight, silent, error, kind, doubts(table))

    def read(self, draws: Draws, manoeuvre: int, vehicle: int, *when: int) -> int:
        """What is read; the same for the same vehicle and `when`, such as observer and moment.

        A vehicle that is misread at a small error rate is also misread at a larger one.
        """
        silent = draws.uniform(_SIGNAL, vehicle) < self.silent[manoeuvre - 1]
        shown, chance = self.straight if silent else manoeuvre, draws.uniform(_READ, vehicle, *when)
        if chance >= self.error or (self.kind == "missed" and shown == self.straight):
            return shown
        if self.kind == "missed":
            return self.straight
        others = [m for m in range(1, len(self.silent) + 1) if m != shown]
        return others[int(chance / self.error * len(others))]

    def confidence(self, draws: Draws, manoeuvre: int, read: int, vehicle: int, *at: int) -> float:
        """How sure the reader is: of many readings with this confidence, this share is right."""
        chances = draws.uniform(_SURE, vehicle, *at), draws.uniform(_MISTAKEN, vehicle, *at)
        return confidence(self.doubt[read - 1], read == manoeuvre, chances)


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
    """How likely each reading is to be wrong, by Bayes' rule for equally frequent manoeuvres."""
    columns = enumerate(zip(*table, strict=True))
    return tuple(1.0 - of[m] / sum(of) if sum(of) > 0.0 else 0.0 for m, of in columns)


def confidence(doubt: float, right: bool, chances: tuple[float, float]) -> float:
    """A calibrated confidence: of all readings with confidence c, a share c is right.

    Calibration: Guo, Pleiss, Sun, Weinberger, "On calibration of modern neural networks", ICML
    2017, eq. 1. For readings that are wrong with probability e, let confidences have the density
    a·c^(a−1) on (0, 1), a = (1−e)/e. Their mean is 1−e, and they spread like a classifier's.
    Calibration then multiplies the density by c/(1−e) for right readings and by (1−c)/e for wrong
    ones: Beta(a+1, 1), the distribution of U^e, and Beta(a, 2), that of U^e·V^(e/(1−e)), for
    uniform U and V. Here `doubt` is e, and `chances` are U and V.
    """
    if doubt <= 0.0 or doubt >= 1.0:
        return float(doubt <= 0.0)
    u, v = chances
    sure = math.pow(u, doubt)
    return sure if right else sure * math.pow(v, doubt / (1.0 - doubt))
