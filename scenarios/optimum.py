"""How near controllers come to the least delay that any controller could reach.

Delay counts against driving on at the limits of the roads: arrival − demand − the time that the way
takes at the limits. Without markings of a controller, that is its `control_delay_s`, up to a step
per trip. Every vehicle counts, so runs go on until the last one has arrived.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from baselines.optimum.separations import Needs, necessary
from baselines.optimum.sequencing import WAKE_STEP, Queue, Schedule, scheduled
from baselines.prediction import Floats
from minisim.arrivals import Arrivals
from minisim.control import Cover, Site
from minisim.engine.state import types_of
from minisim.errors import InputError
from minisim.junction.movements import Ints
from minisim.results.run import Run
from scenarios.scenario import Scenario

#: The vehicles for which the bound holds: their speeds never exceed the limits.
COVERS = Cover(alike=True)


@dataclass(frozen=True)
class Drained:
    """A scenario whose runs go on until the last vehicle has arrived, `extra` [s] at most."""

    scenario: Scenario
    extra: float = 3600.0

    name = property(lambda self: self.scenario.name)
    profile_name = property(lambda self: self.scenario.profile_name)
    density = property(lambda self: self.scenario.density)
    depart_speed = property(lambda self: self.scenario.depart_speed)
    warmup = 0.0

    @property
    def horizon(self) -> float:
        return self.scenario.horizon + self.extra

    def site(self, seed: int) -> Site:
        return self.scenario.site(seed)

    def arrivals(self, seed: int) -> Arrivals:
        return self.scenario.arrivals(seed)


class Demanded(NamedTuple):
    """The vehicles of a run in demand order, shape (k,) each."""

    time: Floats  #: when each wants to enter the road [s]
    lane: Ints
    kind: Ints  #: index of its movement, those of each type in turn


def demanded(scenario: Scenario, seed: int) -> Demanded:
    site, arrivals = scenario.site(seed), scenario.arrivals(seed)
    movements = site.intersection.movements
    movement = movements.index_of[arrivals.lane, arrivals.manoeuvre]
    kind = types_of(site, arrivals) * len(movements) + movement
    return Demanded(arrivals.time, arrivals.lane, kind)


def queue_of(vehicles: Demanded, site: Site, needs: Needs) -> tuple[Queue, Ints]:
    """The queue of vehicles, and the index of each in demand order."""
    order = np.lexsort((vehicles.time, vehicles.lane))
    enters = np.ceil(vehicles.time / site.dt - 1e-6)[order] * site.dt
    lane, kind = vehicles.lane[order], vehicles.kind[order]
    behind = np.diff(enters, prepend=-np.inf)
    behind[np.diff(lane, prepend=-1) > 0] = np.inf
    place = np.minimum(behind / WAKE_STEP, needs.approach.shape[1] - 1.0)
    loss = needs.approach[kind, np.ceil(place).astype(int)]
    loss[~np.isfinite(behind)] = 0.0
    begins = np.searchsorted(lane, np.arange(site.intersection.n + 1))
    return Queue(enters + loss + needs.until[kind], kind, begins), order


def bound(scenario: Scenario, seed: int) -> tuple[float, Schedule]:
    site, vehicles = scenario.site(seed), demanded(scenario, seed)
    needs = necessary(site, scenario.depart_speed)
    queue, _ = queue_of(vehicles, site, needs)
    made = scheduled(queue, needs.rules)
    return made.bound - float((vehicles.time + needs.at_limit[vehicles.kind]).sum()), made


def delay(run: Run, vehicles: Demanded, at_limit: Floats) -> float:
    late = run.columns.arrival - vehicles.time - at_limit[vehicles.kind]
    return float(late.sum())
