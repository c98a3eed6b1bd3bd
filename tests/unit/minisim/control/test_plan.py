"""Markings are checked."""

from __future__ import annotations

from typing import Any

import pytest

from minisim.control import (
    Marking,
    Plan,
)
from minisim.errors import InputError


def test_markings_are_checked() -> None:
    wrong: Any = ("red",), Marking("red", 30, 8)
    for markings, message in zip(wrong, ("must be a Marking", "must be a tuple"), strict=True):
        with pytest.raises(InputError, match=message):
            Plan(markings=markings)
    with pytest.raises(InputError, match=r"start of marking red .* above 30"):
        Marking("red", 8.0, 30.0)
