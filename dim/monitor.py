"""The safety monitor: a vehicle's last resort when others do not do what it thinks they intend.

The decision protects vehicles that read the others' intents correctly. A monitor does not decide.
It uses what its vehicle sees, and watches the others that cross or can no longer stop:

- *What another may do*: the intent that was read, as long as the motion does not contradict it.
  If the other leaves every path of that reading, or was read differently before, it may do whatever
  its position still allows.
- *Where it matters*: in the forbidden region of the two paths (`minisim.junction.coordination`).
  The ego must be able to stop before that region, unless it leaves the region in good time.
- *When it brakes*: as soon as stopping takes at least comfortable braking, and as hard as needed.
  If it is too late to stop, it brakes unless only going on avoids a touch.

Vehicles that cross by unanimous decisions are in harmony (proved in `dim.proofs.protocol`). So with
exact perception and `commit="stoppable"` a monitor never brakes, and a run is the same without it.

Two vehicles must not brake for each other for ever. Of two that stand, the one further in goes
first (if equal, the one from the first lane), unless the other is in its way. Both see which it is.

Vehicles before the junction must not wait for each other for ever. If they misread each other, each
may conclude that it is not its turn. But some vehicle always has the right of way. So if no vehicle
crosses and all have stood for a while, the first lane goes alone (`Patience`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from dim.harmony import HarmonyMatrix
from dim.perception import UNKNOWN
from minisim.control import (
    HALTING,
    Brake,
    Command,
    Observed,
    Site,
    View,
    can_stop,
    stopping_distance,
)
from minisim.junction.coordination import Region, passes, region
from minisim.junction.partings import showing
from minisim.parameters import declared, real
from minisim.reasons import Reason
from minisim.vehicle import VehicleType

ROOM = 0.25  #: the gap that a stopping vehicle leaves before the place where it must not be [m]


@declared
class Monitor:
    """A last resort for every vehicle, in addition to its decisions."""

    # A shorter post-encroachment time is critical (Várhelyi, AAP 30(6), 1998).
    time_margin: float = real(
        "least time between leaving a conflict area and another's entering it", "s",
        default=1.0, low=0, high=10,
    )  # fmt: skip
    # Used where it is too late to stop; longer than a vehicle at 20 km/h takes to cross.
    look_ahead: float = real("how far motion is predicted", "s", default=4.0, low=0.5, high=30)
    # The lateral error of automated driving on local streets must stay below 0.29 m (Reid et al.,
    # "Localization requirements for autonomous vehicles", SAE Int. J. CAV 2(3), 2019).
    tolerance: float = real(
        "how far beside a path a vehicle may seem to be while it is on it", "m",
        default=0.3, above=0, high=1,
    )  # fmt: skip
    # Less than 1 m/s² is no braking even on ice.
    deceleration: float | None = real(
        "how hard it brakes at most; none means what the brakes can", "m/s²",
        low=1, high=1000, optional=True, default=None, label="deceleration of the monitor",
    )  # fmt: skip
    # At an all-way stop, SUMO recommends 1 … 2 s between two vehicles (`jmAllwayStopWait`).
    patience: float = real(
        "how long all that take part stand before the first of them goes alone", "s",
        default=2.0, low=0.5, high=60,
    )  # fmt: skip

    def start(self, site: Site, matrix: HarmonyMatrix, sight: float) -> Monitors:
        """Begin a run; vehicles take part from `sight` [m] before the junction on."""
        return Monitors(self, site, matrix, sight)


class Monitors:
    """The monitors of all vehicles in one run; each uses what its own vehicle sees."""

    def __init__(self, monitor: Monitor, site: Site, matrix: HarmonyMatrix, sight: float) -> None:
        brakes = [it.deceleration for it in site.types]
        self.patience = Patience(monitor.patience, sight, brakes)
        self.needed = False  #: whether one might get in another's way before the next wake-up
        self._margin = monitor.time_margin
        self._site, self._rows = site, site.intersection.movements.rows
        self._conflict = ~matrix.values
        self._shows = showing(site.intersection, monitor.tolerance)
        self._times = np.arange(0.0, monitor.look_ahead, site.dt)
        self._a, self._b = [it.acceleration for it in site.types], brakes
        asked = monitor.deceleration or math.inf
        self._b_max = [min(asked, it.max_deceleration) for it in site.types]
        self._readings: dict[tuple[int, int], set[int]] = {}
        self._braking: dict[int, float] = {}
        self._for: dict[int, int] = {}  # the vehicle for which each brakes the hardest

    def reasons(self) -> dict[int, Reason]:
        """Of each vehicle that brakes, for which other one."""
        return {ego: Reason("monitor", ego, (other,)) for ego, other in self._for.items()}

    def look(self, view: View, seen: Mapping[int, View], going: set[int]) -> Iterator[Command]:
        """Which vehicles have to brake, and how hard.

        Only positions and speeds of the others are taken from `view`, the true one. `seen` is what
        each deciding vehicle sees; those in `going` have the right of way.
        """
        crossing = [v for v in view.vehicles if _crosses(v, self._b)]
        going = going | {v.id for v in crossing}
        egos = [v for v in view.vehicles if v.id in seen and v.id in going]
        waiting = self.patience.remember(seen.keys())
        self.needed = waiting or len({v.lane for v in (*crossing, *egos)}) > 1
        before, self._readings = self._readings, {}
        braking: dict[int, float] = {}
        self._for = {}
        for ego in egos:
            read = {v.id: v.manoeuvre for v in seen[ego.id].vehicles}
            for other in crossing:
                if other.lane == ego.lane or other.id not in read:
                    continue
                key = ego.id, other.id
                readings = self._readings[key] = before.get(key, set()) | {read[other.id]}
                asked = self._asked(ego, other, readings)
                if asked > braking.get(ego.id, 0.0):
                    braking[ego.id], self._for[ego.id] = asked, other.id
        for vehicle, *_ in view.vehicles:
            asked = braking.get(vehicle, 0.0)
            if asked != self._braking.get(vehicle, 0.0):
                yield Brake(vehicle, asked)
        self._braking = braking

    def _asked(self, ego: Observed, other: Observed, readings: set[int]) -> float:
        """How hard the ego must brake for another, whatever it does [m/s²]; 0 if not at all."""
        mine = self._rows[ego.lane][ego.manoeuvre]
        foes = (k for k in self._possible(other, readings) if self._conflict[mine, k])
        return max((self._asked_by(ego, mine, other, theirs) for theirs in foes), default=0.0)

    def _possible(self, other: Observed, readings: set[int]) -> list[int]:
        """The movements that another may take, by index."""
        row = self._rows[other.lane]
        shown = self._shows[row[other.manoeuvre]]
        allowed = [k for k in row[1:] if -other.distance < shown[k]]
        certain = len(readings) == 1 and UNKNOWN not in readings
        return [k for k in allowed if certain and k in {row[r] for r in readings}] or allowed

    def _asked_by(self, ego: Observed, mine: int, other: Observed, theirs: int) -> float:
        junction, one, its = self._site.intersection, *self._types_of(ego, other)
        shared = region(junction, one, mine, theirs, its)
        mirrored = region(junction, its, theirs, mine, one)
        if shared is None or mirrored is None:
            return 0.0
        x, y = -ego.distance, -other.distance
        room = shared.room(x, y)
        if room == math.inf:
            return 0.0
        first = (ego.distance, ego.lane) < (other.distance, other.lane)
        if other.speed < HALTING and self._open(mine, x, ego, other):
            stuck = not self._open(theirs, y, other, ego)  # the other, as long as the ego stands
            if first or stuck:
                return 0.0
        if self._goes_first(ego, other, shared, mirrored):
            return 0.0
        if not first and stopping_distance(ego.speed, self._b_max[ego.type]) + ROOM <= ego.distance:
            room = min(room, ego.distance)  # where it blocks no vehicle clearing the junction
        return self._braking_for(ego, other, room - ROOM, shared)

    def _open(self, mine: int, x: float, ego: Observed, other: Observed) -> bool:
        """Whether the ego's way is free as long as the other stands where it is."""
        body = self._rows[other.lane][other.manoeuvre]  # a path that it is on
        one, its = self._types_of(ego, other)
        return passes(self._site.intersection, one, mine, x, body, -other.distance, its)

    def _types_of(self, ego: Observed, other: Observed) -> tuple[VehicleType, VehicleType]:
        return self._site.types[ego.type], self._site.types[other.type]

    def _goes_first(self, ego: Observed, other: Observed, shared: Region, mirrored: Region) -> bool:
        """Whether the ego, at its present speed, leaves the region well before the other comes."""
        if ego.speed < HALTING:
            return False
        leaves = (shared.ends(-other.distance) + ego.distance) / ego.speed
        ahead = mirrored.room(-other.distance, -ego.distance)
        v, a = other.speed, self._a[other.type]
        comes = (math.sqrt(v * v + 2.0 * a * ahead) - v) / a
        return leaves + self._margin < comes

    def _braking_for(self, ego: Observed, other: Observed, room: float, shared: Region) -> float:
        v, a, dt = ego.speed, self._a[ego.type], self._site.dt
        b_max = self._b_max[ego.type]
        gentle = min(self._b[ego.type], b_max)
        after = v + a * dt
        left = room - (v + after) / 2.0 * dt
        if left > 0.0 and after * after <= 2.0 * gentle * left:
            return 0.0
        if room > 0.0 and v * v <= 2.0 * b_max * room:
            return max(gentle, v * v / (2.0 * room))
        brakes = self._touches(ego, -b_max, other, shared)
        return 0.0 if brakes and not self._touches(ego, a, other, shared) else b_max

    def _touches(self, ego: Observed, acceleration: float, other: Observed, shared: Region) -> bool:
        """Whether the two come too close if the other goes on as it does."""
        t = self._times
        stops = ego.speed / -acceleration if acceleration < 0.0 else math.inf
        driven = np.minimum(t, stops)
        mine = ego.speed * driven + acceleration * driven * driven / 2.0
        return shared.touches(mine - ego.distance, other.speed * t - other.distance)


class Patience:
    """Ends a deadlock: after all have stood for some `time` [s], the first goes alone."""

    def __init__(self, time: float, sight: float, brakes: Sequence[float]) -> None:
        self._time, self._sight, self._brakes = time, sight, brakes
        self._since: dict[int, float] = {}
        self._alone: set[int] = set()

    def goes(self, view: View, seen: View, ego: Observed, may: bool, ranks: Sequence[int]) -> bool:
        """Whether it goes, because it `may` or alone; of the true `view` it uses only motion."""
        alone = ego.id in self._alone
        if not alone and (may or ego.speed >= HALTING):
            self._since.pop(ego.id, None)
            return may
        ids = {v.id for v in seen.vehicles}
        near = [v for v in view.vehicles if v.id in ids and v.distance <= self._sight]
        free = not any(_crosses(v, self._brakes) for v in near if v.id != ego.id)
        if alone:
            if free or _crosses(ego, self._brakes):
                return True
            self._alone.discard(ego.id)
            return False
        fronts = {v.lane: v for v in reversed(near) if v.distance >= 0.0}
        stuck = free and all(v.speed < HALTING for v in fronts.values())
        if not stuck or fronts.get(ego.lane) != ego:
            self._since.pop(ego.id, None)
            return False
        since = self._since.setdefault(ego.id, view.time)
        if view.time < since + self._time or min(fronts, key=ranks.__getitem__) != ego.lane:
            return False
        del self._since[ego.id]
        self._alone.add(ego.id)
        return True

    def remember(self, here: Collection[int]) -> bool:
        """Forget all vehicles but these; return whether any of them is waiting."""
        self._alone.intersection_update(here)
        self._since = {vehicle: since for vehicle, since in self._since.items() if vehicle in here}
        return bool(self._since)


def _crosses(vehicle: Observed, brakes: Sequence[float]) -> bool:
    return vehicle.distance < 0.0 or not can_stop(vehicle, brakes[vehicle.type])
