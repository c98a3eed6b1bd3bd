"""Mixed autonomy: vehicles that follow DIM among human drivers.

DIM yields. A human in the yellow zone may start at any time, so it counts as crossing: a DIM
vehicle enters only if it is in harmony with everything the human may do. A human stops at the hold
line as at an all-way stop and looks at positions, speeds and indicators; it sees no right of way.
After its reaction time it goes if

- every human that stopped before it and is in its way has gone,
- every vehicle inside is out of its way,
- no DIM vehicle is rolling through its yellow zone, and none arrives within the critical gap.

No vehicles collide, unless some trust silence (`dim.humans.drivers.TRUSTS`). When a human starts,
the DIM vehicles in conflict with it stand or are outside the yellow zone, and get no right of way
until it has left. A standing DIM vehicle has none: with the junction empty, it would have moved off
one step after being granted it, before a driver can look.

No vehicles wait in a circle: DIM waits for humans, and no human waits for a DIM vehicle that
stands. So drivers must recognise DIM vehicles, say by marker lamps for automated driving (SAE
J3134). Otherwise each would let the other go first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from dim.controller import Dim, DimSession
from dim.humans.drivers import TRUSTS, Drivers, Humans, Readings
from dim.perception import ROUNDING, UNKNOWN
from minisim.control import HALTING, Command, Go, Observed, Plan, Session, Site, View, Wake
from minisim.junction.conflicts import clearing_distances
from minisim.junction.movements import Movements
from minisim.parameters import declared, part, real, word

LINE = 1.0  #: a driver stands at the line when its front is at most this far before it [m]
LOOK = 0.2  #: how often a driver at the junction looks at the others [s]


@declared
class Mixed:
    """DIM with a share of human drivers. `Dim(commit="paper")` is not safe here either."""

    dim: Dim = part("the rules of all others", Dim, default=Dim())
    share: float = real(
        "share of humans among the vehicles; at 0 runs are those of `dim`",
        low=0, high=1, default=0.2, label="share of humans",
    )  # fmt: skip
    humans: Humans = part("how they drive", Humans, default=Humans())
    trust: str = word(
        "what vehicles of DIM believe about a human's way, as in `Humans.trust`",
        TRUSTS, default="motion",
    )  # fmt: skip

    @property
    def name(self) -> str:
        """The name of its DIM, and the share: `dim+humans=0.2`."""
        return f"{self.dim.name}+humans={self.share:g}"

    def start(self, site: Site) -> Session:
        """Begin a run; raises `InputError` as `Dim.start` does."""
        return MixedSession(self, site) if self.share else self.dim.start(site)


class MixedSession:
    """One run: a session of DIM for some vehicles, and the humans."""

    def __init__(self, mixed: Mixed, site: Site) -> None:
        drivers = self._drivers = Drivers(mixed.humans, mixed.share, site.seed)
        readings = Readings(mixed.humans, site, drivers)
        takes = _caution(mixed, site, readings)
        self._dim = DimSession(mixed.dim, site, lambda v: not drivers[v.lane, v.rank].human, takes)
        self._humans = _Humans(mixed, site, readings)
        plan = self._dim.plan
        self.plan: Plan = replace(
            plan,
            marks=tuple(dict.fromkeys((*plan.marks, 0.0))),  # at the entry another becomes first
            sight=min(max(plan.sight, self._humans.sight), site.intersection.approach_length),
        )

    def kind(self, lane: int, rank: int) -> str:
        """ "human" or "automated"."""
        return "human" if self._drivers[lane, rank].human else "automated"

    @property
    def counts(self) -> Mapping[str, float]:
        """What wrong perception has done to DIM (`dim.senses.tally`)."""
        return self._dim.counts

    def decide(self, view: View) -> Iterable[Command]:
        """Let all vehicles decide, from the same view."""
        commands = [*self._dim.decide(view), *self._humans.decide(view)]
        wakes = [command.time for command in commands if isinstance(command, Wake)]
        others = [command for command in commands if not isinstance(command, Wake)]
        return [*others, Wake(min(wakes))] if wakes else others


def _caution(mixed: Mixed, site: Site, readings: Readings) -> Callable[[View, View], View]:
    """How a DIM vehicle interprets what it has seen of a true view."""
    drivers, movements = readings.drivers, site.intersection.movements
    start = mixed.dim.zones.yellow_start + ROUNDING
    latest: list[View] = []  # what was seen last, and how it was interpreted

    def take(view: View, seen: View) -> View:
        if not latest or latest[0] is not seen:
            ways = {
                v.id: readings.possible(v, mixed.trust)
                for v in view.vehicles
                if v.distance <= start and drivers[v.lane, v.rank].human
            }
            taken = tuple(_taken(seen, ways, drivers, start, movements))
            latest[:] = [seen, View(seen.time, taken)]
        return latest[1]

    return take


def _taken(
    view: View, ways: Mapping[int, list[int]], drivers: Drivers, start: float, movements: Movements
) -> Iterable[Observed]:
    """The vehicles of a view as DIM interprets them.

    A human at the front of a lane, from the yellow zone on, is treated as a vehicle that can no
    longer stop before the junction. `ways` are the movements that each human there may take.
    """
    lane = -1
    for vehicle in view.vehicles:
        first = vehicle.distance >= 0.0 and vehicle.lane != lane
        if first:
            lane = vehicle.lane
        if vehicle.distance <= start and drivers[vehicle.lane, vehicle.rank].human:
            possible = ways.get(vehicle.id, ())
            manoeuvre = movements[possible[0]].manoeuvre if len(possible) == 1 else UNKNOWN
            vehicle = vehicle._replace(manoeuvre=manoeuvre)
            if first:
                vehicle = vehicle._replace(distance=0.0, speed=1.0)
        yield vehicle


class _Humans:
    """The human drivers of a run; they see the last `sight` [m] before the junction."""

    def __init__(self, mixed: Mixed, site: Site, readings: Readings) -> None:
        humans, zones = mixed.humans, mixed.dim.zones
        self._humans, self._drivers, self._readings = humans, readings.drivers, readings
        self._clearing = [
            clearing_distances(site.intersection, it, site.fleet).tolist() for it in site.types
        ]
        self._line = zones.green + LINE
        self._yellow = zones.yellow_start + ROUNDING
        self._dt = site.dt
        longest = max(humans.critical_gaps) * (1.0 + 3.0 * humans.deviation)
        self.sight = longest * site.speed_limit
        self._standing: dict[int, float] = {}  # vehicle: since when [s]
        self._gone: set[int] = set()
        self._went: dict[int, float] = {}  # lane: when its last driver went [s]

    def decide(self, view: View) -> Iterable[Command]:
        """Let drivers start; ask to be called again while one is at the junction."""
        now, drivers = view.time, self._drivers
        self._gone.intersection_update([v.id for v in view.vehicles])
        crossing = [v for v in view.vehicles if v.distance < 0.0 or v.id in self._gone]
        heads: dict[int, Observed] = {}
        for vehicle in view.vehicles:  # front to back
            if vehicle.distance >= 0.0 and vehicle.id not in self._gone:
                heads.setdefault(vehicle.lane, vehicle)
        people = [v for v in heads.values() if drivers[v.lane, v.rank].human]
        here = [v for v in people if v.distance <= self._yellow]
        rolling = [v for v in heads.values() if v.speed > HALTING and v not in people]
        before = self._standing
        self._standing = {
            v.id: before.get(v.id, now)
            for v in here
            if v.speed <= HALTING and v.distance <= self._line
        }
        queue = [v for v in here if v.id in self._standing]
        queue.sort(key=lambda v: (self._standing[v.id], v.lane))
        commands: list[Command] = []
        waiting: list[Observed] = []
        for vehicle in queue:
            free = self._is_free(vehicle, (*waiting, *crossing), rolling)
            if free and self._is_ready(vehicle, now):
                commands.append(Go(vehicle.id))
                self._gone.add(vehicle.id)
                self._went[vehicle.lane] = now
                crossing.append(vehicle)
            else:
                waiting.append(vehicle)
        return [*commands, Wake(now + max(LOOK, self._dt))] if here else commands

    def _is_ready(self, vehicle: Observed, now: float) -> bool:
        """Whether the reaction and follow-up times are over, to within half a step."""
        humans, turn = self._humans, self._readings.turns[self._readings.index(vehicle)]
        looked = self._standing[vehicle.id] + humans.reaction
        followed = self._went.get(vehicle.lane, -math.inf) + humans.follow_up[turn]
        return now + self._dt / 2.0 >= max(looked, followed)

    def _is_free(
        self, vehicle: Observed, there: Iterable[Observed], rolling: Iterable[Observed]
    ) -> bool:
        """Whether no vehicle is in the way of a driver at the line, or comes too soon."""
        own = self._readings.index(vehicle)
        mean_gap = self._humans.critical_gaps[self._readings.turns[own]]
        gap = self._drivers[vehicle.lane, vehicle.rank].gap * mean_gap
        comes = [v for v in rolling if v.distance <= max(self._yellow, gap * v.speed)]
        trust = self._humans.trust
        # The distances are minus infinity where ways do not conflict.
        return not any(
            self._clearing[other.type][own][way] + min(other.distance, 0.0) > 0.0
            for other in (*there, *comes)
            for way in self._readings.possible(other, trust)
        )
