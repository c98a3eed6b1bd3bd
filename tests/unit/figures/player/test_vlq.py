"""Integers as text."""

from __future__ import annotations

from itertools import accumulate

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from figures.player import vlq

PARTS = st.lists(st.lists(st.integers(-(2**40), 2**40), min_size=1, max_size=8), min_size=1)


def test_the_examples_of_source_maps() -> None:
    values = np.array([0, 1, -1, 15, -15, 16, 123456789])
    texts = vlq.encoded(values, np.arange(len(values)))
    assert texts == ["A", "C", "D", "e", "f", "gB", "qxmvrH"]


@settings(max_examples=30)
@given(PARTS)
def test_what_is_encoded_is_decoded(parts: list[list[int]]) -> None:
    starts = np.array([0, *accumulate(map(len, parts))][:-1])
    texts = vlq.encoded(np.concatenate(parts).astype(np.int64), starts)
    assert [vlq.decoded(text) for text in texts] == parts


@settings(max_examples=30)
@given(PARTS)
def test_second_differences_add_up_again(parts: list[list[int]]) -> None:
    starts = np.array([0, *accumulate(map(len, parts))][:-1])
    values = np.concatenate(parts).astype(np.int64)
    twice = np.split(vlq.second_differences(values, starts), starts[1:])
    for part, (first, *rest) in zip(parts, (it.tolist() for it in twice), strict=True):
        assert [*accumulate([first, *accumulate(rest)])] == part
