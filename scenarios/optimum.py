"""How near controllers come to the least delay that any controller could reach.

Delay counts against driving on at the limits of the roads: arrival − demand − the time that the way
takes at the limits. Without markings of a controller, that is its `control_delay_s`, up to a step
per trip. Every vehicle counts, so runs go on until the last one has arrived (`drained`).

The metrics at the end go wherever metrics do: `--metrics scenarios.optimum:ABOVE`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from baselines.optimum.alone import drives
from baselines.optimum.planning import drivable
from baselines.optimum.platoons import earliest
from baselines.optimum.scheduled import BUFFER, Scheduled, Turn
from baselines.optimum.separations import Needs, alike, necessary
from baselines.optimum.sequencing import Queue, Schedule, scheduled
from baselines.prediction import Floats
from minisim.arrivals import Arrivals, ranks
from minisim.control import Controller, Cover, Session, Site
from minisim.engine.state import types_of
from minisim.errors import CollisionError, InputError
from minisim.junction.movements import Ints
from minisim.names import name_of
from minisim.parameters import declared, part
from minisim.results.metric import Metric
from minisim.results.run import Run, ScenarioLike
from minisim.simulation import simulate
from scenarios.scenario import Scenario

#: The vehicles for which the bound holds: no speed exceeds the limits, and drivers are alike.
COVERS = Cover(alike=True)

#: A run goes on for so many times its horizon at most, until the last vehicle has arrived.
PATIENCE = 3.0


def drained(scenario: Scenario) -> Scenario:
    """The scenario with time for its last vehicle to arrive."""
    end = max(scenario.horizon, scenario.until * PATIENCE + 600.0)
    return replace(scenario, demand_time=scenario.until, horizon=end)


@dataclass(frozen=True, eq=False)
class Optimum:
    """The least delay of an arrival table, and a schedule; means over all vehicles [s]."""

    site: Site
    depart_speed: float | None
    arrivals: Arrivals

    @property
    def vehicles(self) -> int:
        """How many there are."""
        return len(self.arrivals)

    @cached_property
    def bound(self) -> float:
        """No controller has less; `InputError` if there would be too many states."""
        return self._least.bound

    @cached_property
    def reached(self) -> float:
        """Of the order that is found under the rules of the bound, which none can keep exactly.

        What it is above the bound is the gap of the search: ties alone, unless states are merged.
        """
        return self._least.reached

    @cached_property
    def planned(self) -> float:
        """Of the schedule, if vehicles could keep it."""
        limit = _at_limit(self.site, self.depart_speed)[self._kind]
        spent = self._best.arrival.sum() - (self.arrivals.time + limit).sum()
        return float(spent) / max(self.vehicles, 1)

    @cached_property
    def schedule(self) -> Scheduled:
        """A controller that keeps it."""
        lane, best = self.arrivals.lane, self._best
        order = np.lexsort((self.arrivals.time, lane))[best.order]
        columns = (column[order].tolist() for column in (lane, ranks(lane), self._kind))
        turns = zip(*columns, best.time[best.order].tolist(), strict=True)
        return Scheduled(tuple(Turn(*turn) for turn in turns))

    @property
    def facts(self) -> dict[str, Any]:
        """The numbers, for JSON."""
        return {
            "vehicles": self.vehicles, "bound_s": self.bound, "reached_s": self.reached,
            "planned_s": self.planned,
        }  # fmt: skip

    @cached_property
    def _kind(self) -> Ints:
        """The movement of each vehicle, those of each type in turn, shape (k,)."""
        movements = self.site.intersection.movements
        movement = movements.index_of[self.arrivals.lane, self.arrivals.manoeuvre]
        kind = types_of(self.site, self.arrivals) * len(movements) + movement
        return np.asarray(kind, np.int64)

    @cached_property
    def _least(self) -> Least:
        came, lane = self.arrivals.time.astype(float), self.arrivals.lane.astype(np.int64)
        packed = (column.tobytes() for column in (came, lane, self._kind))
        return _least(alike(self.site), self.depart_speed, *packed)

    @cached_property
    def _best(self) -> Schedule:
        plan = drivable(self.site, BUFFER, self.depart_speed)
        came, lane = self.arrivals.time, self.arrivals.lane
        queue = _queue(came, lane, self._kind, plan, self.site, self.depart_speed)
        return scheduled(queue, plan.rules, bounded=False)


def optimum(scenario: ScenarioLike, seed: int = 0) -> Optimum:
    """That of the arrivals of a seed; raises `InputError` for vehicles that are not covered."""
    site, arrivals = scenario.site(seed), scenario.arrivals(seed)
    for it in site.types:
        COVERS.check("the optimum", it)
        if it.sumo is not None:
            raise InputError(
                f"the optimum is for vehicles with minisim's own rules, got sumo={it.sumo!r}"
            )
    factors = arrivals.speed_factor
    if factors is not None and (factors != 1.0).any():
        raise InputError("the optimum is for drivers that are alike, got speed factors")
    return Optimum(site, scenario.depart_speed, arrivals)


@declared
class Clairvoyant:
    """Knows the arrivals of its scenario beforehand, and keeps the schedule of the optimum."""

    name = "schedule"
    covers = COVERS

    scenario: Scenario = part("whose arrivals it knows", Scenario)

    def start(self, site: Site) -> Session:
        """Begin a run; raises as `optimum`."""
        return optimum(self.scenario, site.seed).schedule.start(site)


def compared(
    scenario: Scenario, controllers: Iterable[Controller], seed: int, least: Optimum,
    host: Callable[..., Run] = simulate,
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """For the schedule as driven, and each controller: name, mean delay, and how far above.

    A collision ends a run: the row of a controller says so, and has no delay.
    """
    for controller in (least.schedule, *controllers):
        own = controller is least.schedule
        row: dict[str, Any] = {"controller": "schedule" if own else name_of(controller)}
        try:
            delay = mean_delay(host(drained(scenario), controller, seed))
            why = "a vehicle did not arrive" if delay is None else ""
        except CollisionError as error:
            delay, why = None, str(error)
        yield row | {"delay_s": delay, "above_percent": above(delay, least.bound), "error": why}


def above(delay: float | None, least: float | None) -> float | None:
    """By how much a delay exceeds the least one [%]; None if one is not known or the least is 0."""
    return 100.0 * (delay - least) / least if least and delay is not None else None


def mean_delay(run: Run) -> float | None:
    """The mean delay of a run [s]; None if a vehicle has not arrived."""
    values = delays(run)
    return None if np.isnan(values).any() else _mean(values)


def delays(run: Run) -> Floats:
    """The delay of each vehicle [s], shape (k,); NaN if it has not arrived."""
    trips, movements = run.columns, run.site.intersection.movements
    kind = trips.type * len(movements) + movements.index_of[trips.lane, trips.manoeuvre]
    at_limit = _at_limit(run.site, run.scenario.depart_speed)
    return np.asarray(trips.arrival - trips.demand_time - at_limit[kind])


def _least_delay(run: Run) -> float | None:
    if run.scenario.warmup:
        raise InputError("the least delay is that of all vehicles; leave out the warm-up")
    try:
        return optimum(run.scenario, run.seed).bound
    except InputError:
        return None


def _planned_delay(run: Run) -> float | None:
    if _least_delay(run) is None:
        return None
    return optimum(run.scenario, run.seed).planned


def _above(run: Run) -> float | None:
    return above(mean_delay(run), _least_delay(run))


DELAY = Metric(
    "delay_s", delays, "s", "trip", "run and trips", title="delay",
    meaning="against driving on at the limits of the roads, whatever zones a controller has",
    equation="arrival − demand − way/limits (ours; docs/howto/optimum.md)",
)  # fmt: skip
LEAST = Metric(
    "least_delay_s", _least_delay, "s", title="least delay",
    meaning="no controller has a mean delay below it; none if it is not known",
    equation="best order by dynamic programming (ours; docs/howto/optimum.md)",
)  # fmt: skip
PLANNED = Metric(
    "planned_delay_s", _planned_delay, "s", title="delay as planned",
    meaning="of the schedule, if vehicles could keep it; none if the least delay is not known",
    equation="best order with clearances, by dynamic programming (ours; docs/howto/optimum.md)",
)  # fmt: skip
ABOVE = Metric(
    "above_least_percent", _above, "%", title="above the least delay",
    meaning="mean delay against the least possible; none if a vehicle has not arrived",
    equation="100·(delay − least)/least (ours; docs/howto/optimum.md)",
)  # fmt: skip


def _mean(values: Floats) -> float:
    return float(values.sum()) / max(len(values), 1)


def _at_limit(site: Site, depart_speed: float | None) -> Floats:
    """What the whole way takes at the limits, by kind [s]."""
    return np.array([way.at_limit for way in drives(alike(site), depart_speed)])


class Least(NamedTuple):
    """What the search gives for an arrival table: mean delays [s]."""

    bound: float
    reached: float  #: of the order found, under the same rules


@lru_cache(maxsize=32)
def _least(site: Site, depart_speed: float | None, time: bytes, lane: bytes, kind: bytes) -> Least:
    """Kept, as a process often runs several controllers on the same arrivals."""
    came, kinds = np.frombuffer(time), np.frombuffer(kind, np.int64)
    needs = necessary(site, depart_speed)
    queue = _queue(came, np.frombuffer(lane, np.int64), kinds, needs, site, depart_speed)
    best, at_limit = scheduled(queue, needs.rules), float((came + needs.at_limit[kinds]).sum())
    sums = (best.bound, float(best.arrival.sum()))
    return Least(*(max(each - at_limit, 0.0) / max(len(came), 1) for each in sums))


def _queue(
    came: Floats, lane: Ints, kind: Ints, needs: Needs, site: Site, depart_speed: float | None
) -> Queue:
    """The vehicles, by lane; none is at its mark before it can be behind those ahead of it."""
    order = np.lexsort((came, lane))
    enters = np.ceil(came[order] / site.dt - 1e-6).astype(np.int64)
    lane, kind = lane[order], kind[order]
    ready = earliest(site, enters, lane, kind, needs.marks, depart_speed)
    begins = np.searchsorted(lane, np.arange(lane.max(initial=-1) + 2))
    return Queue(ready, kind, begins)
