"""How near controllers come to the least delay that any controller could reach.

Delay counts against driving on at the limits of the roads: arrival − demand − the time that the way
takes at the limits. Without markings of a controller, that is its `control_delay_s`, up to a step
per trip. Every vehicle counts, so runs go on until the last one has arrived.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from baselines.optimum.planning import drivable
from baselines.optimum.scheduled import BUFFER, Scheduled, Turn
from baselines.optimum.separations import Needs, necessary
from baselines.optimum.sequencing import WAKE_STEP, Queue, scheduled
from baselines.prediction import Floats
from minisim.arrivals import Arrivals, ranks
from minisim.control import Controller, Cover, Site
from minisim.engine.state import types_of
from minisim.errors import CollisionError, InputError
from minisim.junction.movements import Ints
from minisim.names import name_of
from minisim.results.run import Run
from minisim.simulation import simulate
from scenarios.scenario import Scenario

#: The vehicles for which the bound holds: no speed exceeds the limits, and drivers are alike.
COVERS = Cover(alike=True)

#: A run goes on for so many times its horizon at most, until the last vehicle has arrived.
PATIENCE = 3.0


@dataclass(frozen=True)
class Drained:
    """A scenario whose runs go on until the last vehicle has arrived."""

    scenario: Scenario
    name: str = field(init=False)
    profile_name: str = field(init=False)
    density: float = field(init=False)
    depart_speed: float | None = field(init=False)
    horizon: float = field(init=False)
    warmup: float = 0.0

    def __post_init__(self) -> None:
        for name in ("name", "profile_name", "density", "depart_speed"):
            object.__setattr__(self, name, getattr(self.scenario, name))
        object.__setattr__(self, "horizon", self.scenario.horizon * PATIENCE + 600.0)

    def site(self, seed: int) -> Site:
        """What a controller may know, the expected inflow of the demand included."""
        return self.scenario.site(seed)

    def arrivals(self, seed: int) -> Arrivals:
        """Those of the scenario."""
        return self.scenario.arrivals(seed)


class Optimum(NamedTuple):
    """The least delay of an arrival table, and a schedule; means over all vehicles."""

    vehicles: int
    bound: float  #: no controller has less [s]
    planned: float  #: of the schedule [s]
    schedule: Scheduled  #: a controller that keeps it
    at_limit: float  #: what the ways take at the limits, from demand time 0 [s]

    @property
    def facts(self) -> dict[str, Any]:
        """The numbers, for JSON."""
        return {"vehicles": self.vehicles, "bound_s": self.bound, "planned_s": self.planned}

    def above(self, delay: float) -> float | None:
        """By how much a mean delay [s] exceeds the bound [%]; None if the bound is 0."""
        return 100.0 * (delay - self.bound) / self.bound if self.bound > 0.0 else None

    def delay(self, run: Run) -> float | None:
        """The mean delay of a run [s]; None if a vehicle has not arrived."""
        arrival = run.columns.arrival
        if np.isnan(arrival).any():
            return None
        return float(arrival.mean()) - self.at_limit if len(arrival) else 0.0


def optimum(scenario: Scenario, seed: int = 0) -> Optimum:
    """The bound and a schedule for the arrivals of a seed; raises `InputError` for `COVERS`."""
    site, arrivals = scenario.site(seed), scenario.arrivals(seed)
    _check(site, arrivals)
    movement = site.intersection.movements.index_of[arrivals.lane, arrivals.manoeuvre]
    kind = types_of(site, arrivals) * len(site.intersection.movements) + movement
    count, order = len(kind), np.lexsort((arrivals.time, arrivals.lane))
    enters = np.ceil(arrivals.time / site.dt - 1e-6) * site.dt
    needs = necessary(site, scenario.depart_speed)
    plan = drivable(site, BUFFER, scenario.depart_speed)
    least = scheduled(_queue(enters[order], arrivals.lane[order], kind[order], needs), needs.rules)
    own = _queue(enters[order], arrivals.lane[order], kind[order], plan)
    best = scheduled(own, plan.rules, exact=False)
    rank = ranks(arrivals.lane)[order]
    turns = tuple(
        Turn(int(arrivals.lane[order[i]]), int(rank[i]), int(kind[order[i]]), float(best.time[i]))
        for i in best.order.tolist()
    )
    at_limit = float((arrivals.time + needs.at_limit[kind]).sum())
    mean = 1.0 / max(count, 1)
    bound, planned = max(least.bound - at_limit, 0.0), float(best.arrival.sum()) - at_limit
    return Optimum(count, bound * mean, planned * mean, Scheduled(turns), at_limit * mean)


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
            delay = least.delay(host(Drained(scenario), controller, seed))
            why = "a vehicle did not arrive" if delay is None else ""
        except CollisionError as error:
            delay, why = None, str(error)
        above = None if delay is None else least.above(delay)
        yield row | {"delay_s": delay, "above_percent": above, "error": why}


def _check(site: Site, arrivals: Arrivals) -> None:
    for it in site.types:
        COVERS.check("the optimum", it)
        if it.sumo is not None:
            raise InputError(
                f"the optimum is for vehicles with minisim's own rules, got sumo={it.sumo!r}"
            )
    factors = arrivals.speed_factor
    if factors is not None and (factors != 1.0).any():
        raise InputError("the optimum is for drivers that are alike, got speed factors")


def _queue(enters: Floats, lane: Ints, kind: Ints, needs: Needs) -> Queue:
    """The vehicles, by lane; none comes before it would behind the one ahead of it, if alone."""
    behind = np.diff(enters, prepend=-math.inf)
    behind[np.diff(lane, prepend=-1) > 0] = math.inf
    # A larger time behind only makes the loss smaller.
    place = np.minimum(np.ceil(behind / WAKE_STEP), needs.approach.shape[1] - 1.0).astype(int)
    loss = np.where(behind < math.inf, needs.approach[kind, place], 0.0)
    begins = np.searchsorted(lane, np.arange(lane.max(initial=-1) + 2))
    return Queue(enters + loss + needs.until[kind], kind, begins)
