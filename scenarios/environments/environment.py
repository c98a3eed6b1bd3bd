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
from scenarios.environments.world import PICTURES, World, allowed
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

    metadata: dict[str, Any] = PICTURES

    def __init__(self, scenario: Scenario | None, interval: float, render_mode: str | None) -> None:
        self.world = World(scenario, interval, render_mode)
        self.render_mode = render_mode

    @property
    @abstractmethod
    def plan(self) -> Plan:
        """What a view shows, and where the hold lines are."""

    @abstractmethod
    def _start(self) -> None:
        """Begin an episode."""

    @abstractmethod
    def _act(self, action: npt.NDArray[Any]) -> None:
        """Carry out an action, and advance to the next one."""

    @abstractmethod
    def _look(self, view: View) -> tuple[Observation, npt.NDArray[np.int8]]:
        """What the agent sees, and which actions have an effect now."""

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a run with new arrivals, drawn from the environment's own random numbers."""
        super().reset(seed=seed, options=dict(options or {}))
        self.world.begin(self.plan, int(self.np_random.integers(SEEDS)))
        self._start()
        self.world.show()
        return self._seen(self.world.sim.view())

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act, and go on to the next action.

        Raises:
            InputError: the action is not in `action_space`, or no episode is going on.
        """
        world = self.world
        world.check_going()
        before = world.sim.time
        self._act(allowed(self.action_space, action))
        view = world.sim.view()
        reward = -world.present(view) * (world.sim.time - before)
        crashed = world.collision is not None
        truncated = world.over and not crashed and world.sim.time >= world.scenario.horizon
        world.show()
        seen, info = self._seen(view)
        return seen, reward, world.over and not truncated, truncated, info

    def _seen(self, view: View) -> tuple[Observation, dict[str, Any]]:
        """An observation and its information."""
        seen, mask = self._look(view)
        info: dict[str, Any] = {"time": view.time, "action_mask": mask}
        if self.world.collision is not None:
            info["collision"] = str(self.world.collision)
        return seen, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The junction now: as pixels, or in a window."""
        return self.world.render()

    def close(self) -> None:
        """Close the window."""
        self.world.close()


def box(size: int) -> Any:
    """The space of vectors of numbers from 0 to 1."""
    return spaces.Box(0.0, 1.0, (size,), np.float32)
