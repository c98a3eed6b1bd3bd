"""The all-way stop: everybody stops at the line, and goes in the order of stopping.

The rule is SUMO's for junctions of type `allway_stop` (`MSLink`, and `jmAllwayStopWait`), but for
one thing: SUMO's vehicles set off as soon as a conflicting one has entered the junction and follow
it there; ours wait until it has left, so that nobody can collide.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from minisim.control import Command, Go, Observed, Plan, Site, View, Wake
from minisim.errors import instance, number

#: Slower than this a vehicle stands [m/s]: SUMO's limit of waiting.
STANDING = 0.1
#: A vehicle stands at the line when its front is at most this far before it [m].
LINE = 1.0
#: Views reach that far beyond [m].
SIGHT_MARGIN = 0.5


@dataclass(frozen=True)
class AllWayStop:
    """A junction where every vehicle stops, and who stopped first goes first.

    The first vehicle of each lane queues from the moment when it stands at the line; equal times
    go by arm. A vehicle goes as soon as it has stood for `reaction`, no conflicting vehicle is on
    its way through the junction, and nobody conflicting has stood for longer. So those who do not
    conflict go together, and may overtake in the queue; but nobody is passed over for ever, as
    whoever waits keeps every later conflicting vehicle back.

    Attributes:
        reaction: how long a driver stands before it goes [s]. SUMO's default
            (`jmAllwayStopWait`) is a single step; 1–2 s are usual (SUMO issues 15163, 15428).
        name: short name.
    """

    reaction: float = 1.0
    name: str = "all-way-stop"

    def __post_init__(self) -> None:
        number("reaction [s]", self.reaction, low=0, high=60)
        instance("name", self.name, str)

    def start(self, site: Site) -> AllWayStopSession:
        """Begin a run."""
        return AllWayStopSession(site, self.reaction)


class AllWayStopSession:
    """Who stands since when, and who was let go.

    It is called when somebody comes to the line, when the junction gets clear, and when it asked
    for it: at the earliest time at which somebody at the line can stand, or has stood long enough.
    """

    def __init__(self, site: Site, reaction: float) -> None:
        self.plan = Plan(marks=(LINE,), wake_on_clear=True, sight=LINE + SIGHT_MARGIN)
        self._reaction = reaction
        self._dt = site.dt
        self._deceleration = site.vehicle.deceleration
        self._index = site.intersection.index
        self._conflicts = site.conflicts.tolist()  # a plain lookup is faster than an array's
        self._standing: dict[int, float] = {}  # vehicle: since [s]
        self._gone: set[int] = set()

    def decide(self, view: View) -> Iterable[Command]:
        """Let go whose turn it is; timers ring on whole steps, half a step early at most."""
        self._gone.intersection_update(v.id for v in view.vehicles)
        heads = list(self._heads(view))
        self._standing = {
            v.id: self._standing.get(v.id, view.time) for v in heads if v.speed <= STANDING
        }
        queue = sorted(
            (v for v in heads if v.id in self._standing),
            key=lambda v: (self._standing[v.id], v.lane),
        )
        # Everybody who is on his way, and everybody who stands before: none may conflict.
        before = [v for v in view.vehicles if v.id in self._gone or v.distance < 0.0]
        going = []
        for vehicle in queue:
            if self._has_waited(vehicle, view.time) and not self._meets(vehicle, before):
                going.append(vehicle)
            before.append(vehicle)
        self._gone.update(v.id for v in going)
        wakes = [self._next_look(v, view.time) for v in heads if v.id not in self._gone]
        wake = min(wakes, default=math.inf)
        return [*(Go(v.id) for v in going), *([] if math.isinf(wake) else [Wake(wake)])]

    def _heads(self, view: View) -> Iterator[Observed]:
        """The first vehicle of each lane that has not been let go, if it is at the line."""
        lanes = set()
        for vehicle in view.vehicles:  # front to back
            if vehicle.lane in lanes or vehicle.id in self._gone or vehicle.distance < 0.0:
                continue
            lanes.add(vehicle.lane)
            if vehicle.distance <= LINE:
                yield vehicle

    def _has_waited(self, vehicle: Observed, now: float) -> bool:
        return now + self._dt / 2.0 >= self._standing[vehicle.id] + self._reaction

    def _meets(self, vehicle: Observed, others: Iterable[Observed]) -> bool:
        row = self._conflicts[self._index(vehicle.movement)]
        return any(row[self._index(other.movement)] for other in others)

    def _next_look(self, vehicle: Observed, now: float) -> float:
        """When something may change for a vehicle at the line without a wake-up of its own [s]."""
        if vehicle.id not in self._standing:
            # A held vehicle brakes comfortably, so it cannot stand before that.
            return now + max((vehicle.speed - STANDING) / self._deceleration, self._dt)
        if self._has_waited(vehicle, now):
            return math.inf  # until somebody is clear
        return max(self._standing[vehicle.id] + self._reaction, now + self._dt)
