"""Mixed autonomy: vehicles that follow DIM among human drivers.

DIM yields. A human in the yellow zone may start at any time, so it counts as crossing: nobody who
follows DIM is let in beside it, but in harmony with all it may do. A human stops at the hold line
as at an all-way stop (the junction of equal roads), looks, and goes when

- every human who stopped before it and is in its way has gone,
- every vehicle inside has left its way,
- no vehicle of DIM rolls through its yellow zone, and none will arrive within the critical gap,

as soon as it has stood for its reaction time, for it foresees when a way becomes free. It sees
positions, speeds and indicators, never a right of way.

Nobody collides, if nobody believes in silence (`dim.humans.drivers.TRUSTS`): when a human starts,
vehicles of DIM that are in conflict with it stand, or are outside the yellow zone, and no rule
gives them the right of way until it has left. One that stands has none: it would have moved off in
the step after it was granted one, with the junction empty, before a driver can look.

Nobody waits for another in a circle: DIM waits for humans, and no human waits for a vehicle of DIM
that stands. So drivers must know such vehicles when they see them, as marker lamps for automated
driving intend (SAE J3134); otherwise each would let the other go first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from dim.controller import Dim, DimSession
from dim.humans.drivers import TRUSTS, Drivers, Humans, Readings
from dim.perception import ROUNDING, UNKNOWN, Perception, See
from minisim.control import Command, Go, Observed, Plan, Session, Site, View, Wake
from minisim.errors import choice, instance, number
from minisim.junction.conflicts import clearing_distances
from minisim.junction.movements import Bools, Movements

#: Slower than this a vehicle stands [m/s]: SUMO's limit of waiting.
STANDING = 0.1
#: A driver stands at the line when its front is at most this far before it [m].
LINE = 1.0
#: How often a driver at the junction looks at the others [s].
LOOK = 0.2


@dataclass(frozen=True)
class Mixed:
    """DIM with a share of human drivers.

    Attributes:
        dim: the rules of all others. `Dim(commit="paper")` is not safe here either.
        share: of humans among the vehicles, 0 … 1. At 0 runs are those of `dim`.
        humans: how they drive.
        trust: what vehicles of DIM believe of a human's way, see `dim.humans.drivers.TRUSTS`.

    Raises:
        InputError: no share, or an unknown trust.
    """

    dim: Dim = field(default_factory=Dim)
    share: float = 0.2
    humans: Humans = field(default_factory=Humans)
    trust: str = "motion"

    def __post_init__(self) -> None:
        instance("dim", self.dim, Dim)
        number("share of humans", self.share, low=0, high=1)
        instance("humans", self.humans, Humans)
        choice("trust", self.trust, TRUSTS)

    @property
    def name(self) -> str:
        """DIM's, and the share: `dim-humans-0.2`."""
        return f"{self.dim.name}-humans-{self.share:g}"

    def start(self, site: Site) -> Session:
        """Begin a run; raises `InputError` as `Dim.start` does."""
        return MixedSession(self, site) if self.share else self.dim.start(site)

    def human(self, seed: int, count: int) -> Bools:
        """Which of the first `count` vehicles of the run with this `seed` are human.

        Vehicles count in the order of their demand times, as in a trip table; shape (count,).
        """
        return Drivers(self.humans, self.share, seed).human(count)


class MixedSession:
    """One run: a session of DIM for some vehicles, and the humans."""

    def __init__(self, mixed: Mixed, site: Site) -> None:
        drivers = self._drivers = Drivers(mixed.humans, mixed.share, site.seed)
        cautious, take = _Cautious(mixed.dim.perception, mixed), _caution(mixed, site)
        self._dim = DimSession(
            replace(mixed.dim, perception=cautious),
            site,
            lambda id: not drivers[id].human,
            truth=lambda view: take(view, view),
        )
        self._humans = _Humans(mixed, site, drivers)
        plan = self._dim.plan
        self.plan: Plan = replace(
            plan,
            marks=tuple(dict.fromkeys((*plan.marks, 0.0))),  # at the entry another comes first
            sight=max(plan.sight, self._humans.sight),
        )

    def kind(self, vehicle: int) -> str:
        """ "human" or "automated"."""
        return "human" if self._drivers[vehicle].human else "automated"

    @property
    def counts(self) -> Mapping[str, float]:
        """What wrong perception did to the vehicles of DIM (`dim.senses.tally`)."""
        return self._dim.counts

    def decide(self, view: View) -> Iterable[Command]:
        """Let all vehicles decide, from the same view."""
        commands = [*self._dim.decide(view), *self._humans.decide(view)]
        wakes = [command.time for command in commands if isinstance(command, Wake)]
        others = [command for command in commands if not isinstance(command, Wake)]
        return [*others, Wake(min(wakes))] if wakes else others


@dataclass(frozen=True)
class _Cautious:
    """What vehicles of DIM see, with humans as they take them.

    Attributes:
        perception: what they see at all.
        mixed: what they believe.
    """

    perception: Perception
    mixed: Mixed

    @property
    def period(self) -> float | None:
        """That of what they see at all; the humans ask for more views while they are there."""
        return self.perception.period

    def start(self, site: Site) -> See:
        """Begin a run."""
        see_all, take = self.perception.start(site), _caution(self.mixed, site)
        return lambda view, ego: take(view, see_all(view, ego))


def _caution(mixed: Mixed, site: Site) -> Callable[[View, View], View]:
    """What a view, and what a vehicle has seen of it, are taken for."""
    drivers = Drivers(mixed.humans, mixed.share, site.seed)
    readings, movements = Readings(mixed.humans, site, drivers), site.intersection.movements
    start = mixed.dim.zones.yellow_start + ROUNDING
    latest: list[View] = []  # what was seen last, and what it was taken for

    def take(view: View, seen: View) -> View:
        if not latest or latest[0] is not seen:
            ways = {
                v.id: readings.possible(v, mixed.trust)
                for v in view.vehicles
                if v.distance <= start and drivers[v.id].human
            }
            taken = tuple(_taken(seen, ways, drivers, start, movements))
            latest[:] = [seen, View(seen.time, taken)]
        return latest[1]

    return take


def _taken(
    view: View,
    ways: Mapping[int, list[int]],
    drivers: Drivers,
    start: float,
    movements: Movements,
) -> Iterable[Observed]:
    """The vehicles of a view as DIM takes them.

    The first human of a lane, from the yellow zone on, is taken for one that cannot stop before
    the junction any more. `ways` are the movements that those may take who are there.
    """
    lane = -1
    for vehicle in view.vehicles:
        first = vehicle.distance >= 0.0 and vehicle.lane != lane
        if first:
            lane = vehicle.lane
        if vehicle.distance <= start and drivers[vehicle.id].human:
            possible = ways.get(vehicle.id, ())
            manoeuvre = movements[possible[0]].manoeuvre if len(possible) == 1 else UNKNOWN
            vehicle = vehicle._replace(manoeuvre=manoeuvre)
            if first:
                vehicle = vehicle._replace(distance=0.0, speed=1.0)
        yield vehicle


class _Humans:
    """The human drivers of a run: who stands since when, and who went.

    Attributes:
        sight: how far before the junction they look [m].
    """

    def __init__(self, mixed: Mixed, site: Site, drivers: Drivers) -> None:
        humans, zones = mixed.humans, mixed.dim.zones
        self._humans, self._drivers = humans, drivers
        self._readings = Readings(humans, site, drivers)
        self._clearing = clearing_distances(site.intersection, site.vehicle).tolist()
        self._line = zones.hold_distance + LINE
        self._yellow = zones.yellow_start + ROUNDING
        self._dt = site.dt
        longest = max(humans.critical_gaps) * (1.0 + 3.0 * humans.deviation)
        self.sight = longest * site.speed_limit
        self._standing: dict[int, float] = {}  # vehicle: since [s]
        self._gone: set[int] = set()
        self._went: dict[int, float] = {}  # lane: when its last driver went [s]

    def decide(self, view: View) -> Iterable[Command]:
        """Who starts now; asks to be called again while somebody is at the junction."""
        now, drivers = view.time, self._drivers
        self._gone.intersection_update([v.id for v in view.vehicles])
        crossing = [v for v in view.vehicles if v.distance < 0.0 or v.id in self._gone]
        heads: dict[int, Observed] = {}
        for vehicle in view.vehicles:  # front to back
            if vehicle.distance >= 0.0 and vehicle.id not in self._gone:
                heads.setdefault(vehicle.lane, vehicle)
        here = [v for v in heads.values() if drivers[v.id].human and v.distance <= self._yellow]
        rolling = [v for v in heads.values() if v.speed > STANDING and not drivers[v.id].human]
        before = self._standing
        self._standing = {
            v.id: before.get(v.id, now)
            for v in here
            if v.speed <= STANDING and v.distance <= self._line
        }
        queue = [v for v in here if v.id in self._standing]
        queue.sort(key=lambda v: (self._standing[v.id], v.lane))
        commands: list[Command] = []
        waiting: list[Observed] = []
        for vehicle in queue:
            free = self._is_free(vehicle, waiting, crossing, rolling)
            if free and self._is_ready(vehicle, now):
                commands.append(Go(vehicle.id))
                self._gone.add(vehicle.id)
                self._went[vehicle.lane] = now
                crossing.append(vehicle)
            else:
                waiting.append(vehicle)
        return [*commands, Wake(now + max(LOOK, self._dt))] if here else commands

    def _is_ready(self, vehicle: Observed, now: float) -> bool:
        """Whether a driver has looked, and followed no sooner than it can; half a step early."""
        humans, turn = self._humans, self._readings.turns[self._readings.index(vehicle)]
        looked = self._standing[vehicle.id] + humans.reaction
        followed = self._went.get(vehicle.lane, -math.inf) + humans.follow_up[turn]
        return now + self._dt / 2.0 >= max(looked, followed)

    def _is_free(
        self,
        vehicle: Observed,
        waiting: Iterable[Observed],
        crossing: Iterable[Observed],
        rolling: Iterable[Observed],
    ) -> bool:
        """Whether nobody is, or comes too soon, in the way of a driver at the line."""
        own = self._readings.index(vehicle)
        gap = self._drivers[vehicle.id].gap * self._humans.critical_gaps[self._readings.turns[own]]
        comes = [v for v in rolling if v.distance <= max(self._yellow, gap * v.speed)]
        clearing = self._clearing[own]
        trust = self._humans.trust
        # The distances are minus infinity where ways do not conflict.
        return not any(
            clearing[way] + min(other.distance, 0.0) > 0.0
            for other in (*waiting, *crossing, *comes)
            for way in self._readings.possible(other, trust)
        )
