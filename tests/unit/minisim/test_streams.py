"""Random streams: reproducible and independent."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from minisim.errors import InputError
from minisim.streams import STREAMS, Draws, stream


@pytest.mark.parametrize("name", STREAMS)
def test_the_same_seed_gives_the_same_numbers(name: str) -> None:
    assert stream(7, name).bytes(64) == stream(7, name).bytes(64)
    assert stream(7, name).bytes(64) != stream(8, name).bytes(64)


def test_streams_are_uncorrelated() -> None:
    """|r| of independent samples exceeds 5/√k with probability 6e-7 (normal approximation)."""
    k = 10_000
    samples = [stream(seed, name).random(k) for name in STREAMS for seed in (0, 1)]
    for one, other in itertools.combinations(samples, 2):
        assert abs(np.corrcoef(one, other)[0, 1]) < 5.0 / np.sqrt(k)


def test_published_seeds_keep_their_streams() -> None:
    """The spawn keys are the order of `STREAMS`: appending is allowed, reordering is not."""
    assert STREAMS[:4] == ("arrivals", "manoeuvres", "perception", "drivers")
    expected = np.random.default_rng(np.random.SeedSequence(entropy=7, spawn_key=(0,)))
    assert stream(7, "arrivals").bytes(8) == expected.bytes(8)


def test_unknown_names_and_negative_seeds_are_refused() -> None:
    with pytest.raises(InputError, match="did you mean 'arrivals'"):
        stream(1, "arrival")
    with pytest.raises(InputError, match="seed must be an integer of at least 0, got -1"):
        stream(-1, "arrivals")


def test_draws_belong_to_their_question() -> None:
    draws, again = Draws(1, "perception"), Draws(1, "perception")
    numbers = [draws.uniform(1, k) for k in range(1000)]
    assert [again.uniform(1, k) for k in reversed(range(1000))] == numbers[::-1]
    assert len(set(numbers)) == 1000
    assert sum(numbers) / 1000 == pytest.approx(0.5, abs=4 * (1 / 12000) ** 0.5)
    assert draws.uniform(1, 2) != Draws(2, "perception").uniform(1, 2)
    assert draws.uniform(1, 2) != Draws(1, "drivers").uniform(1, 2)
    normal = [draws.normal(2, k) for k in range(1000)]
    assert sum(normal) / 1000 == pytest.approx(0.0, abs=4 / 1000**0.5)
    assert sum(z * z for z in normal) / 1000 == pytest.approx(1.0, abs=4 * (2 / 1000) ** 0.5)
