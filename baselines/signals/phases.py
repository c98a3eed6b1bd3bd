"""What is common to signals that end their phases by a rule.

Between two phases the old lane shows amber. The new one turns green once no vehicle crosses its
way any more (`Heads`). A phase is timed from when its green is shown, so drivers see its length.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from baselines.signals.facing import phases_of
from baselines.signals.heads import Colour, Heads
from baselines.signals.permitted import PermittedHeads
from minisim.control import Command, Observed, Plan, Site, View, Wake
from minisim.errors import InputError, number

#: Views are exact to a microsecond [s].
TICK = 1e-6


def check_greens(shortest: float, longest: float) -> None:
    """Raise `InputError` if the longest green is below the shortest [s]."""
    if longest < shortest:
        low, got = float(shortest), float(longest)  # a Fraction has no format
        raise InputError(f"max_green must be at least min_green, {low:g} s, got {got:g} s")


def shortest_detector(site: Site) -> float:
    """Length before the junction in which a standing queue always has a front bumper [m]."""
    place = (
        site.vehicle.length + site.vehicle.min_gap
    )  # 1.5: when one has just left, the next is inside
    return min(1.5 * place, site.intersection.approach_length)


def check_detector(length: float, site: Site) -> None:
    """Raise `InputError` if a queue could stand without a vehicle on such a detector [m]."""
    number("detector_range [m]", length, low=shortest_detector(site))


class Verdict(NamedTuple):
    """What a rule says about the current phase."""

    lane: int  #: the lane whose turn it is; any lane but the current one ends the phase
    after: float  #: time until the next look [s]; ignored if the phase ends


class PhaseSession:
    """Shows green to one phase at a time; a subclass judges when a phase ends.

    It is called when its rule has asked for it, when a vehicle clears the junction, and when one
    passes a mark. The rule sees the last `detector_range` [m] before the junction, and is asked
    once a phase has lasted for `min_green`. `marks` are where it must see front bumpers pass [m].
    An `order` must list every lane once (else `InputError`); None means a, b, c…. A phase is an
    approach, or with `facing` heads also the one that faces it; its first lane stands for it.
    """

    def __init__(
        self, site: Site, detector_range: float, min_green: float, amber: float,
        marks: tuple[float, ...] = (), order: tuple[int, ...] | None = None,
        facing: PermittedHeads | None = None,
    ) -> None:  # fmt: skip
        road = site.intersection.approach_length
        heads = self._heads = facing or Heads(site)
        sight = min(max(detector_range, heads.sight), road)
        marks = (*(min(mark, road) for mark in marks), *heads.marks)
        self.plan = Plan(marks=marks, wake_on_clear=True, sight=sight, reach=heads.reach)
        phases = phases_of(order, site.intersection, facing is not None)
        self._phases = {phase[0]: phase for phase in phases}
        self._order = tuple(self._phases)
        self._dt = site.dt
        self._exact = site.looks_out  # times its events like SUMO
        self._early = site.dt - TICK if self._exact else site.dt / 2.0
        self._rang = 0.0  # when the last timer was due
        self._min_green, self._amber = min_green, amber
        self._lane = self._next = self._order[0]
        self._colour = Colour.GREEN
        self._began: float | None = None  # when the lane's head turned green
        self._due = math.inf

    @property
    def heads(self) -> Sequence[str]:
        """What each lane's head shows now (`minisim.reasons.Signalling`)."""
        return self._heads.shown

    def green_from(self, lane: int, time: float) -> float | None:  # noqa: ARG002  (Signalling's)
        """None: when a phase ends depends on the traffic to come."""
        return None

    def see(self, view: View) -> None:
        """Take note of a view; called at every wake-up."""

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:
        """Say how the phase of `lane`, green for `elapsed` seconds so far, goes on."""
        raise NotImplementedError  # each signal has a rule of its own

    def pass_on(self, lane: int) -> Verdict:
        """End the phase of `lane`; the next lane in the order is green next."""
        return Verdict(self._order[(self._order.index(lane) + 1) % len(self._order)], 0.0)

    def decide(self, view: View) -> Iterable[Command]:
        """End the phase or the amber when it is time, and turn the heads.

        Timers ring on whole steps: what is less than half a step away is due. In SUMO, what is less
        than a whole step away is due, an event counts from the one before, and it acts on the move
        that ends at its time (`MSEventControl::execute`).
        """
        if self._exact and view.time > 0.0:
            view = view._replace(time=round(view.time + self._dt, 6))
        self.see(view)
        while view.time + self._early >= self._due:
            self._rang = self._due
            self._go_on(view)
        wanted = [Colour.RED] * len(self._heads.colours)
        for lane in self._phases[self._lane]:
            wanted[lane] = self._colour
        commands = self._heads.show(view, wanted)
        shown = {self._heads.colours[lane] for lane in self._phases[self._lane]}
        if self._began is None and shown == {Colour.GREEN}:
            self._began = view.time
            self._due = self._since(view) + self._min_green
        due = min(
            self._due - (self._dt + self._early if self._exact else 0.0), self._heads.next_look
        )
        return commands if math.isinf(due) else [*commands, Wake(due)]

    def _go_on(self, view: View) -> None:
        if self._began is None:  # the amber is over; the green comes when the way is clear
            self._lane, self._colour, self._due = self._next, Colour.GREEN, math.inf
            return
        # Times in views are exact to a microsecond.
        lane, after = self.judge(view, self._lane, round(view.time - self._began, 6))
        if lane == self._lane:
            self._due = self._since(view) + max(after, 0.0 if self._exact else self._dt)
            return
        self._next, self._began = lane, None
        if self._amber > 0.0:
            self._colour = Colour.AMBER
            self._due = self._since(view) + max(self._amber, self._dt)
        else:
            self._go_on(view)

    def _since(self, view: View) -> float:
        """The time from which the next timer counts [s]."""
        return self._rang if self._exact else view.time

    def duration(self, time: float) -> float:
        """A time as its timers measure it [s]: SUMO's count milliseconds."""
        return round(time, 3) if self._exact else time


def on_detector(view: View, detector_range: float) -> list[Observed]:
    """Vehicles with any part on the last `detector_range` metres of an approach lane."""
    return [v for v in view.vehicles if -v.length < v.distance <= detector_range]
