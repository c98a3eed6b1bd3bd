"""What hosts share: the alarm clock of a session, and the window of a recording."""

from __future__ import annotations

import math
import sys

import pytest

from minisim.control import Wake
from minisim.errors import InputError
from minisim.hosting import Alarm, checked_window

NEVER = sys.maxsize // 4


def test_a_period_rings_at_once_and_then_regularly() -> None:
    alarm = Alarm(0.5, 0.1)
    rung = []
    for tick in range(12):
        if tick >= alarm.tick:
            rung.append(tick)
            alarm.reset(tick)
    assert rung == [0, 5, 10]


def test_without_a_period_it_rings_once_when_asked() -> None:
    alarm = Alarm(None, 0.1)
    assert alarm.tick > NEVER
    alarm.set(Wake(0.95))
    alarm.set(Wake(0.65))  # replaces the earlier one
    assert alarm.tick == 7
    alarm.reset(6)
    assert alarm.tick == 7
    alarm.reset(7)
    assert alarm.tick > NEVER


def test_the_earlier_of_both_rings() -> None:
    alarm = Alarm(1.0, 0.1)
    alarm.reset(0)
    alarm.set(Wake(0.3))
    assert alarm.tick == 3
    alarm.reset(3)
    assert alarm.tick == 10


def test_windows_may_be_open_at_the_end() -> None:
    assert checked_window((1, 2.5)) == (1, 2.5)
    assert checked_window((0.0, math.inf)) == (0.0, math.inf)


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ([0.0, 1.0], r"must be \(from, to\) in seconds"),
        ((0.0,), r"must be \(from, to\) in seconds"),
        ((-1.0, 1.0), "start of record_window .* at least 0"),
        ((2.0, 1.0), "end of record_window .* at least 2, got 1"),
        ((math.inf, math.inf), "start of record_window .* finite"),
    ],
)
def test_windows_are_checked(window: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        checked_window(window)  # type: ignore[arg-type]
