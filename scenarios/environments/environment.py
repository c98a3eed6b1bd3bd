"""What the environments of one agent have in common: Gymnasium's side of a `World`."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from minisim.control import Plan, View
from minisim.errors import choice
from scenarios.environments.world import World
from scenarios.scenario import Scenario

Observation = npt.NDArray[np.float32]

#: Runs have seeds below this.
SEEDS = 2**31


class Environment(gymnasium.Env[Observation, Any]):
    """A junction whose agent acts every `interval` seconds.

    The reward of a step is minus the seconds that all vehicles together spend in it, between the
    time at which they want to come and the time at which they leave the junction: minus the number
    present at its end, times its length. An episode is truncated at the scenario's horizon. It is
    terminated by a collision, which `info["collision"]` tells, and when every vehicle has arrived.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (as in Env)
        "render_modes": ["rgb_array", "human"], "render_fps": 5,
    }  # fmt: skip

    def __init__(self, scenario: Scenario | None, interval: float, render_mode: str | None) -> None:
        self.world = World(scenario, interval)
        if render_mode is not None:
            choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self._screen: Any = None

    @property
    @abstractmethod
    def plan(self) -> Plan:
        """What a view shows, and where the hold lines are."""

    @abstractmethod
    def _start(self) -> None:
        """Begin an episode."""

    @abstractmethod
    def _act(self, action: Any) -> None:
        """Carry out an action, and advance to the next one."""

    @abstractmethod
    def _observe(self, view: View) -> Observation:
        """What the agent sees."""

    @abstractmethod
    def _mask(self, view: View) -> npt.NDArray[np.int8]:
        """Which actions have an effect now."""

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a run with new arrivals, drawn from the environment's own random numbers."""
        super().reset(seed=seed, options=dict(options or {}))
        self.world.begin(self.plan, int(self.np_random.integers(SEEDS)))
        self._start()
        view = self.world.sim.view()
        return self._observe(view), self._info(view)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, and go on to the next action."""
        world = self.world
        before = world.sim.time
        self._act(action)
        view = world.sim.view()
        reward = -world.present(view) * (world.sim.time - before)
        crashed = world.collision is not None
        over = world.sim.finished
        truncated = over and not crashed and world.sim.time >= world.scenario.horizon
        if self.render_mode == "human":
            self.render()
        info = self._info(view)
        return self._observe(view), reward, crashed or (over and not truncated), truncated, info

    def _info(self, view: View) -> dict[str, Any]:
        info: dict[str, Any] = {"time": view.time, "action_mask": self._mask(view)}
        if self.world.collision is not None:
            info["collision"] = str(self.world.collision)
        return info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The junction now: as pixels, or in a window."""
        from figures.film.live import Live

        if self.render_mode is None:
            return None
        if self._screen is None:
            self._screen = Live(self.world.site, self.plan, window=self.render_mode == "human")
        pixels: npt.NDArray[np.uint8] = self._screen.draw(self.world.sim.view())
        return pixels if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window."""
        if self._screen is not None:
            self._screen.close()
            self._screen = None


def box(size: int) -> Any:
    """The space of vectors of numbers from 0 to 1."""
    return spaces.Box(0.0, 1.0, (size,), np.float32)
