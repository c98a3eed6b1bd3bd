"""Messages arrive after their latency, or never, by a stream of their own."""

from __future__ import annotations

import itertools
import math

import pytest

from minisim.channel import Air, Chances, Channel, steps
from minisim.errors import InputError
from minisim.ticks import NEVER


def arrivals(channel: Channel, count: int, seed: int = 1, dt: float = 0.1) -> dict[int, int]:
    """Message -> when it arrives, if all are sent in step 0 [steps]."""
    air: Air[int] = Air(channel, dt, Chances(seed))
    for message in range(count):
        air.send(0, message)
    come = {}
    while air.next != NEVER:
        now = air.next
        come |= dict.fromkeys(air.receive(now), now)
    assert (air.sent, air.lost) == (count, count - len(come))
    return come


def test_a_sound_channel_delivers_at_once_and_in_order() -> None:
    assert arrivals(Channel(), 5) == dict.fromkeys(range(5), 0)
    assert not Channel()


@pytest.mark.parametrize(("latency", "wanted"), [(0.0, 0), (0.05, 1), (0.1, 1), (0.3, 3)])
def test_a_message_arrives_at_the_first_step_after_its_latency(latency: float, wanted: int) -> None:
    assert arrivals(Channel(latency=latency), 3) == dict.fromkeys(range(3), wanted)
    assert steps(latency, 0.1) == wanted


def test_jitter_spreads_arrivals_evenly_so_that_messages_overtake() -> None:
    """The mean of n uniform numbers on (0, 1) is off by 4/√(12 n) with probability 6e-5."""
    come = arrivals(Channel(latency=0.2, jitter=0.5), n := 4000, dt=0.001)
    delays = [ticks * 0.001 for ticks in come.values()]
    assert 0.2 <= min(delays) <= max(delays) < 0.7005
    assert abs((sum(delays) / n - 0.45) / 0.5) < 4.0 / math.sqrt(12.0 * n) + 0.001
    assert list(come) != sorted(come)


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.5, 1.0])
def test_the_share_that_is_lost(loss: float) -> None:
    """A binomial share is off by four standard deviations with probability 6e-5."""
    lost = 1.0 - len(arrivals(Channel(loss=loss), n := 4000)) / n
    assert abs(lost - loss) <= 4.0 * math.sqrt(loss * (1.0 - loss) / n)


def test_equal_seeds_lose_the_same_messages() -> None:
    channel = Channel(jitter=0.3, loss=0.4)
    assert arrivals(channel, 100) == arrivals(channel, 100) != arrivals(channel, 100, seed=2)
    assert len({*itertools.islice(Chances(1), 3000)}) == 3000


def test_a_name_says_what_fails() -> None:
    assert str(Channel(latency=0.1, loss=0.25)) == "+latency=0.1+loss=0.25"
    assert str(Channel()) == ""


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"loss": 1.5}, "loss must be at least 0 and at most 1, got 1.5"),
        ({"latency": -0.1}, r"latency \[s\] must be at least 0 and at most 60, got -0.1"),
        ({"jitter": math.nan}, r"jitter \[s\] must be a finite number, got nan"),
        ({"delay": 1.0}, "unknown Channel parameter 'delay'; allowed: latency, jitter, loss"),
    ],
)
def test_what_is_not_allowed_is_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Channel(**wrong)
