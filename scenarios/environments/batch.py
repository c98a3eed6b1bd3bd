"""Many junctions at once: `gymnasium.make_vec("minisim/RightOfWay-v0", num_envs=64)`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import MultiBinary
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from minisim.engine import kernel
from minisim.engine.collision import Collision, collisions_now
from minisim.engine.packed import empty_pack, store
from minisim.engine.state import (
    LANE,
    OBSERVED,
    TRACE,
    VEHICLE,
    build_lanes,
    build_layout,
    build_vehicles,
)
from minisim.errors import InputError, integer
from minisim.jit import direct
from minisim.laws import build_law
from minisim.ticks import first_tick, time_of
from scenarios.environments import compiled
from scenarios.environments.environment import SEEDS, Observation
from scenarios.environments.passing import heeded
from scenarios.environments.right_of_way import LONG, MANY, RightOfWayEnv
from scenarios.environments.world import allowed
from scenarios.scenario import Scenario

Numbers = npt.NDArray[Any]


class RightOfWayBatch(VectorEnv[Observation, npt.NDArray[np.int8], Any]):
    """`RightOfWayEnv` for many junctions that are advanced in one compiled call.

    All have the same scenario, and arrivals of their own. Each gives what a `RightOfWayEnv` of the
    same seed gives. One whose episode is over begins another at the next step.

    Args:
        num_envs: how many junctions.
        scenario, masked, interval, sight: as of `RightOfWayEnv`.

    Raises:
        InputError: a value that is not allowed, or vehicles that follow SUMO's rules.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Scenario | None = None,
        *,
        masked: bool = True,
        interval: float = 1.0,
        sight: float = 50.0,
    ) -> None:
        self.num_envs = integer("num_envs", num_envs, low=1, high=100_000)
        one = self._one = RightOfWayEnv(scenario, masked=masked, interval=interval, sight=sight)
        self.single_action_space = one.action_space
        self.single_observation_space = one.observation_space
        self.action_space = batch_space(one.action_space, num_envs)
        self.observation_space = batch_space(one.observation_space, num_envs)
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}
        site, scenario = one.world.site, one.world.scenario
        if site.vehicle.sumo is not None:
            raise InputError(
                f"a batch cannot drive the vehicles of the profile {scenario.profile.name}, which "
                "follow SUMO's rules; single environments can: vectorization_mode='sync'"
            )
        n, m = site.intersection.n, len(site.intersection.movements)
        self._allowed = MultiBinary((num_envs, m))  # of any kind of numbers, unlike `action_space`
        self._heeded = heeded(site, masked=masked).astype(np.int8)
        self._limits = np.array([site.limit(lane) for lane in range(n)])
        self._scales = np.array([sight, LONG, MANY])
        self._ask, self._taken = np.zeros(n, np.int64), np.zeros(m, np.int8)
        self._stride = first_tick(one.world.interval, site.dt)
        self._horizon = first_tick(scenario.horizon, site.dt)
        self._ticks, self._targets, self._reasons, self._present = (
            np.zeros(num_envs, np.int64) for _ in range(4)
        )
        self._over = np.ones(num_envs, bool)
        self.conflicts = site.conflicts
        self._randoms: list[np.random.Generator | None] = [None] * num_envs
        #: How many vehicles want to come in the present run of each junction.
        self.vehicles = np.zeros(num_envs, np.int64)
        self._seen = np.zeros((num_envs, n * (m // n + 5) + m), np.float32)
        self._masks = np.zeros((num_envs, m), np.int8)
        self._layout = build_layout(site, one.plan)
        self._law = build_law(site, one.plan, scenario.depart_speed)
        self._worlds = self._room(0)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,  # noqa: ARG002  (VectorEnv's)
    ) -> tuple[Observation, dict[str, Any]]:  # fmt: skip
        """Start a run in each junction; with one seed, those of the others count up from it.

        Without a seed, a junction goes on with its own random numbers.

        Raises:
            InputError: there are not as many seeds as junctions.
        """
        if isinstance(seed, Sequence) and not isinstance(seed, str):
            if len(seed) != self.num_envs:
                raise InputError(f"{self.num_envs} junctions need as many seeds, got {len(seed)}")
            seeds = list(seed)
        else:
            if seed is not None:
                seeding.np_random(seed)  # says what is wrong with it
            seeds = [None if seed is None else seed + k for k in range(self.num_envs)]
        for k, its in enumerate(seeds):
            if its is not None or self._randoms[k] is None:
                self._randoms[k], _ = seeding.np_random(its)
        for k in range(self.num_envs):
            self._begin(k)
        self._observe()
        return self._seen.copy(), self._info({})

    def step(
        self, actions: npt.NDArray[np.int8]
    ) -> tuple[Observation, Numbers, Numbers, Numbers, dict[str, Any]]:
        """Act in all junctions, and go on to the next action; those that are over begin again.

        Raises:
            InputError: not a bit for each junction and movement, or no run has begun.
        """
        acting = np.ascontiguousarray(allowed(self._allowed, actions, "actions"), np.int8)
        new, ticks = self._over.copy(), self._ticks
        for k in np.flatnonzero(new).tolist():
            self._begin(k)
        began, acts = ticks.copy(), (~new).astype(np.int8)
        np.minimum(ticks + self._stride * acts, self._horizon, out=self._targets)
        crashes: dict[int, Collision] = {}
        done = self._advance(acting, acts, crashes)
        self._observe()
        crashed = np.zeros(self.num_envs, bool)
        crashed[list(crashes)] = True
        truncated = (ticks >= self._horizon) & ~crashed & ~new
        terminated = crashed | (done & ~truncated)
        self._over = terminated | truncated
        rewards = -self._present * ((ticks - began) * self._law.dt)
        return self._seen.copy(), rewards, terminated, truncated, self._info(crashes)

    def _advance(self, actions: Any, acts: Any, crashes: dict[int, Collision]) -> Numbers:
        """Advance all to their targets, and note collisions; returns which are empty for good."""
        arguments = (
            *self._worlds, self._layout, self._law, *self._scratch, self._heeded, actions, acts,
            self._ask, self._taken, self._scales[0], self._ticks, self._targets, self._reasons,
        )  # fmt: skip
        done = np.zeros(self.num_envs, bool)
        step = direct(compiled.step_all, None, arguments)
        while step(*arguments) or self._reasons.any():
            for k in np.flatnonzero(self._reasons).tolist():
                if self._reasons[k] & kernel.DONE:
                    done[k] = True
                    self._targets[k] = self._ticks[k]
                if self._reasons[k] & (kernel.TOUCH | kernel.GAP) and (found := self._touching(k)):
                    crashes[k] = found
                    self._targets[k] = self._ticks[k]
            self._reasons[:] = 0
            acts[:] = 0
        return done

    def _touching(self, k: int) -> Collision | None:
        """The first collision in a junction now, if there is one."""
        floats, ints, vehicles, lanes = (it[k] for it in self._worlds)
        store(floats, ints, vehicles, lanes)
        site = self._one.world.site
        time = time_of(int(self._ticks[k]), site.dt)
        return next(iter(collisions_now(vehicles, self._layout, site, time)), None)

    def _begin(self, k: int) -> None:
        """Start another run in a junction."""
        random = self._randoms[k]
        if random is None:
            raise InputError("there is no run yet: call reset() first")
        scenario, seed = self._one.world.scenario, int(random.integers(SEEDS))
        site = scenario.site(seed)
        vehicles = build_vehicles(site, scenario.arrivals(seed))
        lanes = build_lanes(site, vehicles, lanes_open=False)
        pack = empty_pack(vehicles, lanes, self._layout)
        if self._worlds[2].shape[1] < len(vehicles):
            self._worlds = self._room(len(vehicles) * 5 // 4)
        for whole, part in zip(self._worlds, (*pack, vehicles, lanes), strict=True):
            whole[k, ..., : part.shape[-1]] = part
        self._ticks[k] = self._targets[k] = 0
        self.vehicles[k] = len(vehicles)
        self._over[k] = False

    def _room(self, most: int) -> tuple[Any, ...]:
        """Arrays of all junctions with room for so many vehicles each, with what is there now."""
        n = self._one.world.site.intersection.n
        vehicles, lanes = np.zeros(most, VEHICLE), np.zeros(n, LANE)
        vehicles["length"] = min(it.length for it in self._one.world.site.types)
        parts = (*empty_pack(vehicles, lanes, self._layout), vehicles, lanes)
        observed = np.zeros(parts[0].shape[1] + 1, OBSERVED)
        self._scratch = np.zeros(0, TRACE), np.zeros((16 * n, 6)), observed
        room = tuple(np.stack([part] * self.num_envs) for part in parts)
        for new, old in zip(room, getattr(self, "_worlds", ()), strict=False):
            new[..., : old.shape[-1]] = old
        return room

    def _observe(self) -> None:
        arguments = (
            *self._worlds, self._layout, self._law, self._heeded, self._limits, self._ask,
            self._taken, self._scales, self._ticks, self._seen, self._masks, self._present,
        )  # fmt: skip
        direct(compiled.observe_all, None, arguments)(*arguments)

    def _info(self, crashes: Mapping[int, Collision]) -> dict[str, Any]:
        every = np.ones(self.num_envs, bool)
        time = np.round(self._ticks * self._law.dt, 6)
        info = {"time": time, "_time": every, "action_mask": self._masks.copy(),
                "_action_mask": every}  # fmt: skip
        if crashes:
            told, which = np.full(self.num_envs, None, object), np.zeros(self.num_envs, bool)
            for k, crash in crashes.items():
                told[k], which[k] = str(crash), True
            info |= {"collision": told, "_collision": which}
        return info
