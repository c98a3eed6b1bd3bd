"""What signals have in common whose phases last as long as a rule says: one phase an approach.

Between two phases the old lane shows amber, and the new one turns green when no vehicle crosses its
way any more (`Heads`). The time of a phase runs from the green that is really shown, so a
shortest and a longest green mean what drivers see.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple, Protocol

from baselines.signals.heads import Colour, Heads, stopping_sight
from minisim.control import Command, Observed, Plan, Site, View, Wake
from minisim.errors import InputError


def check_greens(shortest: float, longest: float) -> None:
    """Raise `InputError` for a longest green below the shortest [s]."""
    if longest < shortest:
        raise InputError(f"max_green must be at least min_green, {shortest:g} s, got {longest:g} s")


class Verdict(NamedTuple):
    """What a rule says of the present phase.

    Attributes:
        lane: whose turn it is; another lane than now ends the phase.
        after: time until the next look [s]; it does not matter when the phase ends.
    """

    lane: int
    after: float


class Rule(Protocol):
    """When a phase ends, and which is next; it may remember what it has seen."""

    def see(self, view: View) -> None:
        """Take note of a view; called at every wake-up."""

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:
        """Say how the phase of `lane` goes on, which has been green for `elapsed` seconds."""


class PhaseSession:
    """Shows green to one lane at a time, as a rule says.

    It is called when its rule asked for it, when a vehicle clears the junction, and when one passes
    a place where the rule must see it.

    Args:
        site: of the run.
        rule: when a phase ends, and which is next.
        detector_range: how far before the junction the rule sees [m].
        marks: how far before the junction the rule must see every front bumper pass [m].
        min_green: time from the begin of a phase until the rule is asked [s].
        amber: [s].
        first: the lane that is green first.
    """

    def __init__(
        self,
        site: Site,
        rule: Rule,
        *,
        detector_range: float,
        marks: tuple[float, ...] = (),
        min_green: float,
        amber: float,
        first: int = 0,
    ) -> None:
        self.plan = Plan(
            marks=marks,
            wake_on_clear=True,
            sight=max(detector_range, stopping_sight(site)),
        )
        self._rule = rule
        self._heads = Heads(site)
        self._dt = site.dt
        self._lanes = site.intersection.n
        self._min_green, self._amber = min_green, amber
        self._lane = self._next = first
        self._colour = Colour.GREEN
        self._began: float | None = None  # when the lane's head turned green
        self._due = math.inf

    def decide(self, view: View) -> Iterable[Command]:
        """End the phase or the amber when it is time, and turn the heads.

        Timers ring on whole steps: what is less than half a step away is due.
        """
        self._rule.see(view)
        if view.time + self._dt / 2.0 >= self._due:
            self._go_on(view)
        wanted = [Colour.RED] * self._lanes
        wanted[self._lane] = self._colour
        commands = self._heads.show(view, wanted)
        if self._began is None and self._heads.colours[self._lane] is Colour.GREEN:
            self._began = view.time
            self._due = view.time + self._min_green
        return commands if math.isinf(self._due) else [*commands, Wake(self._due)]

    def _go_on(self, view: View) -> None:
        if self._began is None:  # the amber is over; the green comes when the way is clear
            self._lane, self._colour, self._due = self._next, Colour.GREEN, math.inf
            return
        # Views tell the time to a microsecond.
        verdict = self._rule.judge(view, self._lane, round(view.time - self._began, 6))
        if verdict.lane == self._lane:
            self._due = view.time + max(verdict.after, self._dt)
            return
        self._next, self._began = verdict.lane, None
        if self._amber > 0.0:
            self._colour = Colour.AMBER
            self._due = view.time + max(self._amber, self._dt)
        else:
            self._go_on(view)


def following(order: tuple[int, ...], lane: int) -> int:
    """The lane after this one in a fixed order."""
    return order[(order.index(lane) + 1) % len(order)]


def on_detector(view: View, detector_range: float) -> list[Observed]:
    """Vehicles with any part on the last `detector_range` metres of an approach lane."""
    return [v for v in view.vehicles if -v.length < v.distance <= detector_range]
