"""The all-way stop: every vehicle stops at the line, and the first to stop is the first to go.

The rule is SUMO's for junctions of type `allway_stop` (`MSLink`, and `jmAllwayStopWait`), with one
difference. SUMO's vehicles set off as soon as a conflicting one has entered the junction, and brake
for it there, hard at times (SUMO issues 15434, 15728). Ours wait until it is out of their way,
so no two vehicles can collide, whatever it does there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from minisim.control import (
    AT_LINE,
    HALTING,
    SUMO_AT_LINE,
    Command,
    Go,
    Observed,
    Plan,
    Site,
    View,
    Wake,
)
from minisim.junction.conflicts import clearing_distances
from minisim.names import Name
from minisim.parameters import declared, real
from minisim.reasons import Reason

#: How far views reach beyond where a vehicle stands at the line [m].
SIGHT_MARGIN = 0.5


@declared
class AllWayStop:
    """A junction where every vehicle stops, and the first to stop is the first to go.

    The first vehicle of each lane joins the queue when it stands at the line; ties are broken by
    arm. A vehicle goes as soon as it has stood for `reaction`, no conflicting vehicle has stood for
    longer, and every conflicting vehicle that was let go is out of its way. So vehicles that do not
    conflict go together, and may jump the queue. Each gets its turn, since a waiting vehicle holds
    back every later one that conflicts with it.
    """

    name = Name("all-way-stop")

    # SUMO's `jmAllwayStopWait`, by default a single step; 1 s is SUMO's reaction time (SSM, MDRAC).
    reaction: float = real("how long a driver stands", "s", low=0, high=60, default=1.0)

    def start(self, site: Site) -> AllWayStopSession:
        """Begin a run."""
        return AllWayStopSession(site, self.reaction)


class AllWayStopSession:
    """When each vehicle came to a stand, and which vehicles have been let go.

    It is called when a vehicle comes to the line, when the junction clears, and when a vehicle at
    the line can first be standing, has stood long enough, or can first have a clear way.
    """

    def __init__(self, site: Site, reaction: float) -> None:
        line = self._line = AT_LINE if site.vehicle.sumo is None else SUMO_AT_LINE
        self.plan = Plan(marks=(line,), wake_on_clear=True, sight=line + SIGHT_MARGIN)
        self._reaction = reaction
        self._dt = site.dt
        self._types = site.types
        self._rows = site.intersection.movements.rows
        self._clearing = [
            clearing_distances(site.intersection, it, site.fleet).tolist() for it in site.types
        ]
        self._standing: dict[int, float] = {}  # vehicle: since [s]
        self._gone: set[int] = set()

    def decide(self, view: View) -> Iterable[Command]:
        """Let go every vehicle whose turn it is; timers ring at most half a step early."""
        self._gone.intersection_update([v.id for v in view.vehicles])
        crossing = [v for v in view.vehicles if v.id in self._gone or v.distance < 0.0]
        heads = self._heads(view)
        since = self._standing
        self._standing = {v.id: since.get(v.id, view.time) for v in heads if v.speed <= HALTING}
        # A moving head can be standing once comfortable braking has stopped it.
        moving = [v for v in heads if v.id not in self._standing]
        brakes = [self._types[v.type].deceleration for v in moving]
        looks = [view.time + (v.speed - HALTING) / b for v, b in zip(moving, brakes, strict=True)]
        queue = [v for v in heads if v.id in self._standing]
        queue.sort(key=lambda v: (self._standing[v.id], v.lane))
        waiting: list[Observed] = []
        commands: list[Command] = []
        for vehicle in queue:
            ready = self._standing[vehicle.id] + self._reaction
            if view.time + self._dt / 2.0 >= ready:
                ready = self._free_time(vehicle, waiting, crossing, view.time)
            if ready <= view.time:
                commands.append(Go(vehicle.id))
                self._gone.add(vehicle.id)
                crossing.append(vehicle)
            else:
                waiting.append(vehicle)
                looks.append(ready)
        look = max(min(looks, default=math.inf), view.time + self._dt)
        return commands if math.isinf(look) else [*commands, Wake(look)]

    def reasons(self, view: View) -> dict[int, Reason]:
        """Why the first vehicles of the lanes wait (`minisim.reasons.Explaining`)."""
        found = {}
        crossing = [v for v in view.vehicles if v.id in self._gone or v.distance < 0.0]
        for me in self._heads(view):
            if me.id not in self._standing:
                found[me.id] = Reason("approaching", me.id)
            elif view.time + self._dt / 2.0 < (ready := self._standing[me.id] + self._reaction):
                found[me.id] = Reason("reaction", me.id, until=ready)
            else:
                found[me.id] = self._turn(me, view, crossing)
        return found

    def _turn(self, me: Observed, view: View, crossing: list[Observed]) -> Reason:
        """Why a vehicle that has stood long enough still waits."""
        since, own = self._standing, self._index(me)
        clearing = self._clearing
        key = since[me.id], me.lane
        earlier = [v for v in self._heads(view) if v.id in since and (since[v.id], v.lane) < key]
        first = [v.id for v in earlier if clearing[v.type][own][self._index(v)] > 0.0]
        if first:
            return Reason("turn", me.id, tuple(first))
        inside = [
            v.id for v in crossing if clearing[v.type][own][self._index(v)] + v.distance > 0.0
        ]
        return Reason("clearing" if inside else "looks again", me.id, tuple(inside))

    def _heads(self, view: View) -> list[Observed]:
        """The first vehicle of each lane that has not been let go, if it is at the line."""
        heads: dict[int, Observed] = {}
        for vehicle in view.vehicles:  # front to back
            if vehicle.distance >= 0.0 and vehicle.id not in self._gone:
                heads.setdefault(vehicle.lane, vehicle)
        return [vehicle for vehicle in heads.values() if vehicle.distance <= self._line]

    def _free_time(
        self, vehicle: Observed, waiting: list[Observed], crossing: list[Observed], now: float
    ) -> float:
        """The earliest time at which a vehicle may go [s]; infinite if one has stood for longer.

        A vehicle in the way can clear it no sooner than full acceleration allows.
        """
        own = self._index(vehicle)
        if any(self._clearing[it.type][own][self._index(it)] > 0.0 for it in waiting):
            return math.inf
        free = now
        for other in crossing:
            room = self._clearing[other.type][own][self._index(other)] + other.distance
            if room > 0.0:
                a, speed = self._types[other.type].acceleration, other.speed
                free = max(free, now + (math.sqrt(speed * speed + 2.0 * a * room) - speed) / a)
        return free

    def _index(self, vehicle: Observed) -> int:
        return self._rows[vehicle.lane][vehicle.manoeuvre]
