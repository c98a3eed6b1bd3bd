"""A run that is driven step by step, in any host: `Stepped`, and `repeated` for doing it again."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from typing import Self

from minisim.arrivals import Arrivals
from minisim.control import Command, View
from minisim.engine.collision import Collision
from minisim.errors import choice, number
from minisim.hosting import Hosted
from minisim.results.run import Given, Run
from minisim.ticks import NEVER, first_tick, time_of

#: Of `Stepped.run_until`.
EVENTS = ("wake", "collision")


class Stepped(ABC):
    """What the hosts' `Simulation`s have in common: the clock, and driving from outside."""

    def __init__(self, hosted: Hosted) -> None:
        self._hosted = hosted
        self.site = hosted.site
        self.tick = 0
        self._horizon_tick = first_tick(hosted.scenario.horizon, self.site.dt)
        # Most steps between two looks for reasons.
        self._stride = NEVER if hosted.witness is None else 1
        self._collisions: dict[tuple[int, int], Collision] = {}
        self._given: list[Given] = []
        self._started = self._done = False

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return time_of(self.tick, self.site.dt)

    @property
    def finished(self) -> bool:
        """Whether the horizon is reached or every vehicle has arrived."""
        return self._done or self.tick >= self._horizon_tick

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """The collisions so far, each pair of vehicles once."""
        return tuple(self._collisions.values())

    @property
    def arrivals(self) -> Arrivals:
        """The vehicles that want to come, in the order of their ids."""
        return self._hosted.arrivals

    def advance(self, until: float) -> None:
        """Advance to time `until` [s], to the horizon, or to the last arrival.

        Raises:
            CollisionError: two bodies touched, unless collisions are only recorded.
            ControllerError: the controller answered with something that is not a command.
        """
        until = number("until [s]", until, low=0)
        for _ in self._stretches(first_tick(until, self.site.dt)):
            pass

    def run_until(
        self, event: float | str | Callable[[Self], bool], *, before: float = math.inf
    ) -> bool:
        """Advance until something happens, to time `before` [s], or to the end of the run.

        Args:
            event: a time [s]; "wake", whenever the plan wakes the session, first at time 0;
                "collision", when one is recorded; or a function that is asked after each step.
            before: when to stop if it has not happened.

        Returns:
            Whether it happened.

        Raises:
            InputError: no such event.
            CollisionError, ControllerError: as `advance` raises them.
        """
        latest = self._horizon_tick
        if before != math.inf:
            latest = first_tick(number("before [s]", before, low=0), self.site.dt)
        if not isinstance(event, str) and not callable(event):
            self.advance(min(event, before))
            return self.tick >= first_tick(event, self.site.dt)
        by_step, before = callable(event), len(self._collisions)
        if isinstance(event, str):
            choice("event", event, EVENTS)
        for woken in self._stretches(latest, 1 if by_step else NEVER):
            if callable(event):
                happened = event(self)
            else:
                happened = woken if event == "wake" else len(self._collisions) > before
            if happened:
                return True
        return False

    def command(self, *commands: Command) -> None:
        """Carry out commands from outside; what is set at a time acts from the next step on.

        If the session is woken at the same time, it has decided before, so these count.

        Raises:
            InputError: one of them cannot be carried out; then none is.
        """
        self._hosted.take(commands, self.tick)
        self._begin()
        self._given.append((self.tick, commands))
        self._carry_out(commands)

    def run(self) -> Run:
        """Advance to the end and return the result."""
        self.advance(self._horizon_tick * self.site.dt)
        return self.result()

    def _begin(self) -> bool:
        """Ask the session for the first time; returns whether it is now."""
        if self._started:
            return False
        self._started = True
        self._decide()
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self.close(error)

    def close(self, error: BaseException | None = None) -> None:  # noqa: B027  (nothing by default)
        """Free what the host holds; `error` is what ended the run, if anything did."""

    @abstractmethod
    def view(self) -> View:
        """What a session would be shown now; steps change it, commands do not."""

    @abstractmethod
    def fork(self) -> Self:
        """A copy that goes on by itself: left alone, both give identical trips."""

    @abstractmethod
    def result(self) -> Run:
        """The result so far."""

    @abstractmethod
    def _stretches(self, target: int, most: int = NEVER) -> Iterator[bool]:
        """Advance, at most `most` steps at once; yields each time whether the session was woken."""

    @abstractmethod
    def _decide(self) -> None:
        """Ask the session, and carry out its commands."""

    @abstractmethod
    def _carry_out(self, commands: Iterable[Command]) -> None:
        """Carry out commands that have been checked."""


def repeated(again: Stepped, given: tuple[Given, ...], until: float) -> Run:
    """The result of a fresh run at `until` [s], with the commands that came from outside."""
    for tick, commands in given:
        again.advance(time_of(tick, again.site.dt))
        again.command(*commands)
    again.advance(until)
    return again.result()
