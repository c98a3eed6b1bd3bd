"""One agent per vehicle, in the form of PettingZoo: each decides for itself whether to go."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from dim import Dim
from dim.perception import ROUNDING
from minisim.control import Observed, View
from minisim.errors import InputError, instance, number, show
from scenarios.environments.environment import SEEDS, Observation, box
from scenarios.environments.passing import Passing
from scenarios.environments.world import PICTURES, World, allowed
from scenarios.scenario import Scenario

#: How much of the roads a picture shows [m].
SHOWN = 60.0

#: An agent by the id of its vehicle.
NAME = "vehicle_{}"


class VehiclesEnv(ParallelEnv[str, Observation, int]):  # type: ignore[misc]  # untyped
    """Each vehicle near the junction is an agent; it sees what DIM's vehicles see.

    Roads are marked as for DIM. An agent comes when its front bumper reaches the yellow zone, and
    is terminated when its rear has left the junction. While no agent is there, time passes without
    a step.

    Action: `Discrete(2)`, wait or go. It counts for the first vehicle of a lane while it can still
    be held.

    Observation, all from 0 to 1: for each lane, beginning with the vehicle's own and clockwise, of
    its first vehicle before the junction that can still be held: whether there is one, its distance
    by the length of the zone, its speed by the limit, and its manoeuvre, one-hot. Then, in the same
    order of lanes, for each movement whether a vehicle on it is settled: inside, or too close to
    stop. At last, whether the vehicle itself is asked, and whether it is settled. This is what
    DIM's Algorithm 1 decides on, so DIM can be learnt.

    The reward of a step is minus the seconds for which the vehicle was there. A collision ends the
    episode for all; those that touched also lose `crash`.

    Args:
        scenario: what to simulate.
        masked: of vehicles that want to go, only those go that do not conflict, those that have
            waited longest first. If not masked, all go.
        interval: time between two actions [s].
        crash: what a collision costs each vehicle that it harms [s].
        render_mode: None, "rgb_array" or "human".

    `infos[agent]["action_mask"]` says whether the agent may wait, and whether it may go.
    """

    metadata: ClassVar[dict[str, Any]] = {
        **PICTURES, "name": "minisim_vehicles_v0", "is_parallelizable": True,
    }  # fmt: skip

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        masked: bool = True,
        interval: float = 1.0,
        crash: float = 1000.0,
        render_mode: str | None = None,
    ) -> None:
        instance("masked", masked, bool)
        self.world = World(scenario, interval, render_mode)
        self._masked, self._crash = masked, number("crash [s]", crash, above=0, high=1e6)
        self.render_mode = render_mode
        self._n = self.world.site.intersection.n
        self._turns = self._n - 1
        dim = Dim()
        self._zone = dim.zones.yellow_start + ROUNDING
        sight = min(SHOWN, self.world.road)
        self.plan = dataclasses.replace(dim.start(self.world.site).plan, sight=sight)
        self._space = box(self._n * (3 + self._turns) + self._n * self._turns + 2)
        self._actions = spaces.Discrete(2)
        self._random, _ = seeding.np_random()
        self.agents: list[str] = []
        self._vehicles = len(self.world.scenario.arrivals(0))

    @property
    def possible_agents(self) -> list[str]:
        """All vehicles of the present run."""
        return [NAME.format(k) for k in range(self._vehicles)]

    def observation_space(self, agent: str) -> Any:  # noqa: ARG002  (ParallelEnv's)
        """The same for all."""
        return self._space

    def action_space(self, agent: str) -> spaces.Discrete:  # noqa: ARG002  (ParallelEnv's)
        """The same for all."""
        return self._actions

    def reset(
        self,
        seed: int | None = None,
        options: Mapping[str, Any] | None = None,  # noqa: ARG002
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start a run with new arrivals, and let time pass until the first agent is there."""
        if seed is not None:
            self._random, _ = seeding.np_random(seed)
        world = self.world
        site = world.begin(self.plan, int(self._random.integers(SEEDS)))
        self._vehicles = len(world.sim.arrivals)
        self._passing = Passing(site, self._zone, masked=self._masked)
        view = self._wait()
        world.show()
        self.agents = [NAME.format(v.id) for v in view.vehicles]
        return self._look(view)

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool],
        dict[str, dict[str, Any]],
    ]:  # fmt: skip
        """Act, and go on until the next action, or until an agent is there.

        Raises:
            InputError: there is not one action of its space for each agent, or no episode goes on.
        """
        world, before = self.world, self.agents
        go = self._going(actions)
        began = world.sim.time
        wished = self._passing.commands(self._junction, lambda v: NAME.format(v.id) in go)
        world.sim.command(*wished)
        world.sim.run_until("collision", before=world.next_action)
        spent = world.sim.time - began
        view = self._wait()
        crash, over = world.collision, world.sim.finished
        observations, infos = self._look(view)
        ends = over or crash is not None
        there = [agent for agent in observations if agent not in before and not ends]
        rewards = dict.fromkeys(before, -spent) | dict.fromkeys(there, 0.0)
        gone = {agent for agent in before if agent not in observations}
        terminated = {agent: agent in gone or crash is not None for agent in rewards}
        truncated = {agent: over and not terminated[agent] for agent in rewards}
        for agent in gone:
            observations[agent] = np.zeros(self._space.shape, np.float32)
            infos[agent] = {"action_mask": np.array([1, 0], np.int8)}
        observations = {agent: observations[agent] for agent in rewards}
        infos = {agent: infos[agent] for agent in rewards}
        if crash is not None:
            for vehicle in crash.vehicles:
                agent = NAME.format(vehicle)
                if agent in rewards:
                    rewards[agent] -= self._crash
            for info in infos.values():
                info["collision"] = str(crash)
        self.agents = [a for a in rewards if not (terminated[a] or truncated[a])]
        world.show()
        return observations, rewards, terminated, truncated, infos

    def _going(self, actions: Mapping[str, int]) -> set[str]:
        """The agents that want to go; raises `InputError` as `step` does."""
        self.world.check_going()
        instance("actions", actions, Mapping)
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise InputError(f"each agent needs an action, and {missing[0]} has none")
        if unknown := [agent for agent in actions if agent not in self.agents]:
            raise InputError(
                f"{show(unknown[0])} is no agent now; allowed: {', '.join(self.agents)}"
            )
        return {
            agent for agent, action in actions.items()
            if allowed(self._actions, action, f"the action of {agent}")
        }  # fmt: skip

    def _near(self) -> View:
        """The vehicles that are agents now."""
        view = self.world.sim.view()
        return view._replace(vehicles=tuple(v for v in view.vehicles if v.distance <= self._zone))

    def _wait(self) -> View:
        """Let time pass while no agent is there."""
        view, sim = self._near(), self.world.sim
        while not view.vehicles and not sim.finished:
            sim.advance(self.world.next_action)
            view = self._near()
        return view

    def _look(self, view: View) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """What each agent sees, and what it may do."""
        junction = self._junction = self._passing.look(view)
        first = np.zeros((self._n, 3 + self._turns), np.float32)
        settled = np.zeros((self._n, self._turns), np.float32)
        asked = {v.id for v in junction.asking}
        sure = {v.id for v in junction.settled}
        for v in junction.asking:
            limit = self.world.site.limit(v.lane)
            first[v.lane, :3] = 1.0, v.distance / self._zone, v.speed / limit
            first[v.lane, 2 + v.manoeuvre] = 1.0
        for v in junction.settled:
            settled[v.lane, v.manoeuvre - 1] = 1.0
        np.minimum(first, 1.0, out=first)
        by_lane = [
            np.concatenate([np.roll(it, -lane, axis=0).ravel() for it in (first, settled)])
            for lane in range(self._n)
        ]
        observations, infos = {}, {}
        for v in view.vehicles:
            agent, own = NAME.format(v.id), np.array([v.id in asked, v.id in sure], np.float32)
            observations[agent] = np.concatenate([by_lane[v.lane], own])
            infos[agent] = {"action_mask": self._mask(v, asked, sure, junction.settled)}
        return observations, infos

    def _mask(
        self, v: Observed, asked: set[int], sure: set[int], settled: list[Observed]
    ) -> npt.NDArray[np.int8]:
        if v.id in sure:
            return np.array([0, 1], np.int8)
        may = v.id in asked and self._passing.possible(v, settled)
        return np.array([1, may], np.int8)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """The junction now: as pixels, or in a window."""
        return self.world.render()

    def close(self) -> None:
        """Close the window."""
        self.world.close()
