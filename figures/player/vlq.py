"""Integers as text: base64 VLQ, as in source maps (ECMA-426, §7).

A digit holds five bits, the lowest first; a sixth says that more follow. The lowest bit of a number
is its sign, so numbers from −15 to 15 take one character.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]

DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
_CODES = np.frombuffer(DIGITS.encode(), np.uint8)


def encoded(values: Ints, starts: Ints) -> list[str]:
    """The values as one text for each part; `starts` are the parts' first indices, from 0 on."""
    number = (np.abs(values) << 1) | (values < 0)
    length = np.ones(len(number), np.int64)
    for k in range(1, 12):
        length += number >> (5 * k) > 0
    first = np.cumsum(length) - length
    digits = np.zeros(int(length.sum()), np.int64)
    for k in range(int(length.max(initial=0))):
        here = length > k
        digits[first[here] + k] = (number[here] >> (5 * k)) & 31 | (length[here] > k + 1) << 5
    text = _CODES[digits].tobytes().decode()
    return [text[a:b] for a, b in pairwise([*first[starts].tolist(), len(text)])]


def second_differences(values: Ints, starts: Ints) -> Ints:
    """Of each part: its first value, its first difference, then differences of differences."""
    at, rest = starts, np.setdiff1d(starts + 1, np.append(starts, len(values)))
    once = np.diff(values, prepend=0)
    twice = np.diff(once, prepend=0)
    twice[rest] = once[rest]
    twice[at] = values[at]
    return twice


def decoded(text: str) -> list[int]:
    """The integers of one text."""
    values, number, shift = [], 0, 0
    for digit in map(DIGITS.index, text):
        number |= (digit & 31) << shift
        shift += 5
        if not digit & 32:
            values.append(-(number >> 1) if number & 1 else number >> 1)
            number = shift = 0
    return values
