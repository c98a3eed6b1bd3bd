"""Messages through the air: each one may come late, or never."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator
from typing import Generic, TypeVar

from minisim.parameters import declared, real
from minisim.streams import stream
from minisim.ticks import NEVER

_T = TypeVar("_T")


@declared
class Channel:
    """How messages between vehicles and a controller fail, each by itself; by default none does.

    A message takes `latency` and up to `jitter` more, uniformly distributed, so it may overtake an
    earlier one. For scale: 3GPP TS 22.185 wants at most 100 ms between a vehicle and the roadside,
    and TS 22.186 that 90 to 99.99 % of the messages arrive in time.
    """

    latency: float = real("least time from sending to receiving", "s", low=0, high=60, default=0.0)
    jitter: float = real("how much longer it may take", "s", low=0, high=60, default=0.0)
    loss: float = real("share of messages that never arrive", low=0, high=1, default=0.0)

    @property
    def slowest(self) -> float:
        """The longest that a message takes which arrives [s]."""
        return self.latency + self.jitter

    def __bool__(self) -> bool:
        """Whether messages fail at all."""
        return any((self.latency, self.jitter, self.loss))

    def __str__(self) -> str:
        """What fails, as in names: `+latency=0.1+loss=0.3`."""
        faults = {"latency": self.latency, "jitter": self.jitter, "loss": self.loss}
        return "".join(f"+{name}={value:g}" for name, value in faults.items() if value)


class Chances(Iterator[float]):
    """Random numbers from [0, 1) for the messages of a run, without end; it can be copied."""

    def __init__(self, seed: int) -> None:
        self._random = stream(seed, "messages")
        self._drawn: list[float] = []  # last first

    def __next__(self) -> float:
        if not self._drawn:
            self._drawn = self._random.random(1024)[::-1].tolist()
        return self._drawn.pop()


class Air(Generic[_T]):
    """Messages under way in one direction; times in steps of `dt` [s]."""

    def __init__(self, channel: Channel, dt: float, random: Iterator[float]) -> None:
        self._channel, self._dt, self._random = channel, dt, random
        self._way: list[tuple[int, int, _T]] = []
        self.sent = self.lost = 0

    @property
    def next(self) -> int:
        """When the next message arrives."""
        return self._way[0][0] if self._way else NEVER

    def send(self, now: int, message: _T) -> None:
        """Send a message: it arrives at the first step after its time under way, or never."""
        channel = self._channel
        self.sent += 1
        if channel.loss and next(self._random) < channel.loss:
            self.lost += 1
            return
        delay = channel.latency
        if channel.jitter:
            delay += channel.jitter * next(self._random)
        heapq.heappush(self._way, (now + steps(delay, self._dt), self.sent, message))

    def receive(self, now: int) -> Iterator[_T]:
        """The messages that have arrived by now, in the order of arrival."""
        while self._way and self._way[0][0] <= now:
            yield heapq.heappop(self._way)[2]


def steps(delay: float, dt: float) -> int:
    """The least number of steps of `dt` that last at least `delay` [s]."""
    return math.ceil(delay / dt - 1e-6)
