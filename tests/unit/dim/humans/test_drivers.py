"""Which vehicles humans drive, what they signal, and what others can know of their ways."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from dim import Humans
from dim.humans.drivers import TRUSTS, Drivers, Readings
from minisim.control import Observed, Site
from minisim.junction.turns import Turn
from scenarios import four_way, three_way
from tests import builders

NEAR, THROUGH, FAR = Turn
SITE = four_way(profile="fair").site()
MANY = 20_000


def human(share: float, seed: int = 3, count: int = MANY) -> np.ndarray:
    drivers = Drivers(share, seed)
    return np.array([drivers[i % 4, i // 4].human for i in range(count)])


def test_shares_are_nested() -> None:
    shares = (0.0, 0.05, 0.2, 0.4, 0.8, 1.0)
    masks = [human(share) for share in shares]
    for less, more in itertools.pairwise(masks):
        assert not np.any(less & ~more)
    assert not masks[0].any()
    assert masks[-1].all()
    for share, mask in zip(shares, masks, strict=True):
        # Five standard deviations of a binomial share.
        assert abs(mask.mean() - share) <= 5.0 * math.sqrt(share * (1.0 - share) / MANY)


def test_drivers_do_not_depend_on_the_order_of_asking() -> None:
    forwards, backwards = (Drivers(0.5, 7) for _ in range(2))
    wanted = [forwards[1, i] for i in range(1000)]
    assert [backwards[1, i] for i in reversed(range(1000))] == wanted[::-1]
    for other in (Drivers(0.5, 8), forwards):
        assert wanted != [other[2, i] for i in range(1000)]


def readings(share: float = 1.0, site: Site = SITE) -> Readings:
    return Readings(Humans(), site, Drivers(share, 1))


def seen(vehicle: int, manoeuvre: int, distance: float = 5.0, lane: int = 0) -> Observed:
    return builders.seen(vehicle, lane, manoeuvre, distance, 1.0)


@pytest.mark.parametrize(("manoeuvre", "rate"), [(1, 0.29), (2, 0.0), (3, 0.25)])
def test_turns_without_a_signal_have_the_published_rates(manoeuvre: int, rate: float) -> None:
    read = readings()
    straight = [read.possible(seen(i, manoeuvre), "silence") == [1] for i in range(MANY)]
    wanted = 1.0 if manoeuvre == 2 else rate
    assert np.mean(straight) == pytest.approx(wanted, abs=5 * math.sqrt(0.25 / MANY))


def test_what_is_believed() -> None:
    read = readings()
    drivers = Drivers(1.0, 1)
    silent = next(i for i in range(100) if drivers[1, i].careless < 0.25)
    telling = next(i for i in range(100) if drivers[1, i].careless > 0.29)
    everything = [3, 4, 5]  # of lane b
    table = {
        ("motion", telling, 1): everything,
        ("motion", silent, 1): everything,
        ("motion", telling, 2): everything,
        ("signals", telling, 1): [3],
        ("signals", silent, 1): everything,
        ("signals", telling, 2): everything,
        ("signals", telling, 3): [5],
        ("silence", telling, 3): [5],
        ("silence", silent, 3): [4],  # wrong, as others are
        ("silence", telling, 2): [4],
    }
    for (trust, vehicle, manoeuvre), wanted in table.items():
        assert read.possible(seen(vehicle, manoeuvre, lane=1), trust) == wanted


@pytest.mark.parametrize("trust", TRUSTS)
@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
def test_motion_shows_the_way_in_the_end_and_never_excludes_it_before(
    trust: str, manoeuvre: int
) -> None:
    read = readings()
    for vehicle, distance in itertools.product(range(40), np.arange(5.0, -20.0, -0.5)):
        ways = read.possible(seen(vehicle, manoeuvre, float(distance)), trust)
        if trust != "silence":
            assert manoeuvre - 1 in ways
        if distance < -8.0:
            assert ways == [manoeuvre - 1]


def test_vehicles_of_dim_always_tell() -> None:
    read = readings(share=0.0)
    for vehicle, manoeuvre, trust in itertools.product(range(20), (1, 2, 3), TRUSTS):
        assert read.possible(seen(vehicle, manoeuvre), trust) == [manoeuvre - 1]


def test_where_no_way_leads_straight_on_silence_says_nothing() -> None:
    read = readings(site=three_way().site())
    drivers = Drivers(1.0, 1)
    silent = next(i for i in range(100) if drivers[0, i].careless < 0.25)
    assert read.possible(seen(silent, 1), "silence") == [0, 1]


@pytest.mark.parametrize(
    ("distance", "own", "blocks"),
    [
        (5.0, [1], True),  # before the junction, a2 and b2 conflict
        (-3.0, [1], True),
        (-13.0, [1], False),  # out of the way of a2, though not yet out of the junction
        (-13.0, [0, 1, 2], True),  # but not of a3, which takes the same exit
        (5.0, [0], False),
        (2.0, [10], True),  # b2 might be b3, in the way of d2
        (-9.0, [10], False),  # its place shows that it is not
    ],
)
def test_what_is_in_the_way(distance: float, own: list[int], blocks: bool) -> None:
    assert readings().blocks(seen(0, 2, distance, lane=1), own, "motion") is blocks
