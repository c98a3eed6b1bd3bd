"""What all environments share: one run at a time, advanced in steps, what it costs, a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from minisim.control import External, Plan, Site, View
from minisim.engine.collision import Collision
from minisim.errors import InputError, choice, instance, show
from minisim.simulation import Simulation
from scenarios.library import four_way
from scenarios.scenario import Scenario

if TYPE_CHECKING:
    from figures.film.live import Live

#: What an environment's `metadata` says about pictures.
PICTURES = {"render_modes": ["rgb_array", "human"], "render_fps": 5}


class World:
    """A run whose commands come from outside.

    Args:
        scenario: what to simulate; by default four arms, 300 veh/h/lane, ten minutes.
        interval: time between two actions, in steps of the scenario [s].
        render_mode: None, "rgb_array" or "human".
    """

    def __init__(
        self, scenario: Scenario | None, interval: float, render_mode: str | None = None
    ) -> None:
        if scenario is None:
            scenario = four_way(density=300.0, horizon=600.0, warmup=0.0)
        instance("scenario", scenario, Scenario)
        self.scenario, self.site = scenario, scenario.site(seed=0)
        self.interval = self.site.period("interval", interval)
        if render_mode is not None:
            choice("render_mode", render_mode, ("rgb_array", "human"))
        self._render_mode = render_mode
        self._sim: Simulation | None = None
        self._screen: Live | None = None

    @property
    def sim(self) -> Simulation:
        """The present run; raises `InputError` before the first one."""
        if self._sim is None:
            raise InputError("there is no run yet: call reset() first")
        return self._sim

    @property
    def over(self) -> bool:
        """Whether the episode has ended: at the horizon, the last arrival or a collision."""
        return self.sim.finished or self.collision is not None

    def check_going(self) -> None:
        """Raise `InputError` if there is no episode to go on with."""
        if self.over:
            raise InputError(f"the episode ended at {self.sim.time:g} s: call reset() first")

    @property
    def road(self) -> float:
        """Length of the approach lanes [m]; a view as long shows every vehicle on them."""
        return self.site.intersection.approach_length

    def begin(self, plan: Plan, seed: int) -> Site:
        """Start another run; returns its site."""
        sim = Simulation(self.scenario, External(plan), seed=seed, on_collision="record")
        self._sim, self._plan, self.site = sim, plan, sim.site
        self._demanded = np.sort(sim.arrivals.time)
        self._departed = [0] * self.site.intersection.n
        sim.command()  # begins the run
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

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The junction now: as pixels of the shape (height, width, 3), or in a window."""
        if self._render_mode is None:
            return None
        from figures.film.live import Live

        view = self.sim.view()
        if self._screen is None:
            self._screen = Live(self.site, self._plan, window=self._render_mode == "human")
        pixels = self._screen.draw(view)
        return pixels if self._render_mode == "rgb_array" else None

    def show(self) -> None:
        """Bring the window up to date, if there is one."""
        if self._render_mode == "human":
            self.render()

    def close(self) -> None:
        """Close the window."""
        if self._screen is not None:
            self._screen.close()
            self._screen = None


def allowed(space: Any, action: object, name: str = "action") -> npt.NDArray[Any]:
    """An action as an array; raises `InputError` if it is not in its space."""
    try:
        array = np.asarray(action)
    except ValueError:  # lists of different lengths
        array = np.array(None)
    if not space.contains(array):
        raise InputError(f"{name} must be in {space}, got {show(action)}")
    return array
