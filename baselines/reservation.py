"""Space-time reservation, first come first served, on pairwise conflict zones.

Source: Dresner, Stone, JAIR 31 (2008), 591–656. A vehicle asks the manager of the junction for a
passage. The manager predicts how the vehicle would drive, and grants the passage if the space it
needs is free at the time. Dresner and Stone use a grid of tiles. We use the conflict zones of the
movements (`minisim.junction.conflicts`): only pairs matter, and each pair's stretches are exact.

The protocol:
- From `reach` before the junction on, the first vehicle of a lane asks, and so does any vehicle
  directly behind a holder. Its passage is predicted by the vehicles' own law
  (`baselines.prediction`), behind those ahead in its lane and in its exit lane.
- The passage is granted if, for every other holder in conflict, one of the two has left its zone
  `buffer` seconds before the other enters its own. Holders enter a shared exit lane in the order of
  their grants, so a later grant never slows down an earlier one. The law lets a vehicle in the
  junction follow the one ahead of it into the exit lane as if both were on one arc. A passage on
  which it brakes harder than is comfortable for that vehicle is refused.
- A refused vehicle drives up to its stop line and slows down as late as is comfortable. Refused
  requests are considered again every `period`, in the order in which they were first made.

Safety does not depend on predictions far ahead. Every `period` the manager compares holders with
their predictions, and predicts again where they differ. A holder whose new passage no longer fits
loses its reservation if it can still stop, and so does its follower. So the passage of a vehicle
that can no longer stop fits those of all others that cannot, and the rest yield. What remains is
the error of a prediction over the last seconds before the zones, from a state at most one period
old; `buffer` covers it. Vehicles that differ or follow an unknown law are refused.

If messages fail, no reservation is revoked: see `baselines.promises`.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from baselines.prediction import Floats, Leader, courses, law_of, predict
from minisim.control import (
    Command,
    Cover,
    Go,
    Hold,
    Observed,
    Plan,
    Radio,
    Site,
    View,
    Wake,
    can_stop,
    stopping_distance,
)
from minisim.junction.conflicts import conflict_zones
from minisim.junction.partings import branch
from minisim.laws import Traits, traits_of
from minisim.names import Name
from minisim.parameters import declared, real
from minisim.reasons import Reason

#: Smaller differences from the prediction do not count [m], [m/s].
POSITION_TOLERANCE, SPEED_TOLERANCE = 0.05, 0.05

#: A held vehicle stands up to this far before its line [m], so no vehicle may ask any later.
STANDS_BEFORE = 1.0


@declared
class Reservation:
    """Space-time reservation, first come first served, for vehicles whose drivers are alike."""

    name = Name("reservation")
    covers = Cover(alike=True)
    radio = Radio()

    # Asking earlier lets distant vehicles reserve room that nearer ones need: at 350 veh/h/lane
    # (fair) the mean time loss is 4.1 s at 30 m, 4.7 at 60, 5.3 at 100 and 10.2 at 150.
    reach: float | None = real(
        "how far before the junction vehicles ask; none means stopping distance at the limit and "
        "a period's way: as late as possible without slowing down for a refusal", "m",
        low=1, high=1000, optional=True, default=None,
    )  # fmt: skip
    # 0.25 s on either side, as at the edge tiles of the AIM4 simulator.
    buffer: float = real(
        "time between one vehicle's leaving a conflict zone and another's entering its own", "s",
        low=0, high=10, default=0.5,
    )  # fmt: skip
    period: float = real("time between two looks", "s", low=0.01, high=10, default=0.5)

    def start(self, site: Site) -> ReservationSession:
        """Begin a run; raises `InputError` for vehicles whose motion cannot be predicted.

        A period below the host's step is refused, too.
        """
        from baselines.promises import PromiseSession  # which builds on this module

        self.covers.check(self.name, site.vehicle)
        return PromiseSession(self, site) if site.channel else ReservationSession(self, site)


@dataclass(frozen=True, eq=False)
class Slot:
    """A reservation: how a vehicle will cross."""

    vehicle: int
    lane: int
    type: Traits  #: of the vehicle
    movement: int  #: its index
    start: int  #: when the prediction was made [steps]
    s: Floats  #: positions past the entry [m], one per step from `start` on
    v: Floats  #: speeds [m/s]
    enters: int  #: when its front is in the junction [steps]
    #: For each conflicting movement, the last step before and the first step past the zone.
    zones: dict[int, tuple[int, int]]
    hard: bool  #: whether it brakes hard for a vehicle from another lane

    @property
    def ends(self) -> int:
        """The last step that is predicted."""
        return self.start + len(self.s) - 1

    def at(self, now: int) -> float:
        """Where its front is at `now` [steps], past the entry [m]."""
        return float(self.s[now - self.start])

    def leader(self, now: int, until: float = math.inf, shift: float = 0.0) -> Leader:
        """What a follower meets from `now` [steps] on."""
        s, v = self.s[now - self.start :], self.v[now - self.start :]
        return Leader(s, v, self.type.length, self.type.b_max, until, shift)

    def expects(self, seen: Observed, now: int) -> bool:
        """Whether the vehicle is where it was predicted to be."""
        off, faster = self.at(now) + seen.distance, float(self.v[now - self.start]) - seen.speed
        return abs(off) <= POSITION_TOLERANCE and abs(faster) <= SPEED_TOLERANCE


class Manager:
    """Which vehicle holds which reservation, and which are possible; times in host steps."""

    def __init__(self, site: Site, buffer: float) -> None:
        self.slots: dict[int, Slot] = {}  #: by vehicle, in the order of their grants
        self._law = law_of(site)
        self._ways = courses(site)
        self._types = tuple(map(traits_of, site.types))
        tables = (conflict_zones(site.intersection, it, site.fleet).tolist() for it in site.types)
        self._zones = [
            [{q: it for q, it in enumerate(row) if it[0] == it[0]} for row in zones]
            for zones in tables
        ]
        entry = site.intersection.approach_length
        self._branch = branch(site.intersection, site.fleet) - entry
        self._rows = site.intersection.movements.rows
        self._buffer = math.ceil(buffer / site.dt - 1e-6)

    def predict(
        self, seen: Observed, now: int, held: int = 0, without: Collection[int] = ()
    ) -> Slot | None:
        """A vehicle's passage behind the holders ahead of it in both lanes; None if it hits one.

        It may drive on after `held` steps; holders in `without` do not enter its exit lane.
        """
        p = self._rows[seen.lane][seen.manoeuvre]
        way = self._ways[p]
        others = [slot for slot in self.slots.values() if slot.vehicle != seen.id]
        ahead = [s for s in others if s.lane == seen.lane and s.at(now) > -seen.distance]
        ahead.sort(key=lambda slot: slot.at(now))
        lane = [slot.leader(now, until=float(self._branch[slot.movement, p])) for slot in ahead]
        own = self.slots.get(seen.id)
        latest = math.inf if own is None else own.enters
        rivals = sorted((s for s in others if s.enters < latest), key=lambda slot: slot.enters)
        exit_lane = [
            slot.leader(now, shift=way.crossing - self._ways[slot.movement].crossing)
            for slot in rivals
            if self._ways[slot.movement].exit_arm == way.exit_arm and slot.vehicle not in without
        ]
        me = self._types[seen.type]
        motion = predict(
            self._law, me, way, -seen.distance, seen.speed, lane=lane, exit_lane=exit_lane,
            held=held,
        )  # fmt: skip
        if motion is None:
            return None
        s, v, hard = motion
        enters = now + int(s.searchsorted(0.0))
        zones = {
            q: (now + int(s.searchsorted(first, "right")) - 1, now + int(s.searchsorted(last)))
            for q, (first, last) in self._zones[seen.type][p].items()
        }
        return Slot(seen.id, seen.lane, me, p, now, s, v, enters, zones, hard)

    def alone(self, me: Observed, now: int, mark: float) -> int:
        """When a vehicle would be at a place past the entry [m] if it drove on alone [steps]."""
        way = self._ways[self._rows[me.lane][me.manoeuvre]]._replace(end=mark)
        run = predict(self._law, self._types[me.type], way, -me.distance, me.speed)
        return now + (len(run.s) if run is not None else 0)

    def fits(self, slot: Slot, *, last: bool) -> bool:
        """Whether a passage fits every other; the `last` comes after all in its exit lane."""
        return not slot.hard and next(self.misfits(slot, last=last), None) is None

    def misfits(self, slot: Slot, *, last: bool) -> Iterator[Slot]:
        """Those passages that a passage does not fit; see `fits`."""
        exit_arm = self._ways[slot.movement].exit_arm
        for other in self.slots.values():
            if other.vehicle == slot.vehicle or other.movement not in slot.zones:
                continue
            merges = self._ways[other.movement].exit_arm == exit_arm
            before = not (last and merges) and self._clears(slot, other, merges)
            if not before and not self._clears(other, slot, merges):
                yield other

    def _clears(self, first: Slot, second: Slot, merges: bool) -> bool:
        """Whether `first` has passed when `second` comes, and enters a common exit lane first."""
        through = first.zones[second.movement][1] + self._buffer <= second.zones[first.movement][0]
        return through and (not merges or first.enters < second.enters)


class ReservationSession:
    """One run: keeps reservations in line with what is seen, and serves requests."""

    def __init__(self, controller: Reservation, site: Site) -> None:
        self.manager = Manager(site, controller.buffer)
        reach = controller.reach
        if reach is None:
            braking = stopping_distance(site.speed_limit, site.vehicle.deceleration)
            reach = max(braking + controller.period * site.speed_limit, STANDS_BEFORE)
        reach = min(reach, site.intersection.approach_length)
        self.plan = Plan(marks=(reach,), sight=reach)
        self._period = site.period("period", controller.period)
        self._dt = site.dt
        self._brakes = [it.deceleration for it in site.types]
        self._requests: dict[int, None] = {}  # in the order of first requests
        self._now = -1  # when it last decided [steps]
        self._said: dict[int, Reason] = {}  # as of then, if it was asked

    def decide(self, view: View) -> Iterable[Command]:
        """Check the reservations, then consider the requests in the order in which they came."""
        self._now = now = round(view.time / self._dt)
        manager = self.manager
        seen = {vehicle.id: vehicle for vehicle in view.vehicles}
        manager.slots = {v: slot for v, slot in manager.slots.items() if slot.ends >= now}
        ahead = {v.id: before.id for before, v in pairwise(view.vehicles) if before.lane == v.lane}
        commands: list[Command] = [Hold(v) for v in self._revoke(seen, ahead, now)]
        for vehicle in seen:
            if vehicle not in manager.slots:
                self._requests.setdefault(vehicle)
        self._requests = {v: None for v in self._requests if v in seen and v not in manager.slots}
        commands += [self._permit(v) for v in self._grant(seen, ahead, now)]
        if seen:
            commands.append(Wake(view.time + self._period))
        return commands

    def reasons(self, view: View) -> dict[int, Reason]:
        """Why vehicles before the junction wait or go (`minisim.reasons.Explaining`)."""
        if round(view.time / self._dt) == self._now:  # later, the passages may have ended
            self._said = dict(self._explain(view))
        before = (v.id for v in view.vehicles if v.distance >= 0.0)
        return {vehicle: self._said[vehicle] for vehicle in before if vehicle in self._said}

    def _explain(self, view: View) -> Iterator[tuple[int, Reason]]:
        """The reasons of holders and of those that have none without a passage ahead of them."""
        slots, leader = self.manager.slots, None
        for me in view.vehicles:
            if leader is not None and leader.lane != me.lane:
                leader = None
            if me.id in slots:
                yield me.id, Reason("passage", me.id, until=slots[me.id].enters * self._dt)
            elif leader is None or leader.id in slots:
                yield me.id, self._waits(me, leader and leader.id)
            leader = me if me.distance >= 0.0 else None

    def _waits(self, me: Observed, leader: int | None) -> Reason:
        """Why a vehicle has no passage."""
        slot = self._possible(me, leader)
        if slot is None or slot.hard:
            return Reason("no passage", me.id)
        others = tuple(it.vehicle for it in self.manager.misfits(slot, last=True))
        return Reason("no passage" if others else "looks again", me.id, others)

    def _possible(self, me: Observed, leader: int | None) -> Slot | None:
        """The passage that a vehicle asks for now."""
        return self._predict(me, self._now, leader)

    def _permit(self, vehicle: int) -> Command:
        """The command that gives a new holder the right of way."""
        return Go(vehicle)

    def _revoke(self, seen: dict[int, Observed], ahead: dict[int, int], now: int) -> Iterator[int]:
        """Renew outdated reservations; return the ids of vehicles that lose theirs.

        Vehicles that cannot stop come first and always keep theirs. If one of them no longer fits,
        every reservation of a vehicle that can stop is checked again.
        """
        slots = self.manager.slots
        stops = {v: can_stop(seen[v], self._brakes[seen[v].type]) for v in slots if v in seen}
        changed: set[int] = set()
        misfit = False
        for vehicle in sorted(stops, key=stops.__getitem__):
            leader = ahead.get(vehicle)
            slot: Slot | None = slots[vehicle]
            if not slots[vehicle].expects(seen[vehicle], now) or leader in changed:
                changed.add(vehicle)
                slot = self._predict(seen[vehicle], now, leader)
            elif not (misfit and stops[vehicle]):
                continue
            if slot is not None and self.manager.fits(slot, last=False):
                slots[vehicle] = slot
            elif stops[vehicle]:
                changed.add(vehicle)
                del slots[vehicle]
                yield vehicle
            else:
                misfit = True
                slots[vehicle] = slot or slots[vehicle]

    def _predict(self, me: Observed, now: int, leader: int | None) -> Slot | None:
        """A vehicle's passage behind its leader; None behind one without a reservation."""
        if leader is not None and leader not in self.manager.slots:
            return None
        return self.manager.predict(me, now)

    def _grant(self, seen: dict[int, Observed], ahead: dict[int, int], now: int) -> Iterator[int]:
        """Grant what is possible; return the ids of the new holders."""
        slots = self.manager.slots
        for vehicle in list(self._requests):
            slot = self._predict(seen[vehicle], now, ahead.get(vehicle))
            if slot is not None and self.manager.fits(slot, last=True):
                slots[vehicle] = slot
                del self._requests[vehicle]
                yield vehicle
