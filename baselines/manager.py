"""Which passages through a junction are free: those that meet no other in space and time.

A passage is how a vehicle will cross, predicted by its own law (`baselines.prediction`). Two in
conflict fit if one has left its zone (`minisim.junction.conflicts`) a buffer of time before the
other comes to its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from baselines.prediction import Floats, Leader, courses, law_of, predict
from minisim.control import Observed, Site
from minisim.junction.conflicts import conflict_zones
from minisim.junction.partings import branch
from minisim.laws import Traits, traits_of

#: Smaller differences from the prediction do not count [m], [m/s].
POSITION_TOLERANCE, SPEED_TOLERANCE = 0.05, 0.05


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
        self, seen: Observed, now: int, held: int = 0, without: Collection[int] = (),
        advice: float = math.inf,
    ) -> Slot | None:  # fmt: skip
        """A vehicle's passage behind the holders ahead of it in both lanes; None if it hits one.

        It may drive on after `held` steps, and keeps to an advised speed [m/s] until then; holders
        in `without` do not enter its exit lane.
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
            held=held, advice=advice,
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
