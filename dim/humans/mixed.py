"""Mixed autonomy: vehicles that follow DIM among human drivers, who take turns.

The junction is an all-way stop: of two in each other's way, the first to come is the first to go
(`dim.humans.queue`). Each knows what was there when it came, so this takes no message. Drivers must
recognise vehicles of DIM, which come without stopping, say by marker lamps (SAE J3134).

A human stops at the hold line and looks at positions, speeds and indicators; it sees no right of
way. After its reaction time it goes as soon as all vehicles that came before it or go already are
out of its way.

A vehicle of DIM that came after a human waits until all that came before it and are in its way,
wherever humans may go, have entered the junction. The others take part in DIM's decisions. While a
human is in the queue or inside the junction, the gate is "harmonious": humans enter while others
cross, too, and those that wait for an empty junction could wait for ever.

No vehicles collide, unless some trust silence (`dim.humans.drivers.TRUSTS`): of a human and another
in its way, the one that came later waits until the first has entered, and then until it is out of
the way. What has not come yet comes later: a human must stand at the line first, and a vehicle of
DIM must be the first of its lane in the yellow zone.

No vehicles wait in a circle, and no vehicle overtakes a human in whose way it is:
`docs/background/safety.md`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from dim.controller import Dim, DimSession
from dim.humans.drivers import TRUSTS, Drivers, Humans, Readings
from dim.humans.queue import Courtesy, Queue
from minisim.control import HALTING, Command, Go, Observed, Plan, Session, Site, View, Wake
from minisim.parameters import declared, part, real, word
from minisim.reasons import Reason

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
        TRUSTS, default="signals",
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
        drivers = self._drivers = Drivers(mixed.share, site.seed)
        readings = Readings(mixed.humans, site, drivers)
        queue = self._queue = Queue(mixed.dim.zones, drivers)
        self._dim = DimSession(mixed.dim, site, self._follows, self._takes)
        rules = self._dim.rules
        exact = mixed.dim.perception.period is None
        self._courtesy = Courtesy(mixed.trust, readings, rules.table.matrix, queue, exact)
        self._rules = rules, replace(rules, gate="harmonious")
        self._people = _People(mixed.humans, site, readings, queue)
        marks = dict.fromkeys((*self._dim.plan.marks, 0.0))  # at the entry another becomes first
        self.plan: Plan = replace(self._dim.plan, marks=tuple(marks))

    def _follows(self, vehicle: Observed) -> bool:
        return not self._queue.is_human(vehicle)

    def _takes(self, view: View, seen: View) -> View:
        return self._courtesy(view, seen)

    def kind(self, lane: int, rank: int) -> str:
        """ "human" or "automated"."""
        return "human" if self._drivers[lane, rank].human else "automated"

    @property
    def counts(self) -> Mapping[str, float]:
        """What wrong perception has done to DIM (`dim.senses.tally`)."""
        return self._dim.counts

    def reasons(self, view: View) -> Mapping[int, Reason]:
        """Why vehicles wait or go (`minisim.reasons.Explaining`)."""
        return {**self._dim.reasons(view), **self._people.reasons(view)}

    def decide(self, view: View) -> Iterable[Command]:
        """Let all vehicles decide, from the same view."""
        self._queue.look(view)
        self._dim.rules = self._rules[self._queue.humans]
        commands = [*self._dim.decide(view), *self._people.decide(view)]
        wakes = [command.time for command in commands if isinstance(command, Wake)]
        others = [command for command in commands if not isinstance(command, Wake)]
        return [*others, Wake(min(wakes))] if wakes else others


class _People:
    """The human drivers of a run."""

    def __init__(self, humans: Humans, site: Site, readings: Readings, queue: Queue) -> None:
        self._humans, self._readings, self._queue = humans, readings, queue
        self._dt = site.dt
        self._standing: dict[int, float] = {}  # vehicle: since when [s]
        self._gone: set[int] = set()
        self._went: dict[int, float] = {}  # lane: when its last driver went [s]

    def decide(self, view: View) -> Iterable[Command]:
        """Let drivers start; ask to be called again while one is at the junction."""
        now, queue, before = view.time, self._queue, self._standing
        self._gone.intersection_update([v.id for v in view.vehicles])
        there = [v for v in view.vehicles if v.distance < 0.0 or v.id in self._gone]
        looking = any(v.id not in self._gone for v in queue.near)
        heads = [v for v in queue.heads.values() if v.id not in self._gone]
        standing = [v.id for v in heads if v.id in queue.people and v.speed <= HALTING]
        self._standing = {i: before.get(i, now) for i in standing}
        commands: list[Command] = []
        for vehicle in heads:
            ready = vehicle.id in self._standing and self._is_ready(vehicle, now)
            if ready and self._is_free(vehicle, there):
                commands.append(Go(vehicle.id))
                self._gone.add(vehicle.id)
                self._went[vehicle.lane] = now
            there.append(vehicle)
        return [*commands, Wake(now + max(LOOK, self._dt))] if looking else commands

    def reasons(self, view: View) -> dict[int, Reason]:
        """Why the drivers at the head of their lanes wait."""
        there = [v for v in view.vehicles if v.distance < 0.0 or v.id in self._gone]
        found = {}
        for me in [v for v in self._queue.heads.values() if v.id not in self._gone]:
            if me.id in self._queue.people:
                found[me.id] = self._reason(me, view.time, there)
            there.append(me)
        return found

    def _reason(self, me: Observed, now: float, there: Iterable[Observed]) -> Reason:
        if me.id not in self._standing:
            return Reason("approaching", me.id)
        if not self._is_ready(me, now):
            return Reason("reaction", me.id, until=self._ready_at(me))
        blocking = self._in_the_way(me, there)
        return Reason("others first" if blocking else "looks again", me.id, blocking)

    def _is_ready(self, vehicle: Observed, now: float) -> bool:
        """Whether the reaction and follow-up times are over, to within half a step."""
        return now + self._dt / 2.0 >= self._ready_at(vehicle)

    def _ready_at(self, vehicle: Observed) -> float:
        """When the reaction and follow-up times are over [s]."""
        humans, turn = self._humans, self._readings.turns[self._readings.index(vehicle)]
        looked = self._standing[vehicle.id] + humans.reaction
        return max(looked, self._went.get(vehicle.lane, -math.inf) + humans.follow_up[turn])

    def _is_free(self, vehicle: Observed, there: Iterable[Observed]) -> bool:
        """Whether all vehicles that came earlier or cross are out of a driver's way."""
        return not self._in_the_way(vehicle, there)

    def _in_the_way(self, vehicle: Observed, there: Iterable[Observed]) -> tuple[int, ...]:
        """Those vehicles that came earlier or cross and are in a driver's way."""
        own = (self._readings.index(vehicle),)
        trust = self._humans.trust
        return tuple(it.id for it in there if self._readings.blocks(it, own, trust))
