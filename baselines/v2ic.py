"""V2I-C: a serving list at the roadside advises every vehicle when to reach its stop line.

Source: Li, Liu, PLOS ONE 15(7), 2020, e0235644, and the authors' own code. A unit at the junction
lists the vehicles in its range in the order of arrival, and estimates when each will have left. A
vehicle that conflicts with some ahead of it in the list is told to arrive when the last of them
leaves. We differ from the source for safety:

- distances are to the true stop line, and a vehicle has left when its rear bumper is out of the
  junction; the conflicts follow from the geometry, merging included;
- a speed is advice: the vehicle accelerates and brakes by its car-following law, never exceeds the
  limit, and stops at its line unless the unit has let it go;
- a vehicle gets the right of way only when every conflicting vehicle ahead in the list *has* left,
  and then keeps it, so two vehicles in conflict never hold it at once;
- so it is safe with messages that fail (`minisim.link`): a vehicle stays in the list until it has
  said that it left, and one that did not hear of its right of way stops at its line;
- leaving times are capped (`leaving_time`): distance over speed explodes at low speed, and a
  crawling vehicle would stop those behind it in the list far from the junction.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from minisim.control import Advise, Command, Go, Observed, Plan, Radio, Site, View, Wake
from minisim.names import Name
from minisim.parameters import declared, real
from minisim.reasons import Reason

#: Added to speeds used as divisors, as in the authors' code [m/s].
CRAWL = 1e-5


@declared
class V2IC:
    """V2I-C, the controller of Li and Liu: a roadside unit with a serving list advises speeds."""

    name = Name("v2ic")
    radio = Radio()

    # 200 m in the authors' code.
    reach: float = real(
        "how far before the junction, on the road, vehicles register", "m",
        low=1, high=2000, default=200.0,
    )  # fmt: skip
    # The authors' 0.01 s is their simulation step. On 4 arms at 350 veh/h/lane the mean time loss
    # is 8.9 s at 0.1 s and 9.0 s at 1 s (profile paper; fair: 8.1 s at both), for 1/8 of the work.
    period: float = real(
        "time between two pieces of advice while any vehicle waits", "s",
        low=0.01, high=10, default=1.0,
    )  # fmt: skip

    def start(self, site: Site) -> V2ICSession:
        """Begin a run; raises `InputError` for a period below the host's step."""
        return V2ICSession(self, site)


def time_to_cover(distance: float, speed: float, acceleration: float, limit: float) -> float:
    """Time to cover a distance [s], accelerating from a speed up to the limit (SI units).

    While it accelerates, this is (v_des − v)/a with v_des = √(v² + 2·a·D), as in the authors' code.
    """
    if speed >= limit:
        return distance / speed
    reached = math.sqrt(speed * speed + 2.0 * acceleration * distance)
    if reached <= limit:
        return (reached - speed) / acceleration
    run_up = (limit * limit - speed * speed) / (2.0 * acceleration)
    return (limit - speed) / acceleration + (distance - run_up) / limit


def advised_speed(distance: float, speed: float, time: float, limit: float) -> float:
    """Speed to command so that a vehicle covers `distance` in `time` [m/s], within [0, limit].

    This is 2·D/M − v, the final speed of uniform braking: v − dec·M with dec = 2·(v·M − D)/M². For
    a vehicle at or past the line it is 0. A time of 0 or less asks for no braking.
    """
    if distance <= 0.0:
        return 0.0
    if time <= 0.0:
        return limit
    return min(max(2.0 * distance / time - speed, 0.0), limit)


class V2ICSession:
    """One run: the serving list; called as vehicles register and leave, and while any waits."""

    def __init__(self, controller: V2IC, site: Site) -> None:
        reach = min(controller.reach, site.intersection.approach_length)
        self.plan = Plan(marks=(reach,), wake_on_clear=True, sight=reach)
        self.order: list[int] = []  #: ids of the vehicles, in order of registration
        self.granted: set[int] = set()  #: ids of those with the right of way
        self._period = site.period("period", controller.period)
        self._rows = site.intersection.movements.rows
        self._limit = site.limit
        self._accelerations = [it.acceleration for it in site.types]
        self._crossing = [path.crossing for path in site.intersection.paths]
        self._foes = [[int(q) for q in row.nonzero()[0]] for row in site.conflicts]

    def decide(self, view: View) -> Iterable[Command]:
        """Update the list and serve it."""
        seen = {vehicle.id: vehicle for vehicle in view.vehicles}
        self._register(seen)
        yield from self._serve(seen)
        if len(self.granted) < len(self.order):
            yield Wake(view.time + self._period)

    def reasons(self, view: View) -> dict[int, Reason]:
        """Why vehicles wait that have none ahead of them waiting (`minisim.reasons.Explaining`)."""
        seen = {vehicle.id: vehicle for vehicle in view.vehicles}
        rows = {v.id: self._rows[v.lane][v.manoeuvre] for v in view.vehicles}
        waiting = [v for v in reversed(view.vehicles) if v.id not in self.granted]
        fronts = {v.lane: v.id for v in waiting}
        order = [vehicle for vehicle in self.order if vehicle in seen]
        found = {}
        for me in fronts.values():
            if me in order:
                before = order[: order.index(me)]
                others = tuple(v for v in before if rows[v] in self._foes[rows[me]])
                found[me] = Reason("listed" if others else "looks again", me, others)
        return found

    def _register(self, seen: dict[int, Observed]) -> None:
        """Drop vehicles that have left, and append new ones, nearest first."""
        self.order = [vehicle for vehicle in self.order if vehicle in seen]
        self.granted.intersection_update(self.order)
        new = seen.keys() - self.order
        self.order += sorted(new, key=lambda v: (seen[v].distance, seen[v].lane))

    def _serve(self, seen: dict[int, Observed]) -> Iterable[Command]:
        """Go through the list once: right of way if the way is free, advice for the rest."""
        latest = [0.0] * len(self._foes)  # leaving time of the last of each movement so far [s]
        for vehicle in self.order:
            me = seen[vehicle]
            limit = self._limit(me.lane)
            p = self._rows[me.lane][me.manoeuvre]
            blocked = max([latest[q] for q in self._foes[p]], default=0.0)
            distance = me.distance + self._crossing[p] + me.length
            a = self._accelerations[me.type]
            if vehicle in self.granted:
                leaving = self.leaving_time(distance, me.speed, 0.0, a, limit)
            elif blocked > 0.0:
                yield Advise(vehicle, advised_speed(me.distance, me.speed, blocked, limit))
                leaving = self.leaving_time(distance, me.speed, blocked, a, limit)
            else:
                self.granted.add(vehicle)
                yield Go(vehicle)
                yield Advise(vehicle, math.inf)
                leaving = time_to_cover(distance, me.speed, a, limit)
            latest[p] = max(latest[p], leaving)

    def leaving_time(
        self, distance: float, speed: float, blocked: float, a: float, limit: float
    ) -> float:
        """Time that a vehicle needs to leave, `distance` ahead, at its present speed [s].

        It is never 0, since a listed vehicle has not left, and at most `blocked`, the time until
        it can be let go, plus the time from rest at its present place, at acceleration `a`.
        """
        from_rest = time_to_cover(distance, 0.0, a, limit)
        return max(min(distance / (speed + CRAWL), blocked + from_rest), CRAWL)
