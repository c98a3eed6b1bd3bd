"""A perception that misreads intents, for tests."""

from __future__ import annotations

import random
from dataclasses import dataclass

from dim.perception import See
from minisim.control import Observed, Site, View


@dataclass(frozen=True)
class Misreading:
    """Reads each intent wrong with a probability.

    Attributes:
        error: the probability.
        missed: turns are read as straight on; otherwise any other manoeuvre is.
        common: all who look read the same.
        persistent: a reading lasts as long as two vehicles meet.
    """

    error: float = 0.15
    missed: bool = False
    common: bool = False
    persistent: bool = True

    def start(self, site: Site) -> See:
        """Begin a run."""
        straight = site.intersection.n // 2

        def read(view: View, ego: Observed, other: Observed) -> Observed:
            key = (site.seed, other.id, 0 if self.common else ego.id + 1)
            draw = random.Random(str(key if self.persistent else (*key, view.time)))
            if other.id == ego.id or draw.random() >= self.error:
                return other
            if self.missed:
                return other._replace(manoeuvre=straight)
            wrong = [m for m in range(1, site.intersection.n) if m != other.manoeuvre]
            return other._replace(manoeuvre=draw.choice(wrong))

        def see(view: View, ego: Observed) -> View:
            return View(view.time, tuple(read(view, ego, other) for other in view.vehicles))

        return see
