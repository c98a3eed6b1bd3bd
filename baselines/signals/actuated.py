"""The actuated signal: a green lasts until there is a gap in the traffic over a detector.

It follows SUMO's traffic light type `actuated` (`MSActuatedTrafficLightLogic`) for phases with one
successor; all constants are SUMO's defaults. SUMO's only loop has no length, so a standing queue
can have a gap there. So a second detector senses presence from the loop to the line, as in the
Signal Timing Manual (FHWA-HOP-08-024, 2008, ch. 4): some 40 ft, until the queue is served.
"""

from __future__ import annotations

import math

from baselines.signals.heads import lane_order
from baselines.signals.phases import PhaseSession, Verdict, check_greens, shortest_detector
from minisim.control import Site, View
from minisim.names import Name
from minisim.parameters import Switch, declared, real, switch

#: Length of a waiting vehicle with its gap; fixed in SUMO's code [m].
PLACE = 7.5
#: Rounding tolerance for passing a mark [m], and for a green that ends on a whole second [s].
ROUNDING = 1e-6


@declared
class Actuated:
    """A signal that prolongs a green while vehicles follow each other closely enough.

    One phase per approach, in a fixed order; none is left out. Each lane has a loop before the
    junction. If the last vehicle left it less than `max_gap` ago, the green goes on for the rest
    of `detector_gap`, in which that vehicle reaches the line. The green is rounded up to a whole
    second and never exceeds `max_green`. A vehicle that stands on the loop leaves no gap. Between
    loop and line, a vehicle prolongs the green too; without `presence`, `min_green` must serve it.
    """

    name = Name("actuated")

    max_gap: float = real("gap that ends the green", "s", low=0, high=3600, default=3.0)
    detector_gap: float = real(
        "time from the loop to the line at the speed limit; the loop is nearer if the vehicles "
        "between could not all leave within `min_green`", "s",
        above=0, high=3600, default=2.0,
    )  # fmt: skip
    passing_time: float = real("of a vehicle over the line", "s", low=0.1, high=60, default=1.9)
    presence: Switch = switch(
        "whether vehicles between loop and line prolong the green; SUMO does not see them",
        default=True,
    )
    # The authors' network: `minDur`, `maxDur` and its amber.
    min_green: float = real("shortest green", "s", low=0.5, high=3600, default=3.0)
    max_green: float = real("longest green", "s", low=0.5, high=3600, default=50.0)
    amber: float = real("amber after each green", "s", low=0, high=60, default=2.0)
    order: tuple[int, ...] | None = lane_order()

    def __post_init__(self) -> None:
        check_greens(self.min_green, self.max_green)

    def detector(self, site: Site) -> float:
        """How far the loops are before the junction entry [m]."""
        waiting = (self.min_green / self.passing_time + 0.5) * PLACE
        loop = min(self.detector_gap * site.speed_limit, waiting, site.intersection.approach_length)
        return max(loop, shortest_detector(site)) if self.presence else loop

    def start(self, site: Site) -> GapSession:
        """Begin a run; raises `InputError` unless `order` lists every lane once."""
        return GapSession(self, site)


class GapSession(PhaseSession):
    """When the last vehicle left each lane's loop, and whether that was too long ago."""

    def __init__(self, signal: Actuated, site: Site) -> None:
        self._signal = signal
        self._detector = signal.detector(site)
        # Where the front bumper of a vehicle off the loop is.
        fronts = tuple(dict.fromkeys(self._detector - it.length for it in site.types))
        past = min(fronts)
        marks = (*fronts, 0.0) if signal.presence else fronts
        # Presence counts as if the vehicle had left the loop and driven to the line at the limit.
        self._ago = [
            min(max(past, 0.0) / site.limit(lane), signal.max_gap - site.dt)
            for lane in range(site.intersection.n)
        ]
        super().__init__(site, self._detector, signal.min_green, signal.amber, marks, signal.order)
        self._passed: set[int] = set()  # vehicles in view whose rear has left the loop
        self._left = [-math.inf] * site.intersection.n  # when the last one did so [s]

    def see(self, view: View) -> None:
        """Note vehicles between loop and line, and when each left the loop."""
        free = self._detector + ROUNDING
        passed = [v for v in view.vehicles if v.distance + v.length <= free]
        for v in passed:
            if v.id not in self._passed:
                past = free - v.distance - v.length
                since = past / v.speed if self._exact and v.speed > 0.0 else 0.0
                self._left[v.lane] = view.time - since
            elif self._signal.presence and v.distance >= 0.0:
                self._left[v.lane] = max(self._left[v.lane], view.time - self._ago[v.lane])
        self._passed = {v.id for v in passed}

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:
        """Prolong the phase of `lane`, which is `elapsed` s old, or go on to the next lane."""
        signal, gap = self._signal, self._gap(view, lane)
        if elapsed >= signal.max_green or gap >= signal.max_gap:
            return self.pass_on(lane)
        more = max(signal.min_green - elapsed, signal.detector_gap - gap, self._dt)
        end = math.ceil(elapsed + more - ROUNDING)
        return Verdict(lane, min(end, signal.max_green) - elapsed)

    def _gap(self, view: View, lane: int) -> float:
        """How long the lane's loop has been free [s]."""
        there = (v for v in view.vehicles if v.lane == lane and v.distance <= self._detector)
        occupied = any(v.id not in self._passed for v in there)
        return 0.0 if occupied else view.time - self._left[lane]
