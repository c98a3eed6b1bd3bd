"""Space-time reservation, first come first served, on pairwise conflict zones.

Source: Dresner, Stone, JAIR 31 (2008), 591–656. A vehicle asks the manager of the junction for a
passage. The manager predicts how the vehicle would drive, and grants the passage if the space it
needs is free at the time. Dresner and Stone use a grid of tiles. We use the conflict zones of the
movements (`minisim.junction.conflicts`): only pairs matter, and each pair's stretches are exact.

The protocol:
- From `reach` before the junction on, the first vehicle of a lane asks, and so does any vehicle
  directly behind a holder. Its passage is predicted at full acceleration up to the limits
  (`baselines.prediction`), behind the vehicle ahead in its lane and behind the last vehicle that
  enters its exit lane before it.
- The passage is granted if, for every other holder in conflict, one of the two has left its zone
  `buffer` seconds before the other enters its own. Holders enter a shared exit lane in the order of
  their grants, so a later grant never slows down an earlier one.
- A refused vehicle drives up to its stop line and slows down as late as is comfortable. Refused
  requests are considered again every `period`, in the order in which they were first made.

Safety does not depend on predictions far ahead. Every `period` the manager compares holders with
their predictions, and predicts anew where they differ. A holder whose new passage no longer fits
loses its reservation if it can still stop, and so does a vehicle that follows it. So when a vehicle
can no longer stop, its passage fits the passages of all others that cannot, and the rest yield.
What remains is the error of a prediction over the last few seconds before the zones, from a state
at most one period old. `buffer` covers it. In minisim this error is small: up to 0.15 m beyond the
point of no return (4 arms, 350 veh/h/lane), due to leaders other than the two in a prediction.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from baselines.prediction import NO_LEADER, Floats, Following, Leader, courses, predict
from minisim.control import (
    Command,
    Go,
    Hold,
    Observed,
    Plan,
    Site,
    View,
    Wake,
    can_stop,
    stopping_distance,
)
from minisim.errors import InputError
from minisim.junction.conflicts import conflict_zones
from minisim.junction.partings import branch
from minisim.names import Name
from minisim.parameters import declared, real
from minisim.vehicle import CruiseVehicle

#: Smaller differences from the prediction do not count [m], [m/s].
POSITION_TOLERANCE, SPEED_TOLERANCE = 0.05, 0.05

#: How far past the junction exit a rear is predicted, for the vehicles behind it [m].
BEYOND = 60.0


@declared
class Reservation:
    """Space-time reservation, first come first served, for vehicles that follow the IDM."""

    name = Name("reservation")

    # Asking earlier lets distant vehicles reserve room that nearer ones need: at 350 veh/h/lane
    # (fair) the mean time loss is 4.1 s at 30 m, 4.7 at 60, 5.3 at 100 and 10.2 at 150.
    reach: float | None = real(
        "how far before the junction vehicles ask; none is the stopping distance at the limit and "
        "a period's way: as late as possible without slowing down for a refusal", "m",
        low=1, high=1000, optional=True, default=None,
    )  # fmt: skip
    # 0.25 s on either side, as at the edge tiles of the AIM4 simulator.
    buffer: float = real(
        "time between one vehicle's leaving a conflict zone and another's entering its own", "s",
        low=0, high=10, default=0.5,
    )  # fmt: skip
    period: float = real(
        "time between two looks at holders and requests", "s", low=0.01, high=10, default=0.5
    )

    def start(self, site: Site) -> ReservationSession:
        """Begin a run; raises `InputError` for vehicles whose motion cannot be predicted."""
        return ReservationSession(self, site)


@dataclass(frozen=True, eq=False)
class Slot:
    """A reservation: how a vehicle will cross."""

    vehicle: int
    movement: int  #: its index
    start: int  #: when the prediction was made [steps]
    s: Floats  #: positions past the entry [m], one per step from `start` on
    v: Floats  #: speeds [m/s]
    enters: int  #: when its front is in the junction [steps]
    #: For each conflicting movement, the last step before and the first step past the zone.
    zones: dict[int, tuple[int, int]]

    @property
    def ends(self) -> int:
        """The last step that is predicted."""
        return self.start + len(self.s) - 1

    def leader(self, now: int, until: float = math.inf, shift: float = 0.0) -> Leader:
        """What a follower meets from `now` [steps] on."""
        return Leader(self.s[now - self.start :], self.v[now - self.start :], until, shift)

    def expects(self, seen: Observed, now: int) -> bool:
        """Whether the vehicle is where it was predicted to be."""
        k = now - self.start
        off, faster = float(self.s[k]) + seen.distance, float(self.v[k]) - seen.speed
        return abs(off) <= POSITION_TOLERANCE and abs(faster) <= SPEED_TOLERANCE


class Manager:
    """Which vehicle holds which reservation, and which are possible; times in host steps."""

    def __init__(self, site: Site, buffer: float) -> None:
        if isinstance(site.vehicle, CruiseVehicle):
            raise InputError(
                "reservation predicts vehicles that follow the IDM, not a CruiseVehicle; "
                "use the profile paper or fair"
            )
        self.slots: dict[int, Slot] = {}  #: by vehicle, in the order of their grants
        self._motion = Following.of(site)
        self._ways = courses(site)
        self._zones: list[dict[int, tuple[float, float]]] = [
            {q: (first, last) for q, (first, last) in enumerate(row) if first == first}
            for row in conflict_zones(site.intersection, site.vehicle).tolist()
        ]
        entry = site.intersection.approach_length
        self._branch = branch(site.intersection, site.vehicle) - entry
        self._rows = site.intersection.movements.rows
        self._buffer = math.ceil(buffer / site.dt - 1e-6)

    def predict(self, seen: Observed, now: int, ahead: Slot | None) -> Slot | None:
        """The passage of a vehicle behind `ahead` in its lane; None if none can be predicted.

        It also drives behind the last other holder to enter the same exit lane.
        """
        p = self._rows[seen.lane][seen.manoeuvre]
        way = self._ways[p]
        lane = NO_LEADER
        if ahead is not None and ahead.ends >= now:
            lane = ahead.leader(now, until=float(self._branch[ahead.movement, p]))
        rival = self._before(way.exit_arm, seen)
        exit_lane = NO_LEADER
        if rival is not None and rival.ends >= now:
            crossing = self._ways[rival.movement].crossing
            exit_lane = rival.leader(now, shift=way.crossing - crossing)
        motion = predict(
            self._motion, way, -seen.distance, seen.speed,
            lane=lane, exit_lane=exit_lane, beyond=BEYOND,
        )  # fmt: skip
        if motion is None:
            return None
        s, v = motion
        return Slot(
            seen.id, p, now, s, v,
            enters=now + int(s.searchsorted(0.0)),
            zones={
                q: (
                    now + int(s.searchsorted(first, side="right")) - 1,
                    now + int(s.searchsorted(last)),
                )
                for q, (first, last) in self._zones[p].items()
            },
        )  # fmt: skip

    def fits(self, slot: Slot, *, last: bool) -> bool:
        """Whether a passage is compatible with every other reservation.

        If it must be the `last`, it comes after all others that share its exit lane.
        """
        exit_arm = self._ways[slot.movement].exit_arm
        for other in self.slots.values():
            if other.vehicle == slot.vehicle or other.movement not in slot.zones:
                continue
            merges = self._ways[other.movement].exit_arm == exit_arm
            before = not (last and merges) and self._clears(slot, other, merges)
            if not before and not self._clears(other, slot, merges):
                return False
        return True

    def _clears(self, first: Slot, second: Slot, merges: bool) -> bool:
        """Whether `first` has passed when `second` comes, and enters a common exit lane first."""
        through = first.zones[second.movement][1] + self._buffer <= second.zones[first.movement][0]
        return through and (not merges or first.enters < second.enters)

    def _before(self, exit_arm: int, seen: Observed) -> Slot | None:
        """The last holder to enter an exit lane, before the vehicle itself if it holds a slot."""
        own = self.slots.get(seen.id)
        latest = math.inf if own is None else own.enters
        slots = [s for s in self.slots.values() if s.vehicle != seen.id and s.enters < latest]
        rivals = [s for s in slots if self._ways[s.movement].exit_arm == exit_arm]
        return max(rivals, key=lambda slot: slot.enters, default=None)


class ReservationSession:
    """One run: keeps reservations in line with what is seen, and serves requests."""

    def __init__(self, controller: Reservation, site: Site) -> None:
        self.manager = Manager(site, controller.buffer)
        reach = controller.reach
        if reach is None:
            braking = stopping_distance(site.speed_limit, site.vehicle.deceleration)
            reach = braking + controller.period * site.speed_limit
        reach = min(reach, site.intersection.approach_length)
        self.plan = Plan(marks=(reach,), sight=reach)
        self._period = controller.period
        self._dt = site.dt
        self._brakes = site.vehicle.deceleration
        self._requests: dict[int, None] = {}  # in the order of first requests

    def decide(self, view: View) -> Iterable[Command]:
        """Check the reservations, then consider the requests in the order in which they came."""
        now = round(view.time / self._dt)
        manager = self.manager
        seen = {vehicle.id: vehicle for vehicle in view.vehicles}
        manager.slots = {v: slot for v, slot in manager.slots.items() if slot.ends >= now}
        ahead = {
            vehicle.id: before.id if before is not None and before.lane == vehicle.lane else None
            for before, vehicle in pairwise((None, *view.vehicles))
            if vehicle is not None
        }
        commands: list[Command] = [Hold(v) for v in self._revoke(seen, ahead, now)]
        for vehicle in seen:
            if vehicle not in manager.slots:
                self._requests.setdefault(vehicle)
        self._requests = {v: None for v in self._requests if v in seen and v not in manager.slots}
        commands += [Go(v) for v in self._grant(seen, ahead, now)]
        if seen:
            commands.append(Wake(view.time + self._period))
        return commands

    def _revoke(
        self, seen: dict[int, Observed], ahead: dict[int, int | None], now: int
    ) -> Iterator[int]:
        """Renew outdated reservations; return the ids of vehicles that lose theirs.

        Vehicles that cannot stop come first and keep their reservation in any case. If one of them
        no longer fits, every reservation of a vehicle that can stop is checked again.
        """
        slots = self.manager.slots
        stops = {v: can_stop(seen[v], self._brakes) for v in slots if v in seen}
        changed: set[int] = set()
        misfit = False
        for vehicle in sorted(stops, key=stops.__getitem__):
            leader = ahead[vehicle]
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
        ahead = None if leader is None else self.manager.slots.get(leader)
        if leader is not None and ahead is None:
            return None
        return self.manager.predict(me, now, ahead)

    def _grant(
        self, seen: dict[int, Observed], ahead: dict[int, int | None], now: int
    ) -> Iterator[int]:
        """Grant what is possible; return the ids of the new holders."""
        slots = self.manager.slots
        for vehicle in list(self._requests):
            slot = self._predict(seen[vehicle], now, ahead[vehicle])
            if slot is not None and self.manager.fits(slot, last=True):
                slots[vehicle] = slot
                del self._requests[vehicle]
                yield vehicle
