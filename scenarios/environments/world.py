"""What all environments share: one run at a time, advanced in steps, and what it costs."""

from __future__ import annotations

import numpy as np

from minisim.control import External, Plan, Site, View
from minisim.engine.collision import Collision
from minisim.errors import instance
from minisim.simulation import Simulation
from scenarios.library import four_way
from scenarios.scenario import Scenario


class World:
    """A run whose commands come from outside.

    Args:
        scenario: what to simulate; by default four arms, 300 veh/h/lane, ten minutes.
        interval: time between two actions, in steps of the scenario [s].
    """

    sim: Simulation

    def __init__(self, scenario: Scenario | None, interval: float) -> None:
        if scenario is None:
            scenario = four_way(density=300.0, horizon=600.0, warmup=0.0)
        instance("scenario", scenario, Scenario)
        self.scenario, self.site = scenario, scenario.site(seed=0)
        self.interval = self.site.period("interval", interval)

    @property
    def road(self) -> float:
        """Length of the approach lanes [m]; a view as long shows every vehicle on them."""
        return self.site.intersection.approach_length

    def begin(self, plan: Plan, seed: int) -> Site:
        """Start another run; returns its site."""
        self.sim = Simulation(self.scenario, External(plan), seed=seed, on_collision="record")
        self.site = self.sim.site
        self._demanded = np.sort(self.sim.arrivals.time)
        self._departed = [0] * self.site.intersection.n
        self.sim.command()  # begins the run
        return self.site

    @property
    def next_action(self) -> float:
        """When the next action is due [s]."""
        return self.sim.time + self.interval

    @property
    def collision(self) -> Collision | None:
        """What ended the run, if anything did."""
        return self.sim.collisions[0] if self.sim.collisions else None

    def present(self, view: View) -> int:
        """How many vehicles want to come or are on the way and have not left the junction.

        The view must show the whole road.
        """
        for v in view.vehicles:
            if v.rank >= self._departed[v.lane]:
                self._departed[v.lane] = v.rank + 1
        wanted = int(np.searchsorted(self._demanded, view.time, side="right"))
        return wanted - sum(self._departed) + len(view.vehicles)
