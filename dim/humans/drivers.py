"""Human drivers: who drives, what they signal, and which gaps they accept.

The numbers are those of the Highway Capacity Manual (HCM, 7th edition), chapter 20, for two-way
stop control, base values of a two-lane major street: drivers who stopped at a stop sign of the
minor street, that is streams of rank 2 (right turns), 3 (straight on) and 4 (left turns) in
right-hand traffic. An unsignalised junction of equal roads is another case, the all-way stop (HCM
chapter 21): there everybody stops, and nobody accepts a gap in a stream that does not. So drivers
here do both: among themselves they go in the order of stopping, and from vehicles that need not
stop they accept gaps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from minisim.control import Observed, Site
from minisim.errors import InputError, choice, integer, number, numbers
from minisim.junction.conflicts import CLEARANCE
from minisim.junction.movements import Bools
from minisim.junction.partings import parting
from minisim.junction.turns import Turn, turns
from minisim.streams import stream

#: What others believe of a human's way. "motion": only what its place and heading show. "signals":
#: also an indicator that blinks. "silence": also that who shows none goes straight on, which is
#: false for the turns that no indicator announces.
TRUSTS = ("motion", "signals", "silence")

#: Bounds of a uniform draw whose normal quantile is taken.
TAIL = 1e-9


@dataclass(frozen=True, kw_only=True)
class Humans:
    """How people drive. Triples are for the near turn, straight on, and the far turn.

    Attributes:
        critical_gaps: the shortest time until a vehicle that need not stop arrives, for which a
            driver goes first [s] (HCM exhibit 20-17).
        follow_up: the shortest time between two drivers of one lane [s] (HCM exhibit 20-18).
        deviation: standard deviation of a driver's critical gap over its mean, log-normal over
            drivers as in the usual maximum-likelihood estimate (Tian et al. 1999, Transp. Res. A
            33:187). 0 makes all drivers alike, as the HCM takes it; a published value for these
            junctions was not found.
        reaction: from standing at the line to moving, where nobody is in the way [s]. The HCM's
            all-way stop has a departure headway of 3.9 s then, of which 2.0 s are for moving up
            (exhibit 21-15, case 1); highway design takes 2.0 s at a stop sign (AASHTO).
        unsignalled: the share of near and far turns that no indicator announces: 29 % of right
            and 25 % of left turns in right-hand traffic (Sullivan et al. 2015, Accid. Anal. Prev.
            74:1).
        trust: what drivers believe of each other, see `TRUSTS`. Until they know where another
            goes, they keep out of all ways that it may take.

    Raises:
        InputError: a number out of range.
    """

    critical_gaps: tuple[float, float, float] = (6.2, 6.5, 7.1)
    follow_up: tuple[float, float, float] = (3.3, 4.0, 3.5)
    deviation: float = 0.0
    reaction: float = 1.9
    unsignalled: tuple[float, float] = (0.29, 0.25)
    trust: str = "signals"

    def __post_init__(self) -> None:
        _several(self, "critical_gaps", "critical gap [s]", 3, 60.0)
        _several(self, "follow_up", "follow-up time [s]", 3, 60.0)
        _several(self, "unsignalled", "share of unsignalled turns", 2, 1.0)
        number("deviation of critical gaps", self.deviation, low=0, high=1)
        # A vehicle that was given the right of way moves off within a few steps; a driver must
        # look for longer than that, or would not see it coming.
        number("reaction [s]", self.reaction, low=0.5, high=60)
        choice("trust", self.trust, TRUSTS)


def _several(humans: Humans, field: str, name: str, count: int, high: float) -> None:
    """Check a field of so many numbers 0 … `high`, and keep it as a tuple."""
    values = numbers(field, getattr(humans, field))
    if len(values) != count:
        raise InputError(f"{field} must be {count} numbers, got {values}")
    for value in values:
        number(name, value, low=0, high=high)
    object.__setattr__(humans, field, values)


class Driver(NamedTuple):
    """One vehicle's driver.

    Attributes:
        human: or it follows DIM.
        careless: from 0 to 1: it leaves out the indicator of turns that more drivers than this do.
        gap: factor on the critical gaps.
    """

    human: bool
    careless: float
    gap: float


class Drivers:
    """The drivers of one run, drawn by vehicle id: the same whatever controller asks, and when.

    Who is human at some share is so at every larger one.
    """

    def __init__(self, humans: Humans, share: float, seed: int) -> None:
        self._share = share
        self._stream = stream(seed, "humans")
        deviation = math.sqrt(math.log1p(humans.deviation**2))
        self._gaps = NormalDist(-deviation * deviation / 2.0, deviation) if deviation else None
        self._drivers: list[Driver] = []

    def __getitem__(self, vehicle: int) -> Driver:
        while vehicle >= len(self._drivers):
            self._drivers += map(self._driver, *self._stream.random((256, 3)).T.tolist())
        return self._drivers[vehicle]

    def _driver(self, human: float, careless: float, gap: float) -> Driver:
        factor = 1.0
        if self._gaps is not None:
            factor = math.exp(self._gaps.inv_cdf(min(max(gap, TAIL), 1.0 - TAIL)))
        return Driver(human < self._share, careless, factor)

    def human(self, count: int) -> Bools:
        """Which of the first `count` vehicles are human, shape (count,)."""
        integer("number of vehicles", count, low=0)
        return np.array([self[vehicle].human for vehicle in range(count)], dtype=bool)


class Readings:
    """What indicators and motion leave possible of a vehicle's way, for all who see it.

    Motion is position: once two ways of a lane are `CLEARANCE` apart, a vehicle's place tells on
    which of them it is.
    """

    def __init__(self, humans: Humans, site: Site, drivers: Drivers) -> None:
        self.turns = turns(site.intersection)
        self._silent = (humans.unsignalled[0], 1.0, humans.unsignalled[1])
        self._drivers = drivers
        self._rows = site.intersection.movements.rows
        self._parting = parting(site.intersection, CLEARANCE).tolist()

    def index(self, vehicle: Observed) -> int:
        """Of its true movement."""
        return self._rows[vehicle.lane][vehicle.manoeuvre]

    def possible(self, vehicle: Observed, trust: str) -> list[int]:
        """Movements, by index, that a vehicle may take for all that others see.

        Vehicles that follow DIM announce every turn, so that none means straight on.
        """
        movement = self.index(vehicle)
        parts, inside = self._parting[movement], -vehicle.distance
        alike = [q for q in self._rows[vehicle.lane][1:] if inside <= parts[q]]
        driver = self._drivers[vehicle.id]
        turn = self.turns[movement]
        if driver.human:
            shown = Turn.THROUGH if driver.careless < self._silent[turn] else turn
            if trust == "motion" or (trust == "signals" and shown is Turn.THROUGH):
                return alike
            turn = shown
        meant = [q for q in alike if self.turns[q] is turn]
        return meant or alike  # motion belies silence, or the lane has no way straight on
