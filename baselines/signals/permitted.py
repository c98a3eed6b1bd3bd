"""Permitted turns: approaches that face each other are green together, far turns wait for gaps.

These are the permitted left turns (in right-hand traffic) of the Highway Capacity Manual (HCM 2010,
chapters 18 and 31). Of two vehicles from facing approaches whose ways conflict, the one that turns
more to the far side yields. It waits at its line until no vehicle that it yields to arrives within
the critical gap, and follows another from its lane no sooner than after the follow-up headway. At
saturation, in oncoming traffic that arrives at random at a rate q, that is the manual's permitted
saturation flow q·exp(−q·t_c)/(1 − exp(−q·t_f)).

Vehicles cannot collide, whatever gap drivers would accept:
- A vehicle goes into a gap only if each vehicle that it yields to is past, or can still stop and
  comes no sooner than this one could have cleared its way.
- From then on, that other one has the right of way only while the turning one, at its present
  speed or that of a vehicle ahead if this is lower, is out of its way first. It loses it while it
  can still stop.

At the end of a green, the first vehicle of a lane that stands there and waits for a gap may still
go, once no vehicle comes any more (a "sneaker"; the HCM has 1 plus the share of left turns in a
shared lane, and 2 in one of their own, but those wait inside the junction, and ours at the line).
The next green begins when it is out of the way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np

from baselines.signals.facing import facing
from baselines.signals.heads import SIGHT_MARGIN, Colour, Heads, committed
from minisim.control import (
    HALTING,
    LATERAL_ACCELERATION,
    ORDINARY,
    SUMO_AT_LINE,
    Command,
    Go,
    Hold,
    Observed,
    Site,
    View,
    stopping_distance,
)
from minisim.junction.conflicts import conflict_zones

#: Critical gap and follow-up headway of a permitted left turn [s] (HCM 2010, chapter 31).
CRITICAL_GAP, FOLLOW_UP = 4.5, 2.5
#: Time between two looks for a gap [s].
LOOK = 0.2
#: Ways whose angles differ by less than this turn alike [rad].
ALIKE = 1e-6

#: Vehicles by lane, front to back.
Lanes = dict[int, list[Observed]]


class PermittedHeads(Heads):
    """Heads that let the vehicles of facing approaches go one by one.

    Raises `InputError` for vehicles with a law of their own (SUMO's CC), for which nothing is safe.
    """

    def __init__(self, site: Site, name: str) -> None:
        super().__init__(site)
        ORDINARY.check(name, site.vehicle)
        intersection = site.intersection
        movements, paths = intersection.movements, intersection.paths
        together = np.zeros((intersection.n, intersection.n), bool)
        for lane, phase in facing(intersection).items():
            self._partners[lane] = tuple(other for other in phase if other != lane)
            together[lane, self._partners[lane]] = True
        far = np.array([path.turn for path in paths]) * (1 if intersection.side == "right" else -1)
        more = far[:, None] - far
        meet = site.conflicts & together[np.ix_(movements.origins, movements.origins)]
        self._yields = (meet & (more > ALIKE)).tolist()
        self._ties = (meet & (abs(more) <= ALIKE)).tolist()
        self._waits = (meet & (more > -ALIKE)).any(axis=1).tolist()  # whether it may have to
        self._types = site.types
        self._zones = [conflict_zones(intersection, it, site.fleet).tolist() for it in site.types]
        self._caps = [
            min(intersection.turn_speed(it.movement, LATERAL_ACCELERATION), site.limit(it.exit_arm))
            for it in paths
        ]
        self._exits, self._limit = movements.exits.tolist(), site.limit
        self._look = max(LOOK, site.dt)
        self._ahead: tuple[Observed, ...] = ()  # all vehicles in view, even behind the junction
        self._sneakers: dict[int, int] = {}  # lane: vehicle that may go after its green
        self._went = [-math.inf] * intersection.n  # when the last one of a lane took a gap [s]
        # Farther on, no vehicle makes one that still turns brake.
        it, v = site.vehicle, min(max(self._caps), site.speed_limit)
        gap = it.min_gap + v * it.headway + stopping_distance(v, it.deceleration)
        self._ends = [path.crossing for path in paths]
        self.reach = max(self._ends) + 2.0 * it.length + gap
        self.marks = (self.sight,)
        self.sight = min(self.sight + CRITICAL_GAP * site.speed_limit, intersection.approach_length)

    def show(self, view: View, wanted: Sequence[Colour]) -> list[Command]:
        """Turn the heads, then let vehicles go and hold others."""
        self._ahead = view.vehicles
        ends = self._ends
        here = tuple(v for v in view.vehicles if v.distance + ends[self._way(v)] + v.length >= 0.0)
        commands = super().show(view._replace(vehicles=here), wanted)
        lanes = {lane: list(those) for lane, those in groupby(here, lambda v: v.lane)}
        # First those that wait for gaps: the oncoming ones are held in the same answer.
        takers = [v for lane in lanes if (v := self._next_taker(lane, lanes)) is not None]
        takers = [v for v in takers if self._has_gap(v, lanes, view.time)]
        for v in takers:
            if not any(self._ties[self._way(v)][self._way(x)] for x in takers if x.lane < v.lane):
                commands += self._let(v)
                self._went[v.lane] = view.time
        for lane in lanes:
            if self._partners[lane]:
                commands += self._keep_clear(lane, lanes)
        # A vehicle clears the junction unnoticed: it stays in view.
        waiting = self.colours != list(wanted) or any(self._waits[self._way(v)] for v in here)
        self.next_look = view.time + self._look if waiting else math.inf
        return commands

    def rests(self, wanted: Sequence[Colour]) -> bool:  # noqa: ARG002
        """Never: vehicles that turn give way to others."""
        return False

    def _may_open(self, lane: int, view: View) -> bool:
        sneakers = [v for v in view.vehicles if self._sneakers.get(v.lane) == v.id]
        others = [v for v in sneakers if v.lane not in self._partners[lane]]
        crossed = self._crossed[lane]
        return super()._may_open(lane, view) and not any(crossed[self._way(v)] for v in others)

    def _open(self, lane: int) -> list[Command]:
        self._sneakers.pop(lane, None)
        return [] if self._partners[lane] else super()._open(lane)

    def _close(self, lane: int, view: View) -> list[Command]:
        if not self._partners[lane]:
            return super()._close(lane, view)
        approaching = [v for v in view.vehicles if v.lane == lane and v.distance >= 0.0]
        gone = [v for v in approaching if v.id in self._let_go]
        back = gone[len(committed(gone, self._stops)) :]
        self._let_go.difference_update(v.id for v in back)
        first = next((v for v in approaching if v.id not in self._let_go), None)
        if first is not None and first.distance <= SUMO_AT_LINE and self._waits[self._way(first)]:
            self._sneakers[lane] = first.id
        return [Hold(v.id) for v in back]

    def _let(self, vehicle: Observed) -> list[Command]:
        self._let_go.add(vehicle.id)
        self._sneakers.pop(vehicle.lane, None)
        return [Go(vehicle.id)]

    def _next_taker(self, lane: int, lanes: Lanes) -> Observed | None:
        """The next vehicle of a lane, if it has to wait for a gap and may take one now.

        A vehicle decides as late as it can without braking, and so sees more of those that come.
        """
        held = (v for v in lanes[lane] if v.distance >= 0.0 and v.id not in self._let_go)
        first = next(held, None)
        if first is None or not self._waits[self._way(first)]:
            return None
        stop = stopping_distance(first.speed, self._types[first.type].deceleration)
        near = first.distance <= stop + first.speed * self._look + SIGHT_MARGIN
        may = self.colours[lane] is Colour.GREEN or self._sneakers.get(lane) == first.id
        return first if near and may else None

    def _has_gap(self, me: Observed, lanes: Lanes, now: float) -> bool:
        """Whether a vehicle that has to wait for a gap has one now.

        A gap is the time between the fronts of two vehicles at their conflict zones; one that is
        just past still counts.
        """
        way, a = self._way(me), self._types[me.type].acceleration
        soonest, clear, since = math.inf, 0.0, 0.0  # [s from now, s, s]
        for it in self._oncoming(me.lane, lanes):
            its, gone = self._way(it), it.id in self._let_go
            yields = self._yields[way][its]
            if gone and self._yields[its][way] and not self._is_sure(it, me):
                return False
            if not (yields or (gone and self._ties[way][its])):
                continue
            enter, leave = self._zone(it, way)
            if it.distance + leave <= 0.0:
                since = -(it.distance + enter) / max(it.speed, HALTING)
            elif yields and self._stops(it):
                soonest = min(soonest, self._arrival(it, enter))
                _, end = self._zone(me, its)
                needed = travel_time(me.distance + end, me.speed, a, self._caps[way])
                clear = max(clear, needed)
            else:
                return False
        followed = now - self._went[me.lane] >= FOLLOW_UP - self._look / 2.0
        accepted = followed and soonest + since >= CRITICAL_GAP and soonest >= clear
        return accepted or math.isinf(soonest)

    def _oncoming(self, lane: int, lanes: Lanes) -> Iterator[Observed]:
        """The vehicles on the facing lane that have gone or come; none comes behind one held."""
        for other in self._partners[lane]:
            comes = self.colours[other] is Colour.GREEN
            for v in lanes.get(other, ()):
                gone = v.id in self._let_go
                if gone or comes:
                    yield v
                if not gone and v.distance <= SUMO_AT_LINE and self._waits[self._way(v)]:
                    comes = False

    def _keep_clear(self, lane: int, lanes: Lanes) -> Iterator[Command]:
        """Let vehicles go whose way is clear in time; hold those whose way no longer is."""
        blocked = False
        for v in lanes[lane]:
            if v.distance < 0.0:
                continue
            way, gone = self._way(v), v.id in self._let_go
            may = gone or (self.colours[lane] is Colour.GREEN and not self._waits[way])
            turning = (
                x
                for x in self._oncoming(lane, lanes)
                if x.id in self._let_go and self._yields[self._way(x)][way]
            )
            blocked = blocked or not may or not all(self._is_sure(x, v) for x in turning)
            if not blocked and not gone:
                yield from self._let(v)
            elif blocked and gone and self._stops(v):
                self._let_go.remove(v.id)
                yield Hold(v.id)

    def _is_sure(self, turning: Observed, other: Observed) -> bool:
        """Whether a vehicle, at its present speed, is out of another's way before that one comes.

        It counts as no faster than its turn and its exit allow, and than any vehicle ahead of it.
        A vehicle for the same exit follows when it has left; sooner, it would have to brake hard.
        """
        way, its = self._way(turning), self._way(other)
        left = turning.distance + self._zone(turning, its)[1]
        if left <= 0.0:
            return True
        if self._exits[way] == self._exits[its]:
            return False
        ahead = [
            v.speed
            for v in self._ahead
            if v.distance < turning.distance
            and (v.lane == turning.lane or self._exits[self._way(v)] == self._exits[way])
        ]
        pace = min([turning.speed, self._caps[way], *ahead])
        return pace > 0.0 and left / pace <= self._arrival(other, self._zone(other, way)[0])

    def _arrival(self, vehicle: Observed, place: float) -> float:
        """Least time until a vehicle is `place` m past its entry [s]."""
        cap = self._limit(vehicle.lane) * vehicle.speed_factor
        a = self._types[vehicle.type].acceleration
        return travel_time(vehicle.distance + place, vehicle.speed, a, cap)

    def _zone(self, vehicle: Observed, way: int) -> tuple[float, float]:
        """Where a vehicle's front enters and leaves its conflict zone with a movement [m]."""
        enter, leave = self._zones[vehicle.type][self._way(vehicle)][way]
        return enter, leave

    def _way(self, vehicle: Observed) -> int:
        return self._rows[vehicle.lane][vehicle.manoeuvre]


def travel_time(distance: float, speed: float, acceleration: float, cap: float) -> float:
    """Least time [s] for a distance [m], from `speed` at full acceleration up to `cap` [m/s]."""
    if distance <= 0.0:
        return 0.0
    speeding_up = max(cap - speed, 0.0) / acceleration
    there = (speed + acceleration * speeding_up / 2.0) * speeding_up
    if distance <= there:
        return (math.sqrt(speed * speed + 2.0 * acceleration * distance) - speed) / acceleration
    return speeding_up + (distance - there) / max(speed, cap)
