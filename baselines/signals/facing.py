"""Approaches that face each other are green together, and far turns wait for gaps.

This is the permitted turn of the Highway Capacity Manual (HCM 2010, ch. 18 and 31; a left turn in
right-hand traffic). A vehicle that turns across the oncoming lane waits at its line until no
oncoming vehicle arrives within the critical gap. So does one at an approach that another faces at
an angle: of two vehicles whose ways conflict, the one that turns more to the far side yields.

Vehicles cannot collide, whatever gap a driver would accept:
- A vehicle that yields goes only if each oncoming one has passed, or can stop and comes later than
  it needs to clear the way.
- Once it has gone, an oncoming vehicle has the right of way only while the turning one, at its
  present speed, would be out of its way first. It loses it while it can still stop.

At the end of a green, the first vehicle of each lane that stands and waits for a gap still goes
once the oncoming ones have passed ("sneakers"; HCM: 2 in a lane of their own, else 1 + their share,
but those wait inside the junction). The next green comes when it is clear.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.signals.heads import SIGHT_MARGIN, Colour, Heads, committed, full_order
from minisim.control import (
    HALTING,
    LATERAL_ACCELERATION,
    ORDINARY,
    Command,
    Go,
    Hold,
    Observed,
    Site,
    View,
    stopping_distance,
)
from minisim.junction.conflicts import conflict_zones
from minisim.junction.geometry import Intersection
from minisim.parameters import switch

#: Two arms face each other if they are at most this far from a straight line [°]: half of a right
#: angle, from where on a way is rather a turn.
FACING = 45.0
#: Critical gap and follow-up headway of a permitted left turn [s] (HCM 2010, ch. 31).
CRITICAL_GAP, FOLLOW_UP = 4.5, 2.5
#: A vehicle waits at the line when its front is at most this far before it [m].
LINE = 1.0
#: Time between two looks for a gap [s].
LOOK = 0.2
#: Ways whose turns differ by less than this turn alike [rad].
ALIKE = 1e-6


def facing(intersection: Intersection) -> dict[int, tuple[int, ...]]:
    """The approaches that are green together with each, itself included, in order.

    Arms nearest to a straight line are paired first. One that faces none is green alone.
    """
    lanes, bearings = intersection.approaches, intersection.bearings
    bends = sorted(
        (round(abs((bearings[j] - bearings[i]) % 360.0 - 180.0), 6), i, j)
        for i in lanes
        for j in lanes
        if i < j
    )
    phases = {lane: (lane,) for lane in lanes}
    for bend, i, j in bends:
        if bend <= FACING and phases[i] == (i,) and phases[j] == (j,):
            phases[i] = phases[j] = (i, j)
    return phases


def phases_of(
    order: tuple[int, ...] | None, intersection: Intersection, together: bool
) -> list[tuple[int, ...]]:
    """The phases of a signal, by the first lane of each in an `order` of all lanes.

    Each is an approach alone or, if `together`, with the one that faces it. Raises `InputError`
    unless `order` lists every lane once.
    """
    lanes = full_order(order, intersection)
    phases = facing(intersection) if together else {lane: (lane,) for lane in lanes}
    return list(dict.fromkeys(phases[lane] for lane in lanes))


def facing_switch() -> Any:
    """The field of a signal that says whether facing approaches are green together."""
    return switch(
        "whether approaches that face each other are green together, so that far turns wait for "
        "gaps; one that none faces within 45° stays alone",
        default=False,
    )


Lanes = dict[int, list[Observed]]


class _Type(NamedTuple):
    """What is known of the vehicles of a type."""

    zones: list[list[list[float]]]  # conflict zones of its movements, see `conflict_zones`
    acceleration: float  # [m/s²]
    deceleration: float  # [m/s²]


class FacingHeads(Heads):
    """Heads of approaches that are green together; they let vehicles go one by one.

    Raises `InputError` for vehicles that a signal cannot hold one by one.
    """

    def __init__(self, site: Site, name: str) -> None:
        super().__init__(site)
        ORDINARY.check(name, site.vehicle)
        intersection = site.intersection
        for lane, phase in facing(intersection).items():
            self._partners[lane] = tuple(other for other in phase if other != lane)
        paths = intersection.paths
        far = np.array([path.turn for path in paths]) * (1 if intersection.side == "right" else -1)
        turns_more = far[:, None] - far
        conflicts = site.conflicts
        self._yields = (conflicts & (turns_more > ALIKE)).tolist()
        self._ties = (conflicts & (abs(turns_more) <= ALIKE)).tolist()
        partners = np.array(
            [
                [q.origin in self._partners[p.origin] for q in intersection.movements]
                for p in intersection.movements
            ]
        )
        #: Whether a movement may have to wait for a gap.
        self._waits = (conflicts & partners & (turns_more > -ALIKE)).any(axis=1).tolist()
        self._types = [
            _Type(
                conflict_zones(intersection, it, site.fleet).tolist(),
                it.acceleration,
                it.deceleration,
            )
            for it in site.types
        ]
        self._caps = [
            min(intersection.turn_speed(path.movement, LATERAL_ACCELERATION),
                site.limit(path.exit_arm))
            for path in paths
        ]  # fmt: skip
        self._exits = intersection.movements.exits.tolist()
        self._limit = site.limit
        self._look = max(LOOK, site.dt)
        self._sneakers: dict[int, int] = {}  # lane: vehicle that may still go
        self._went = [-math.inf] * intersection.n  # when the last one that waited for a gap went
        self.marks = (self.sight,)
        self.sight = min(self.sight + CRITICAL_GAP * site.speed_limit, intersection.approach_length)

    def show(self, view: View, wanted: Sequence[Colour]) -> list[Command]:
        """Turn the heads, then let vehicles go and hold others."""
        commands = super().show(view, wanted)
        lanes = _by_lane(view)
        for lane, colour in enumerate(self.colours):
            if colour is Colour.GREEN:
                self._sneakers.pop(lane, None)
        # First those that wait for a gap, so that oncoming ones are held in the same answer.
        takers = [v for lane in lanes if (v := self._waiting(lane, lanes)) is not None]
        takers = [v for v in takers if self._is_free(v, lanes, view.time)]
        for v in takers:
            if not any(self._ties[self._way(v)][self._way(x)] for x in takers if x.lane < v.lane):
                commands += self._let(v)
                self._went[v.lane] = view.time
        for lane in lanes:
            commands += self._keep_clear(lane, lanes)
        waiting = any(self._waits[self._way(v)] for vs in lanes.values() for v in vs)
        self.next_look = view.time + self._look if waiting else math.inf
        return commands

    def _may_open(self, lane: int, view: View) -> bool:
        others = [v for v in view.vehicles if v.id in self._sneakers.values()]
        crossed = self._crossed[lane]
        return super()._may_open(lane, view) and not any(
            crossed[self._way(v)] for v in others if v.lane not in self._partners[lane]
        )

    def _open(self, lane: int) -> list[Command]:
        return [] if self._partners[lane] else super()._open(lane)

    def _close(self, lane: int, view: View) -> list[Command]:
        if not self._partners[lane]:
            return super()._close(lane, view)
        approaching = [v for v in view.vehicles if v.lane == lane and v.distance >= 0.0]
        gone = [v for v in approaching if v.id in self._let_go]
        back = gone[len(committed(gone, self._stops)) :]
        self._let_go.difference_update(v.id for v in back)
        first = next((v for v in approaching if v.id not in self._let_go), None)
        if first is not None and first.distance <= LINE and self._waits[self._way(first)]:
            self._sneakers[lane] = first.id
        return [Hold(v.id) for v in back]

    def _let(self, vehicle: Observed) -> list[Command]:
        self._let_go.add(vehicle.id)
        self._sneakers.pop(vehicle.lane, None)
        return [Go(vehicle.id)]

    def _waiting(self, lane: int, lanes: Lanes) -> Observed | None:
        """The vehicle of a lane that goes next, if it may go now and has to wait for a gap."""
        first = next((v for v in lanes[lane] if v.id not in self._let_go and v.distance >= 0), None)
        if first is None or not self._waits[self._way(first)]:
            return None
        b, speed = self._types[first.type].deceleration, first.speed
        if first.distance > stopping_distance(speed, b) + speed * self._look + SIGHT_MARGIN:
            return None  # it need not decide yet, and will see more of those that come
        green = self.colours[lane] is Colour.GREEN
        return first if green or self._sneakers.get(lane) == first.id else None

    def _is_free(self, me: Observed, lanes: Lanes, now: float) -> bool:
        """Whether a vehicle that has to wait for a gap has one now."""
        mine, clear, since = self._way(me), 0.0, math.inf
        soonest = math.inf  # when the next oncoming vehicle arrives [s from now]
        for it in self._oncoming(me.lane, lanes):
            its, gone = self._way(it), it.id in self._let_go
            if self._yields[its][mine]:
                if gone and not self._is_sure(it, me, lanes):
                    return False
            elif self._yields[mine][its] or (gone and self._ties[mine][its]):
                enter, leave = self._zone(it, mine)
                if it.distance + leave <= 0.0:
                    since = min(since, -(it.distance + enter) / max(it.speed, HALTING))
                elif not (self._yields[mine][its] and self._stops(it)):
                    return False
                else:
                    soonest = min(soonest, self._arrival(it, enter))
                    _, end = self._zone(me, its)
                    a, cap = self._types[me.type].acceleration, self._caps[mine]
                    clear = max(clear, travel_time(me.distance + end, me.speed, a, cap))
        if math.isinf(soonest):
            return True
        gap = soonest + (since if since < CRITICAL_GAP else 0.0)
        followed = now - self._went[me.lane] >= FOLLOW_UP - self._look / 2.0
        return followed and gap >= CRITICAL_GAP and soonest >= clear

    def _oncoming(self, lane: int, lanes: Lanes) -> Iterator[Observed]:
        """The vehicles on the facing lanes that have gone or come, not those behind one held."""
        for other in self._partners[lane]:
            comes = self.colours[other] is Colour.GREEN
            for v in lanes.get(other, ()):
                if v.id in self._let_go:
                    yield v
                elif comes:
                    yield v
                    comes = not (v.distance <= LINE and self._waits[self._way(v)])

    def _keep_clear(self, lane: int, lanes: Lanes) -> Iterator[Command]:
        """Let vehicles go whose way is clear in time, and hold those whose way is not any more."""
        blocked = not self._partners[lane]
        for v in lanes[lane]:
            if v.distance < 0.0 or not self._partners[lane]:
                continue
            mine = self._way(v)
            blocked = blocked or not all(
                self._is_sure(it, v, lanes)
                for it in self._oncoming(lane, lanes)
                if it.id in self._let_go and self._yields[self._way(it)][mine]
            )
            if v.id not in self._let_go:
                blocked = blocked or self._waits[mine] or self.colours[lane] is not Colour.GREEN
                if not blocked:
                    yield from self._let(v)
            elif blocked and self._stops(v):
                self._let_go.remove(v.id)
                yield Hold(v.id)

    def _is_sure(self, turning: Observed, other: Observed, lanes: Lanes) -> bool:
        """Whether a vehicle, at its present speed, is out of another's way before that one comes.

        It counts as no faster than its turn and its exit allow, and than any vehicle ahead of it.
        A vehicle for the same exit follows only when it has left, or would brake hard behind it.
        """
        way, its = self._way(turning), self._way(other)
        _, leave = self._zone(turning, its)
        left = turning.distance + leave
        if left <= 0.0:
            return True
        ahead = [
            v.speed
            for vs in lanes.values()
            for v in vs
            if v.distance < turning.distance
            and (v.lane == turning.lane or self._exits[self._way(v)] == self._exits[way])
        ]
        pace = min([turning.speed, self._caps[way], *ahead])
        enter, _ = self._zone(other, way)
        apart = self._exits[way] != self._exits[its]
        return apart and pace > 0.0 and left / pace <= self._arrival(other, enter)

    def _arrival(self, vehicle: Observed, place: float) -> float:
        """Time until a vehicle can be `place` m past its entry, at full acceleration [s]."""
        cap = self._limit(vehicle.lane) * vehicle.speed_factor
        a = self._types[vehicle.type].acceleration
        return travel_time(vehicle.distance + place, vehicle.speed, a, cap)

    def _zone(self, vehicle: Observed, way: int) -> list[float]:
        """Where a vehicle's front enters and leaves its conflict zone with a movement [m]."""
        return self._types[vehicle.type].zones[self._way(vehicle)][way]

    def _way(self, vehicle: Observed) -> int:
        return self._rows[vehicle.lane][vehicle.manoeuvre]


def travel_time(distance: float, speed: float, acceleration: float, cap: float) -> float:
    """Least time for a distance [m], from `speed` at full acceleration up to `cap` [m/s]; in s."""
    if distance <= 0.0:
        return 0.0
    speeding_up = max(cap - speed, 0.0) / acceleration
    there = (speed + acceleration * speeding_up / 2.0) * speeding_up
    if distance <= there:
        return (math.sqrt(speed * speed + 2.0 * acceleration * distance) - speed) / acceleration
    return speeding_up + (distance - there) / max(speed, cap)


def _by_lane(view: View) -> Lanes:
    lanes: Lanes = {}
    for v in view.vehicles:
        lanes.setdefault(v.lane, []).append(v)
    return lanes
