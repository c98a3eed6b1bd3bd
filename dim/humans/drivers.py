"""Human drivers: which vehicles have one, what they signal, and how fast they react.

A junction of equal roads is an all-way stop (Highway Capacity Manual, HCM, 7th edition, chapter
21): all drivers stop, the first to stop is the first to go, and none has to accept a gap.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from minisim.control import Observed, Site
from minisim.junction.conflicts import CLEARANCE, clearing_distances
from minisim.junction.partings import parting
from minisim.junction.turns import Turn, turns
from minisim.parameters import Reals, declared, real, reals, word
from minisim.streams import Draws

#: What others go by to tell a human's way. "motion": only what its place and heading show.
#: "signals": also a blinking indicator. "silence": also that a vehicle without one goes straight
#: on, which is false for turns that no indicator announces.
TRUSTS = ("motion", "signals", "silence")

_HUMAN, _CARELESS = range(2)  # what a draw is for


@declared(kw_only=True)
class Humans:
    """How people drive. Triples are for the near turn, straight on, and the far turn."""

    # HCM exhibit 20-18: right turns, straight on and left turns at a two-way stop on the right.
    follow_up: Reals[tuple[float, float, float]] = reals(
        "shortest time between two drivers of one lane", "s",
        count=3, low=0, high=60, default=(3.3, 4.0, 3.5),
    )  # fmt: skip
    # The HCM's all-way stop has a departure headway of 3.9 s where nothing is in the way, including
    # 2.0 s for moving up (exhibit 21-15, case 1); highway design takes 2.0 s at a stop sign
    # (AASHTO). A vehicle with the right of way needs less to move off: a few steps.
    reaction: float = real(
        "time from standing at the line to moving, where nothing is in the way", "s",
        low=0.5, high=60, default=1.9,
    )  # fmt: skip
    # 29 % of right, 25 % of left turns in the USA (Sullivan et al. 2015, Accid. Anal. Prev. 74:1).
    unsignalled: Reals[tuple[float, float]] = reals(
        "share of near and of far turns that no indicator announces",
        count=2, low=0, high=1, default=(0.29, 0.25),
    )  # fmt: skip
    trust: str = word(
        "what drivers believe about each other: motion; also a signal; also that no signal means "
        "straight on. They keep out of all ways that another may take",
        TRUSTS, default="signals",
    )  # fmt: skip


class Driver(NamedTuple):
    """One vehicle's driver."""

    human: bool  #: otherwise the vehicle follows DIM
    careless: float  #: 0 … 1; it signals a turn only if at most this share of drivers does not


class Drivers:
    """The drivers of a run, by lane and rank in it; a human at one share is human at any larger."""

    def __init__(self, share: float, seed: int) -> None:
        self._share = share
        self._draws = Draws(seed, "humans")
        self._drivers: dict[tuple[int, int], Driver] = {}

    def __getitem__(self, which: tuple[int, int]) -> Driver:
        if which not in self._drivers:
            human = self._draws.uniform(_HUMAN, *which) < self._share
            self._drivers[which] = Driver(human, self._draws.uniform(_CARELESS, *which))
        return self._drivers[which]


class Readings:
    """The ways that a vehicle's indicator and place leave open to it, as others see them."""

    def __init__(self, humans: Humans, site: Site, drivers: Drivers) -> None:
        self.turns = turns(site.intersection)
        self._silent = (humans.unsignalled[0], 1.0, humans.unsignalled[1])
        self.drivers = drivers
        self.rows = site.intersection.movements.rows
        self._clearing = [
            clearing_distances(site.intersection, it, site.fleet).tolist() for it in site.types
        ]
        # Beyond the parting of two ways, a vehicle's place shows which of them it takes.
        self._parting = parting(site.intersection, CLEARANCE).tolist()

    def index(self, vehicle: Observed) -> int:
        """The index of its true movement."""
        return self.rows[vehicle.lane][vehicle.manoeuvre]

    def possible(self, vehicle: Observed, trust: str) -> list[int]:
        """Movements, by index, that a vehicle might take, as far as others can tell.

        Vehicles that follow DIM announce every turn, so one without a signal goes straight on.
        """
        movement = self.index(vehicle)
        parts, inside = self._parting[movement], -vehicle.distance
        alike = [q for q in self.rows[vehicle.lane][1:] if inside <= parts[q]]
        driver = self.drivers[vehicle.lane, vehicle.rank]
        turn = self.turns[movement]
        if driver.human:
            shown = Turn.THROUGH if driver.careless < self._silent[turn] else turn
            if trust == "motion" or (trust == "signals" and shown is Turn.THROUGH):
                return alike
            turn = shown
        meant = [q for q in alike if self.turns[q] is turn]
        return meant or alike  # motion contradicts silence, or the lane has no way straight on

    def blocks(self, other: Observed, own: Iterable[int], trust: str) -> bool:
        """Whether another may be, or come, in the way of a vehicle on one of its `own` movements.

        A vehicle inside the junction no longer is once its rear has left their corridors.
        """
        # The distances are minus infinity where ways do not conflict.
        return any(
            self._clearing[other.type][mine][way] + min(other.distance, 0.0) > 0.0
            for way in self.possible(other, trust)
            for mine in own
        )
