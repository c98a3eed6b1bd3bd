"""No two bodies touch and every vehicle is served, whether humans drive or not."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from dim import Dim, Humans, Mixed
from dim.agent import GATES
from dim.decision import ORDERS
from dim.humans.drivers import Drivers
from dim.humans.queue import Queue
from minisim.control import Command, Observed, Session, Site, View
from scenarios import four_way
from scenarios.profiles import FAIR, PAPER
from scenarios.scenario import Scenario
from scenarios.strategies import demands, intersections
from tests.builders import replayed, share

SHARES = (0.05, 0.2, 0.5, 0.8, 0.95, 1.0)
#: What may be believed without believing in silence, which is unsafe.
SAFE = ("motion", "signals")
#: How long demand lasts, and how much time is left to serve it [s].
DEMANDED, DRAINED = 240.0, 3600.0


@st.composite
def traffic(draw: st.DrawFn) -> tuple[Scenario, Mixed]:
    """Any junction of 3 … 5 arms, side, demand, gate, and way to drive."""
    roads = draw(st.sampled_from([120.0, 200.0]))
    intersection = replace(draw(intersections(3, 5)), arm_length=roads)
    demand = draw(demands(intersection.n, max_density=250.0))
    scenario = Scenario(
        name="random", intersection=intersection, demand=demand,
        profile=draw(st.sampled_from([PAPER, FAIR])),
        horizon=DEMANDED + DRAINED,
        recorded=demand.draw(intersection.n, DEMANDED, seed=draw(st.integers(0, 1000))),
    )  # fmt: skip
    humans = Humans(
        follow_up=draw(st.sampled_from([(3.3, 4.0, 3.5), (0.0, 0.0, 0.0)])),
        reaction=draw(st.sampled_from([0.5, 1.9])),
        trust=draw(st.sampled_from(SAFE)),
    )
    dim = Dim(order=draw(st.sampled_from(ORDERS)), gate=draw(st.sampled_from(GATES)))
    return scenario, Mixed(dim, draw(st.sampled_from(SHARES)), humans, draw(st.sampled_from(SAFE)))


@dataclass(frozen=True)
class Watched:
    """The mixture, of which no vehicle may overtake a human in whose way it is."""

    mixed: Mixed
    name = "watched"

    def start(self, site: Site) -> Session:
        return _Watched(self.mixed, site)


class _Watched:
    def __init__(self, mixed: Mixed, site: Site) -> None:
        self._session, self._site = mixed.start(site), site
        self._drivers = Drivers(mixed.share, site.seed)
        self._queue = Queue(mixed.dim.zones, self._drivers)
        self.plan = self._session.plan

    def decide(self, view: View) -> Iterable[Command]:
        before = list(self._queue.heads.values())
        self._queue.look(view)
        entered = [v for v in before if v.id not in self._queue.heads]
        for vehicle in entered:
            for other in before[: before.index(vehicle)]:
                if other not in entered and self._drivers[other.lane, other.rank].human:
                    assert not self._conflict(vehicle, other), f"{vehicle} overtakes {other}"
        return self._session.decide(view)

    def _conflict(self, one: Observed, other: Observed) -> bool:
        rows = self._site.intersection.movements.rows
        mine, theirs = (rows[v.lane][v.manoeuvre] for v in (one, other))
        return bool(self._site.conflicts[mine, theirs])


def check(scenario: Scenario, mixed: Mixed, seed: int = 1) -> None:
    """A collision raises; a vehicle that was not served is a failure."""
    run = minisim.simulate(scenario, Watched(mixed), seed)
    unserved = (~run.columns.arrived).nonzero()[0].tolist()
    assert unserved == [], f"vehicles {unserved} under {mixed}"


@share(0.3)
@given(traffic())
def test_safe_and_alive(given_traffic: tuple[Scenario, Mixed]) -> None:
    check(*given_traffic)


@cache
def seed_of(lanes: tuple[int, ...], kinds: tuple[bool, ...], quiet: bool) -> int:
    """A seed whose first vehicles on these lanes are human or not, and quiet or not, as asked."""
    for seed in itertools.count():
        drivers = Drivers(0.5, seed)
        found = [drivers[lane, 0] for lane in lanes]
        fitting = all(not d.human or (d.careless < 0.25) == quiet for d in found)
        if fitting and tuple(d.human for d in found) == kinds:
            return seed
    raise AssertionError("seeds do not end")


#: Each movement of lane a with each of another lane; the rest are rotations.
PAIRS = [((0, m), (lane, k)) for m in (1, 2, 3) for lane in (1, 2, 3) for k in (1, 2, 3)]
#: How much later the second comes [s]: they meet at the line, in the yellow zone, or inside.
DELAYS = (0.0, 0.6, 1.7, 3.4)


@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("kinds", [(True, False), (False, True), (True, True)])
def test_every_pair_passes_without_waiting_for_ever(gate: str, kinds: tuple[bool, bool]) -> None:
    """Every two movements on four arms, whichever comes first, announced or not."""
    road = four_way(profile="fair", arm_length=120.0)
    mixed = Mixed(Dim(gate=gate), 0.5)
    for (first, second), delay, quiet in itertools.product(PAIRS, DELAYS, (False, True)):
        scenario = replayed(road, (0.0, *first), (delay, *second), horizon=90.0)
        check(scenario, mixed, seed_of((first[0], second[0]), kinds, quiet))


@pytest.mark.parametrize("gate", GATES)
def test_no_vehicles_wait_in_a_circle(gate: str) -> None:
    """One per lane at once, straight or to the far side, humans and others in every mixture."""
    road = four_way(profile="fair", arm_length=120.0)
    mixed = Mixed(Dim(gate=gate), 0.5)
    for kinds in itertools.product((True, False), repeat=4):
        for ways in itertools.product((2, 3), repeat=4):
            trips = [(0.1 * lane, lane, way) for lane, way in enumerate(ways)]
            scenario = replayed(road, *trips, horizon=150.0)
            check(scenario, mixed, seed_of((0, 1, 2, 3), kinds, quiet=False))


@share(0.2)
@given(seed=st.integers(0, 1000))
def test_drivers_depend_only_on_seed_and_share(seed: int) -> None:
    fewer, more, alike = (Drivers(share, seed) for share in (0.2, 0.7, 0.2))
    vehicles = [(lane, rank) for rank in range(100) for lane in range(5)]
    for which in vehicles:
        assert more[which].human or not fewer[which].human
        assert alike[which] == fewer[which]
