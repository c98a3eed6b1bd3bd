"""DIM as a controller: one agent per vehicle, hosted.

The vehicles of the paper look around all the time. The host calls only at a few wake-ups. These
suffice because between them no agent would change its mind:

- A new vehicle takes part when its front bumper passes the start of the yellow zone (a wake-up), or
  when the vehicle ahead of it enters the junction. Then the gate "clear" keeps every vehicle where
  it is, and the gate "harmonious" asks for a wake-up.
- A participant begins to cross only when it holds the right of way, since a waiting vehicle can
  stop. The gate "clear" then freezes the decision. Under "harmonious" the choice among the rest
  stays the same: without the vehicle that went, the best clique is the best among the movements in
  harmony with it, since cliques are compared by the smallest lane rank that only one of them has.
  Under "passed" a vehicle inside may leave the way of one that waits at any time: as long as one
  waits while others cross, the session looks every step.
- A vehicle stops crossing when its rear bumper leaves the junction (a wake-up).

There are four exceptions:

- Under `commit="paper"` a vehicle that rolls past the middle of the green zone without the right of
  way is granted it. That point is another mark.
- On a host with different brakes, a vehicle that loses its right of way may look committed until it
  stands. The session then looks again every step.
- If lane priorities change with time (`dim.priorities`), the session looks again when they do.
- If perception errs, vehicles do not all see the same. They look every `Perception.period`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache, partial
from typing import Any, Literal, TypeAlias

from dim.agent import GATES, Agent, Rules
from dim.decision import ORDERS, DecisionTable, decision_table, lane_ranks
from dim.harmony import HarmonyMatrix
from dim.monitor import Monitor
from dim.passing import Passing
from dim.perception import COMMITS, ROUNDING, ExactPerception, Perception, Reader
from dim.priorities import CHANGING, SENSOR_RANGE, TURN_TIME, ranking_of, rotating
from dim.reasons import Reasons, reasons_of
from dim.senses.noise import NoisyPerception
from dim.senses.tally import Tally
from dim.zones import Zones
from minisim.control import Command, Go, Hold, Observed, Plan, Site, View, Wake
from minisim.errors import InputError, choice, instance, items
from minisim.names import Name
from minisim.parameters import Spelled, Takes, checked, declared, part, real, refuse_idle, word
from minisim.reasons import Reason

_Word: TypeAlias = Literal["inflow", "rotating", "waiting"]

#: Whose bodies the harmony of movements is about, see `Dim.bodies`.
BODIES = ("worst", "own")

SIGHT_MARGIN = 0.5  #: how far views reach beyond the start of the yellow zone [m]


def _priorities(title: str, value: Any) -> Any:
    """Check `Dim.priorities`."""
    if isinstance(value, str):
        return choice(title, value, ("inflow", *CHANGING))
    ranks = items(title, value, "ranks such as (0,1,2,3), or inflow, rotating or waiting")
    return lane_ranks(ranks, len(ranks))


@declared
class Dim:
    """Vehicles that decide alone, by the paper's rules or ours.

    The gates "harmonious" and "passed", priorities other than the lanes' own order, and the
    monitor are ours.
    """

    name = Name("dim")

    order: str = word(
        "what comes first: the largest clique, or the highest-priority lanes",
        ORDERS, default="size",
    )  # fmt: skip
    commit: str = word(
        "when a vehicle is committed: when comfortable braking no longer stops it before the "
        "junction, or past half of the green zone",
        COMMITS, default="stoppable", label="commit rule",
    )  # fmt: skip
    gate: str = word(
        "which vehicles may enter while others cross: none (the paper), those in harmony with all "
        "of them, or those in whose way none is any more; vehicles of one lane just follow each "
        "other",
        GATES, default="clear",
    )  # fmt: skip
    priorities: Takes[tuple[int, ...] | _Word | None, Iterable[int] | _Word | None] = checked(
        "which lane comes first: ranks of the lanes a, b, c, …, 0 first; inflow, the one with the "
        "highest demand; rotating, each in turn; waiting, the one that has waited longest; none "
        "means their own order",
        _priorities, "ranks such as (0,1,2,3) | inflow | rotating | waiting",
        optional=True, default=None,
    )  # fmt: skip
    zones: Spelled[Zones] = part(
        "the road markings", Zones, kinds={"zones": Zones}, default=Zones()
    )
    matrix: Spelled[HarmonyMatrix | None] = part(
        "harmony of the movements; none means from geometry and vehicle",
        HarmonyMatrix,
        kinds={"paper": HarmonyMatrix.paper, "file": HarmonyMatrix.from_csv},
        optional=True, default=None,
    )  # fmt: skip
    bodies: str = word(
        "whose bodies harmony is about: the worst of the fleet, which all know beforehand, or the "
        "types that take part, which all see",
        BODIES, default="worst",
    )  # fmt: skip
    perception: Spelled[Perception] = part(
        "what vehicles see of each other",
        Perception,
        kinds={"exact": ExactPerception, "noisy": NoisyPerception},
        default=ExactPerception(),
    )
    turn_time: float = real(
        'how long a lane comes first in "rotating" and among equals in "waiting"', "s",
        default=TURN_TIME, low=1, high=3600,
    )  # fmt: skip
    sensor_range: float = real(
        "how far vehicles see the others' approach lanes and yellow zones, which limits the waits "
        'that "waiting" compares', "m",
        default=SENSOR_RANGE, low=1, high=1000,
    )  # fmt: skip
    monitor: Spelled[Monitor | None] = part(
        "a safety monitor in every vehicle", Monitor, kinds={"on": Monitor},
        optional=True, default=None,
    )  # fmt: skip
    period: float | None = real(
        "time between two looks, besides the wake-ups; none means as the perception needs", "s",
        above=0, optional=True, default=None,
    )  # fmt: skip

    def __post_init__(self) -> None:
        if self.matrix is not None:
            refuse_idle(self, "matrix=none", "bodies")
        if self.priorities not in CHANGING:
            refuse_idle(self, "priorities=rotating or waiting", "turn_time")
        if self.priorities != "waiting":
            refuse_idle(self, "priorities=waiting", "sensor_range")

    def start(self, site: Site) -> DimSession:
        """Begin a run; raises `InputError` if a parameter, such as the matrix, does not fit."""
        return DimSession(self, site)

    def ranks(self, site: Site) -> tuple[int, ...]:
        """Rank of each lane here at time 0, 0 first; raises `InputError` if n differs."""
        n = site.intersection.n
        if self.priorities == "inflow":
            by_inflow = sorted(range(n), key=lambda lane: (-site.demand[lane], lane))
            return tuple(by_inflow.index(lane) for lane in range(n))
        if isinstance(self.priorities, str):
            return rotating(0.0, n).ranks
        return lane_ranks(self.priorities, n)

    def harmony(self, site: Site) -> HarmonyMatrix:
        """The matrix in force at this site; raises `InputError` if n differs."""
        n = site.intersection.n
        if self.matrix is None:
            return HarmonyMatrix.from_geometry(site.intersection, site.fleet)
        if self.matrix.n != n:
            raise InputError(f"the matrix is for {self.matrix.n} arms, the intersection has {n}")
        if self.matrix.types > 1:
            raise InputError("a matrix for several types is not given but made: say bodies=own")
        return self.matrix


def _rests(dim: Dim, looks: float | None, takes: object) -> bool:
    """Whether no vehicle can change its mind while any is inside the junction.

    Under the paper's gate, all wait for an empty junction. Ranks that change with time, monitors,
    and vehicles that see or read differently look on.
    """
    return (
        (dim.gate, dim.commit) == ("clear", "stoppable")
        and dim.priorities not in CHANGING
        and (dim.monitor, looks, takes, dim.period) == (None,) * 4
    )


#: Plans by their values: they are the same in most runs.
_plan = lru_cache(maxsize=256)(Plan)


def _taken(
    takes: Callable[[View, View], View],
    see: Callable[[View, Observed], View],
    view: View,
    ego: Observed,
) -> View:
    """What a vehicle makes of what it sees. (No closure: a fork copies the state of both.)"""
    return takes(view, see(view, ego))


class DimSession:
    """One run of DIM: hosts an agent for each vehicle that takes part and that `follows` DIM.

    `takes` is how vehicles interpret what they have seen of a true view: (true, seen) -> taken.
    """

    def __init__(
        self,
        dim: Dim,
        site: Site,
        follows: Callable[[Observed], bool] = lambda _: True,
        takes: Callable[[View, View], View] | None = None,
    ) -> None:
        instance("site", site, Site)
        zones = dim.zones
        zones.check(site)
        matrix = dim.harmony(site)
        typed = dim.bodies == "own" and len(site.types) > 1
        rules = matrix
        if typed:
            rules = HarmonyMatrix.from_geometry(site.intersection, site.fleet, by_type=True)
        table = decision_table(rules, dim.order, dim.ranks(site))
        self.rules = Rules(table, dim.gate, dim.commit)  #: those in force at the next look
        brakes = tuple(it.deceleration for it in site.types)
        passing = Passing(rules, site) if dim.gate == "passed" else None
        self.reader = Reader(site.intersection.n, zones, brakes, dim.commit, rules.types, passing)
        half_green = (zones.green / 2.0,) if dim.commit == "paper" else ()
        entry = () if dim.gate == "clear" else (0.0,)
        looks = dim.perception.period
        self.plan = _plan(
            hold_distance=zones.green,
            markings=zones.markings(site),
            marks=(zones.yellow_start, *half_green, *entry),
            wake_on_clear=True,
            wake_when_empty=_rests(dim, looks, takes),
            period=dim.period or (None if looks is None else max(looks, site.dt)),
            sight=zones.yellow_start + SIGHT_MARGIN,
            lanes_open=False,
        )
        self._start = zones.yellow_start + ROUNDING
        self._ranks = ranking_of(dim.priorities, site, zones, dim.turn_time, dim.sensor_range)
        see = dim.perception.start(site)
        self.see = see if takes is None else partial(_taken, takes, see)
        self._monitors = dim.monitor.start(site, matrix, self._start) if dim.monitor else None
        self._dt, self._follows, self._takes = site.dt, follows, takes
        self._agents: dict[int, Agent] = {}
        self._sights: dict[int, View] = {}  # what each of them saw when it last looked
        self._table = table
        exact = looks is None
        self._same = exact and takes is None  # whether all see the true view
        self._tally = None if exact else Tally(self.reader, self._start)

    @property
    def counts(self) -> Mapping[str, float]:
        """What wrong perception has done so far (`dim.senses.tally`); empty if exact."""
        return {} if self._tally is None else self._tally.counts

    def decide(self, view: View) -> Iterable[Command]:
        """Let every vehicle from the yellow zone on look and decide; command what changes."""
        commands: list[Command] = []
        agents: dict[int, Agent] = {}  # those that left the view are forgotten
        look_again = waiting = False
        passed = self.reader.passing is not None
        table, until = self.table(view)
        seen = percept = None
        sights: dict[int, View] = {}
        for ego in view.vehicles:
            vehicle = ego.id
            if ego.distance > self._start or not self._follows(ego):
                continue
            agent = self._agents.get(vehicle) or Agent(vehicle, ego.lane, self.rules)
            agents[vehicle], agent.rules = agent, self.rules
            sight = sights[vehicle] = self.see(view, ego)
            if sight is not seen or percept is None:  # vehicles that see the same read the same
                seen, percept = sight, self.reader.read(sight)
            had = agent.right_of_way
            goes = agent.decide(percept, table)
            if self._monitors is not None:
                goes = self._monitors.patience.goes(view, sight, ego, goes, table.priorities)
                agent.right_of_way = goes
            if goes != had:
                commands.append(Go(vehicle) if goes else Hold(vehicle))
            if not goes:
                look_again |= vehicle in percept.crossing
                takes_part = vehicle in percept.participants
                waiting |= takes_part
                look_again |= takes_part and passed and bool(percept.crossing)
        self._agents, self._sights, self._table = agents, sights, table
        going = {vehicle for vehicle, agent in agents.items() if agent.right_of_way}
        if self._monitors is not None:
            commands += self._monitors.look(view, sights, going)
            look_again |= self._monitors.needed
        if self._tally is not None:
            true = view if self._takes is None else self._takes(view, view)
            self._tally.count(view, true, sights, self.rules, table, going)
        if look_again:
            commands.append(Wake(view.time + self._dt))
        elif waiting and until < math.inf:
            commands.append(Wake(max(until, view.time + self._dt)))
        return commands

    def reasons(self, view: View) -> Mapping[int, Reason]:
        """Why the vehicles in view wait or go (`minisim.reasons.Explaining`).

        If all see the same, each says what it sees now; else what it saw when it last looked.
        """
        said = Reasons(self.reader, self._table, self.rules.gate)
        agents, sights = self._agents, self._sights
        if self._same:
            near = [v for v in view.vehicles if v.distance <= self._start and self._follows(v)]
            agents = {v.id: agents.get(v.id) or Agent(v.id, v.lane, self.rules) for v in near}
            sights = dict.fromkeys(agents, view)
        found = reasons_of(said, view, agents, sights)
        fronts = {v.lane: v for v in reversed(view.vehicles) if v.distance >= 0.0}
        for v in fronts.values():
            if v.distance > self._start and self._follows(v):
                found[v.id] = Reason("comes", v.id)
        if self._monitors is not None:
            found |= self._monitors.reasons()
        return found

    def table(self, view: View) -> tuple[DecisionTable, float]:
        """The table for the current ranks, and the time until which they hold [s]."""
        base = self.rules.table
        if self._ranks is None:
            return base, math.inf
        ranks, until = self._ranks(view)
        return decision_table(base.matrix, base.order, ranks), until
