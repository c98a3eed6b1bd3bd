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
from collections.abc import Iterable, Mapping
from dataclasses import replace

from dim.controller import Dim, DimSession
from dim.humans.drivers import TRUSTS, Drivers, Humans, Readings
from dim.humans.queue import Courtesy, Queue
from dim.perception import ROUNDING
from minisim.control import HALTING, Command, Go, Observed, Plan, Session, Site, View, Wake
from minisim.junction.conflicts import clearing_distances
from minisim.parameters import declared, part, real, word

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
        self._queue, self._gate = Queue(mixed.dim.zones, drivers), mixed.dim.gate
        self._dim = DimSession(
            mixed.dim, site, lambda v: not self._queue.is_human(v), lambda *it: courtesy(*it)
        )
        courtesy = Courtesy(__import__("os").environ.get("TRUST", mixed.trust), readings, self._dim.rules.table.matrix, self._queue)
        self._humans = _Humans(mixed, site, readings, self._queue)
        plan = self._dim.plan
        marks = dict.fromkeys((*plan.marks, 0.0))  # at the entry another becomes first
        self.plan: Plan = replace(plan, marks=tuple(marks))

    def kind(self, lane: int, rank: int) -> str:
        """ "human" or "automated"."""
        return "human" if self._drivers[lane, rank].human else "automated"

    @property
    def counts(self) -> Mapping[str, float]:
        """What wrong perception has done to DIM (`dim.senses.tally`)."""
        return self._dim.counts

    def decide(self, view: View) -> Iterable[Command]:
        """Let all vehicles decide, from the same view."""
        self._queue.look(view)
        self._dim.gate = "harmonious" if self._queue.people or any(v.distance < 0.0 and self._queue.is_human(v) for v in view.vehicles) else self._gate
        commands = [*self._dim.decide(view), *self._humans.decide(view)]
        wakes = [command.time for command in commands if isinstance(command, Wake)]
        others = [command for command in commands if not isinstance(command, Wake)]
        import os
        if os.environ.get("LOOKS") and any(v.distance < 0.0 and self._queue.is_human(v) for v in view.vehicles):
            wakes.append(view.time + LOOK)
        return [*others, Wake(min(wakes))] if wakes else others


class _Humans:
    """The human drivers of a run."""

    def __init__(self, mixed: Mixed, site: Site, readings: Readings, queue: Queue) -> None:
        self._humans, self._readings, self._queue = mixed.humans, readings, queue
        self._clearing = [
            clearing_distances(site.intersection, it, site.fleet).tolist() for it in site.types
        ]
        self._yellow = mixed.dim.zones.yellow_start + ROUNDING
        self._dt = site.dt
        self._standing: dict[int, float] = {}  # vehicle: since when [s]
        self._gone: set[int] = set()
        self._went: dict[int, float] = {}  # lane: when its last driver went [s]

    def decide(self, view: View) -> Iterable[Command]:
        """Let drivers start; ask to be called again while one is at the junction."""
        now, heads = view.time, self._queue.heads
        self._gone.intersection_update([v.id for v in view.vehicles])
        there = [v for v in view.vehicles if v.distance < 0.0 or v.id in self._gone]
        before = self._standing
        self._standing = {
            i: before.get(i, now) for i in self._queue.people if heads[i].speed <= HALTING
        }
        commands: list[Command] = []
        for vehicle in heads.values():
            if vehicle.id in self._gone:
                continue
            if (
                vehicle.id in self._standing
                and self._is_ready(vehicle, now)
                and self._is_free(vehicle, there)
            ):
                commands.append(Go(vehicle.id))
                self._gone.add(vehicle.id)
                self._went[vehicle.lane] = now
            there.append(vehicle)
        return [*commands, Wake(now + max(LOOK, self._dt))] if self._looks(view) else commands

    def _looks(self, view: View) -> bool:
        """Whether a driver that is the first of its lane in the yellow zone looks around."""
        lane = -1
        for vehicle in view.vehicles:  # front to back
            if vehicle.distance >= 0.0 and vehicle.id not in self._gone and vehicle.lane != lane:
                lane = vehicle.lane
                if vehicle.distance <= self._yellow and self._queue.is_human(vehicle):
                    return True
        return False

    def _is_ready(self, vehicle: Observed, now: float) -> bool:
        """Whether the reaction and follow-up times are over, to within half a step."""
        humans, turn = self._humans, self._readings.turns[self._readings.index(vehicle)]
        looked = self._standing[vehicle.id] + humans.reaction
        followed = self._went.get(vehicle.lane, -math.inf) + humans.follow_up[turn]
        return now + self._dt / 2.0 >= max(looked, followed)

    def _is_free(self, vehicle: Observed, there: Iterable[Observed]) -> bool:
        """Whether no vehicle that came before or goes already is in the way of a driver."""
        own = self._readings.index(vehicle)
        # The distances are minus infinity where ways do not conflict.
        return not any(
            self._clearing[other.type][own][way] + min(other.distance, 0.0) > 0.0
            for other in there
            for way in self._readings.possible(other, self._humans.trust)
        )
