"""How intents are shown and read: rates, confusion, and calibrated confidence in closed form."""

from __future__ import annotations

import math

import pytest

from dim.senses.intent import KINDS, Lane, confidence, confusion, doubts
from dim.senses.noise import UNSIGNALLED
from minisim.streams import Draws
from minisim.testing import small_scenario

DRAWS = Draws(1, "perception")
COUNT = 4000
#: |z| beyond which a test fails by chance once in 15,000 cases.
Z = 4.0


def lane(error: float, kind: str, unsignalled: tuple[float, float] = (0.0, 0.0)) -> Lane:
    return Lane.of(small_scenario(4).site(0), 0, error, kind, unsignalled)


def close(count: int, share: float, of: int = COUNT) -> bool:
    """Whether a binomial count is within `Z` standard deviations."""
    return abs(count - share * of) <= Z * math.sqrt(of * share * (1.0 - share)) + 1e-9


@pytest.mark.parametrize(
    ("kind", "error", "table", "doubt"),
    [
        ("missed", 0.25, ((0.75, 0.25, 0.0), (0.0, 1.0, 0.0), (0.0, 0.25, 0.75)), (0, 1 / 3, 0)),
        ("symmetric", 0.2, ((0.8, 0.1, 0.1), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)), (0.2,) * 3),
    ],
)
def test_readings_by_hand(kind: str, error: float, table: object, doubt: tuple[float, ...]) -> None:
    """Bayes by hand: a turn is never read where there is none; of 1.5 straights 1 is one."""
    assert confusion(2, (0.0,) * 3, error, kind) == table
    assert doubts(confusion(2, (0.0,) * 3, error, kind)) == pytest.approx(doubt)


@pytest.mark.parametrize(("side", "rates"), [("left", (0.29, 0, 0.25)), ("right", (0.25, 0, 0.29))])
def test_the_near_turn_is_mirrored(side: str, rates: tuple[float, ...]) -> None:
    """Sullivan et al. counted in right-hand traffic: right turns 29 %, left turns 25 %."""
    site = small_scenario(4, side=side).site(0)
    assert Lane.of(site, 1, 0.0, "missed", UNSIGNALLED).silent == rates


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("unsignalled", [(0.0, 0.0), UNSIGNALLED])
def test_readings_follow_the_confusion(kind: str, unsignalled: tuple[float, float]) -> None:
    subject = lane(0.15, kind, unsignalled)
    table = confusion(subject.straight, subject.silent, 0.15, kind)
    for true in (1, 2, 3):
        read = [subject.read(DRAWS, true, vehicle, 7) for vehicle in range(COUNT)]
        for manoeuvre in (1, 2, 3):
            assert close(read.count(manoeuvre), table[true - 1][manoeuvre - 1])


@pytest.mark.parametrize("kind", KINDS)
def test_who_is_misread_at_a_small_error_is_at_a_larger_one(kind: str) -> None:
    def misread(error: float) -> set[int]:
        subject = lane(error, kind)
        return {v for v in range(500) if subject.read(DRAWS, 1, v) != 1}

    assert not misread(0.0)
    assert misread(0.05) < misread(0.15) < misread(0.25)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("unsignalled", [(0.0, 0.0), UNSIGNALLED])
def test_confidence_is_calibrated(kind: str, unsignalled: tuple[float, float]) -> None:
    """Of the readings in each tenth of confidence, the mean confidence of them is right.

    All manoeuvres are equally frequent.
    """
    subject = lane(0.25, kind, unsignalled)
    bins: dict[int, list[tuple[float, bool]]] = {}
    for vehicle in range(3 * COUNT):
        true = vehicle % 3 + 1
        read = subject.read(DRAWS, true, vehicle)
        sure = subject.confidence(DRAWS, true, read, vehicle)
        bins.setdefault(min(int(sure * 10), 9), []).append((sure, read == true))
    assert len(bins) >= 8
    for found in bins.values():
        expected = sum(sure for sure, _ in found)
        variance = sum(sure * (1.0 - sure) for sure, _ in found)
        right = sum(right for _, right in found)
        assert abs(right - expected) <= Z * math.sqrt(variance) + 1e-9


def test_confidence_by_hand() -> None:
    """U^e where right, times V^(e/(1−e)) where wrong; e = 1/2 and e = 1/4."""
    assert confidence(0.5, True, (0.25, 0.125)) == pytest.approx(0.5)
    assert confidence(0.5, False, (0.25, 0.125)) == pytest.approx(0.5 * 0.125)
    assert confidence(0.25, False, (0.0625, 0.125)) == pytest.approx(0.5 * 0.5)
    for right in (False, True):
        assert confidence(0.0, right, (0.25, 0.125)) == 1.0
        assert confidence(1.0, right, (0.25, 0.125)) == 0.0


@pytest.mark.parametrize("read", [1, 2])
def test_each_look_has_a_confidence_of_its_own(read: int) -> None:
    """Whether right or wrong; the same look, the same."""
    subject = lane(0.25, "symmetric")
    looks = [subject.confidence(DRAWS, 1, read, 7, observer, 3) for observer in range(20)]
    assert len(set(looks)) == 20
    assert looks[5] == subject.confidence(DRAWS, 1, read, 7, 5, 3)


def test_what_is_never_read_is_no_doubt() -> None:
    assert doubts(((1.0, 0.0), (1.0, 0.0))) == (0.5, 0.0)
    assert doubts(((0.0, 1.0), (1.0, 0.0))) == (1.0, 1.0)
