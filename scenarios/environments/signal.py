"""`minisim/Signal-v0`: which phase of a signal is green."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from baselines.signals.permitted import PermittedHeads
from baselines.signals.phases import PhaseSession, Verdict, on_detector
from minisim.control import HALTING, Plan, Site, View
from minisim.errors import instance, number
from scenarios.environments.environment import Environment, Observation, box
from scenarios.scenario import Scenario

#: Length of the detectors, as of `baselines.signals.max_pressure.MaxPressure` [m].
DETECTOR = 100.0


class ChosenPhase(PhaseSession):
    """A signal whose next phase is `chosen` from outside; it holds to its shortest green."""

    def __init__(self, site: Site, min_green: float, amber: float, *, facing: bool) -> None:
        super().__init__(
            site, DETECTOR, min_green, amber,
            facing=PermittedHeads(site, "minisim/Signal-v0") if facing else None,
        )  # fmt: skip
        self.phases = list(self._phases.values())
        self.chosen = 0

    @property
    def shown(self) -> int:
        """The phase that is green, or that becomes green next."""
        lane = self._lane if self._began is not None else self._next
        return list(self._phases).index(lane)

    def may_change(self, time: float) -> bool:
        """Whether another phase may begin now."""
        return self._began is not None and time - self._began >= self._min_green - self._early

    def see(self, view: View) -> None:
        """Change as soon as the shortest green is over, if another phase is chosen."""
        if self._began is not None and self.chosen != self.shown:
            self._due = max(view.time, self._began + self._min_green)

    def judge(self, view: View, lane: int, elapsed: float) -> Verdict:  # noqa: ARG002  (as in base)
        """Go on to the chosen phase, or stay for good."""
        return Verdict(self.phases[self.chosen][0], math.inf)


class SignalEnv(Environment):
    """The agent says every five seconds which phase shall be green.

    Between two phases there are amber and then red for all, until the way is clear; a phase is
    green for `min_green` at least. So a change takes time, and one that is asked for during it
    comes after it.

    Action: `Discrete(phases)`. A phase is an approach, in the order a, b, c…, or if `facing` two
    that face each other.

    Observation, all from 0 to 1: the phase that is green or becomes green next, one-hot; whether
    another one may begin now; for each lane, the share of a 100 m detector on which vehicles are,
    and the share on which they stand, each vehicle with its gap at standstill.

    Args:
        scenario: what to simulate.
        interval: time between two actions [s].
        min_green: shortest green [s].
        amber: amber after each green [s].
        facing: whether approaches that face each other are one phase; far turns then wait for gaps.
        render_mode: None, "rgb_array" or "human".

    `info["action_mask"]` says which phases can be green next: all, or during a change only the one
    that is coming, and before the end of the shortest green the present one.
    """

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        interval: float = 5.0,
        min_green: float = 5.0,
        amber: float = 2.0,
        facing: bool = False,
        render_mode: str | None = None,
    ) -> None:
        super().__init__(scenario, interval, render_mode)
        instance("facing", facing, bool)
        self._timing = (
            number("min_green [s]", min_green, above=0, high=3600),
            number("amber [s]", amber, low=0, high=60),
        )
        self._facing = facing
        self._session = self._new()
        self._p, self._n = len(self._session.phases), self.world.site.intersection.n
        vehicle = self.world.site.vehicle
        self._capacity = DETECTOR / (vehicle.length + vehicle.min_gap)
        self.action_space = spaces.Discrete(self._p)
        self.observation_space = box(self._p + 1 + 2 * self._n)

    def _new(self) -> ChosenPhase:
        return ChosenPhase(self.world.site, *self._timing, facing=self._facing)

    @property
    def plan(self) -> Plan:
        """The signal's, but the whole road is in view, so that all vehicles can be counted."""
        own = self._session.plan
        return Plan(
            marks=own.marks, wake_on_clear=own.wake_on_clear, reach=own.reach,
            sight=self.world.road,
        )  # fmt: skip

    def _start(self) -> None:
        self._session = self._new()
        self._decide()

    def _decide(self) -> None:
        sim = self.world.sim
        sim.command(*self._session.decide(sim.view()))

    def _act(self, action: npt.NDArray[Any]) -> None:
        sim, end = self.world.sim, self.world.next_action
        self._session.chosen = int(action)
        self._decide()
        while sim.run_until("wake", before=end) and not self.world.collision:
            self._decide()

    def _look(self, view: View) -> tuple[Observation, npt.NDArray[np.int8]]:
        mask = np.zeros(self._p, np.int8)
        mask[:] = self._session.may_change(view.time)
        mask[self._session.shown] = 1
        return self._observed(view), mask

    def _observed(self, view: View) -> Observation:
        seen = np.zeros(self._p + 1 + 2 * self._n, np.float32)
        seen[self._session.shown] = 1.0
        seen[self._p] = self._session.may_change(view.time)
        for v in on_detector(view, DETECTOR):
            if v.distance >= 0.0:
                seen[self._p + 1 + v.lane] += 1.0 / self._capacity
                if v.speed <= HALTING:
                    seen[self._p + 1 + self._n + v.lane] += 1.0 / self._capacity
        return np.minimum(seen, 1.0)
