"""`minisim/RightOfWay-v0`: which movements may go."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from minisim.control import HALTING, Plan, Site, View
from minisim.errors import instance, number
from scenarios.environments.environment import Environment, Observation, box
from scenarios.environments.passing import Junction, Passing
from scenarios.scenario import Scenario

#: What counts as far, long and many, where an observation is 1 [m], [s], vehicles.
LONG, MANY = 60.0, 10.0


class RightOfWayEnv(Environment):
    """The agent says every second which movements may go.

    The first vehicle of each lane gets the right of way if it is at most `sight` before the
    junction and its movement is chosen. It loses it if its movement no longer is, while it can
    still stop.

    Action: `MultiBinary(m)`, a bit per movement in the order of `Intersection.movements`.

    Observation, all from 0 to 1: for each lane, of its first vehicle that can still be held and is
    in sight: whether there is one; its distance by `sight`; its speed by the limit; the time since
    it wanted to come, by a minute; its manoeuvre, one-hot; and how many vehicles of the lane stand,
    by ten. Then for each movement, whether a vehicle on it is settled: inside the junction, or too
    close to stop.

    Args:
        scenario: what to simulate.
        masked: leave out what is not safe. Of chosen movements that conflict, the one whose vehicle
            has waited longest goes; none goes that conflicts with a settled one. If not masked, all
            that are chosen go, and the first collision ends the episode.
        interval: time between two actions [s].
        sight: how far before the junction a vehicle is seen and may get the right of way [m].
        render_mode: None, "rgb_array" or "human".

    `info["action_mask"]` says of each movement whether a vehicle asks for it that may go now.
    """

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        masked: bool = True,
        interval: float = 1.0,
        sight: float = 50.0,
        render_mode: str | None = None,
    ) -> None:
        super().__init__(scenario, interval, render_mode)
        instance("masked", masked, bool)
        self._sight, self._masked = number("sight [m]", sight, above=0, high=1000), masked
        intersection = self.world.site.intersection
        self._n, self._m = intersection.n, len(intersection.movements)
        self._turns = self._n - 1
        self.action_space = spaces.MultiBinary(self._m)
        self.observation_space = box(self._n * (5 + self._turns) + self._m)

    @property
    def plan(self) -> Plan:
        """The whole road is in view, so that all vehicles can be counted."""
        return Plan(sight=self.world.road)

    def _start(self) -> None:
        self._passing = Passing(self.world.site, self._sight, masked=self._masked)

    def _act(self, action: npt.NDArray[Any]) -> None:
        world, passing, chosen = self.world, self._passing, action.tolist()
        wished = passing.commands(self._junction, lambda v: bool(chosen[passing.movement(v)]))
        world.sim.command(*wished)
        world.sim.run_until("collision", before=world.next_action)

    def _look(self, view: View) -> tuple[Observation, npt.NDArray[np.int8]]:
        passing, mask = self._passing, np.zeros(self._m, np.int8)
        junction = self._junction = passing.look(view)
        for v in junction.asking:
            mask[passing.movement(v)] = passing.possible(v, junction.settled)
        return observed(view, junction, self.world.site, self._sight), mask


def observed(view: View, junction: Junction, site: Site, sight: float) -> Observation:
    """What the agent of `RightOfWayEnv` sees of a view that shows the whole road."""
    n, m = site.intersection.n, len(site.intersection.movements)
    width = 5 + m // n
    seen = np.zeros(n * width + m, np.float32)
    rows = site.intersection.movements.rows
    for v in junction.asking:
        at = v.lane * width
        waited = (view.time - v.demand_time) / LONG
        seen[at : at + 4] = 1.0, v.distance / sight, v.speed / site.limit(v.lane), waited
        seen[at + 3 + v.manoeuvre] = 1.0
    for v in view.vehicles:
        if v.speed <= HALTING and v.distance >= 0.0:
            seen[v.lane * width + width - 1] += 1.0 / MANY
    for v in junction.settled:
        seen[n * width + rows[v.lane][v.manoeuvre]] = 1.0
    return np.minimum(seen, 1.0)
