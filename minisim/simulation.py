"""`Simulation`, the one mutable object of a run, and `simulate`, which makes one and runs it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from functools import partial

import numpy as np

from minisim.control import (
    Accelerate,
    Advise,
    Brake,
    Close,
    Command,
    Controller,
    Go,
    Hold,
    Observed,
    Open,
    View,
    Wake,
)
from minisim.engine import kernel
from minisim.engine.collision import collisions_now
from minisim.engine.cruise.law import build_cruise
from minisim.engine.moving import CLEAR, MARKED
from minisim.engine.packed import empty_pack, store
from minisim.engine.state import (
    AMBER,
    OBSERVED,
    TRACE,
    Records,
    build_lanes,
    build_layout,
    build_vehicles,
)
from minisim.errors import InputError
from minisim.hosting import AFTERMATH, REACTIONS, Alarm, Hosted, begin
from minisim.jit import direct
from minisim.laws import build_law
from minisim.results.run import Given, Run, ScenarioLike
from minisim.results.trips import collect_trips
from minisim.stepping import Stepped, repeated
from minisim.ticks import NEVER
from minisim.vehicle import CruiseVehicle

#: `Observed._make` without its check of the number of fields, which `OBSERVED` guarantees.
_as_observed: Callable[[Iterable[float]], Observed] = partial(tuple.__new__, Observed)


class Simulation(Stepped):
    """One run: vehicles on their paths, advanced under a controller.

    Args:
        scenario: what to simulate.
        controller: what decides; its session is private to this run.
        seed: seed of the run's random streams.
        record: None, "junction" (60 m before it to 30 m past it) or "all": keep trajectories.
        record_window: start and end of the recording [s].
        on_collision: "stop" raises `CollisionError`; "record" notes each pair once and goes on.
            "teleport", for a `CruiseVehicle` only, also lets a vehicle closer than `min_gap` to
            the one ahead on its exit arrive, as SUMO did in the published runs.
        timed: keep the CPU time of each decision (`Run.decision_times`).
        explain: write down at each step why each vehicle in view waits or goes (`Run.reasons`), and
            what signal heads show (`Run.heads`). The trips stay the same.

    Raises:
        InputError: a value that is not allowed, or a scenario that the controller cannot serve.
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        controller: Controller,
        *,
        seed: int = 0,
        record: str | None = None,
        record_window: tuple[float, float] = (0.0, math.inf),
        on_collision: str = "stop",
        timed: bool = False,
        explain: bool = False,
    ) -> None:
        hosted = begin(
            scenario, controller, seed, record=record, record_window=record_window,
            on_collision=on_collision, reactions=REACTIONS, timed=timed, explain=explain,
        )  # fmt: skip
        super().__init__(hosted)
        plan = hosted.plan
        teleports = on_collision == "teleport"
        if teleports and not isinstance(self.site.vehicle, CruiseVehicle):
            raise InputError("on_collision 'teleport' needs a CruiseVehicle")
        self._layout = build_layout(self.site, plan)
        self._law = build_law(self.site, plan, scenario.depart_speed, record, hosted.record_window)
        self._vehicles = build_vehicles(self.site, hosted.arrivals)
        self._cruise = build_cruise(self.site, len(self._vehicles), teleports)
        self._lanes = build_lanes(self.site, self._vehicles, plan.lanes_open)
        self._pack = empty_pack(self._vehicles, self._lanes, self._layout)
        self._row = np.argsort(self._vehicles["id"]).tolist()
        self._trace = np.zeros(4096 + 2 * len(self._vehicles) if record else 0, TRACE)
        self._traces: list[Records] = []
        self._traced = 0
        self._bodies = np.zeros((16 * self.site.intersection.n, 6))
        self._observed = np.zeros(len(self._vehicles) + 1, OBSERVED)
        self._seen = 0
        self._alarm = Alarm(plan.period, self.site.dt)

    def fork(self) -> Simulation:
        """A copy that goes on by itself: left alone, both give identical trips.

        It shares what no run changes (scenario, controller, site, arrivals) and copies the rest,
        the session with its random streams included. What a session keeps must be in attributes: a
        closure or a generator cannot be copied.
        """
        shared = *self._hosted.shared, self._layout, self._law
        return deepcopy(self, {id(it): it for it in shared})

    def _stretches(self, target: int, most: int = NEVER) -> Iterator[bool]:
        """Advance, at most `most` steps at once; yields each time whether the session was woken."""
        if self._begin():
            yield True
        target = min(target, self._horizon_tick)
        world = *self._pack, self._vehicles, self._lanes, self._layout, self._law, self._cruise
        scratch = self._trace, self._bodies, self._observed
        step = direct(
            kernel.advance, self._cruise is None, (*world, *scratch, self._traced, self.tick, 0, 0)
        )
        while self.tick < target and not self._done:
            end = min(target, self._alarm.tick, self.tick + min(most, self._stride))
            self.tick, reasons, self._traced, self._seen = step(
                *world, *scratch, self._traced, self.tick, end, self._alarm.heeds
            )
            if reasons & kernel.TRACE_FULL:
                self._keep_trace()
            if reasons & (kernel.TOUCH | kernel.GAP):
                self._check_collisions()
            self._done = bool(reasons & kernel.DONE)
            woken = self.tick >= self._alarm.tick or bool(reasons & (MARKED | CLEAR))
            if woken:
                self._decide()
            elif self._hosted.witness is not None:
                self._hosted.look(self.view())
            yield woken

    def view(self) -> View:
        """What a session would be shown now; steps change it, commands do not."""
        return View(self.time, tuple(map(_as_observed, self._observed[: self._seen].tolist())))

    def result(self) -> Run:
        """The result so far."""
        self._keep_trace()
        store(*self._pack, self._vehicles, self._lanes)
        end = self._horizon_tick * self.site.dt if self._done else self.time
        demand, movements = self._hosted.arrivals.time, self.site.intersection.movements
        return self._hosted.result(
            collisions=self.collisions,
            columns=collect_trips(
                self._vehicles.take(self._row), demand, movements, self.site.dt, end
            ),
            trace=np.concatenate(self._traces) if self._traces[1:] else self._traces[0],
            rows=self._vehicles[["id", "path", "type"]].copy(),
            given=tuple(self._given),
        )

    def _decide(self) -> None:
        self._alarm.reset(self.tick)
        self._carry_out(self._hosted.ask(self.view(), self.tick))

    def _carry_out(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self._apply(command)

    def _apply(self, command: Command) -> None:
        match command:
            case Advise(vehicle, speed):
                self._vehicles["advice"][self._row[vehicle]] = speed
            case Brake(vehicle, asked) if not self._vehicles["cleared"][self._row[vehicle]]:
                limited = min(asked, float(self._vehicles["b_max"][self._row[vehicle]]))
                brake = -limited if limited > 0.0 else math.inf
                self._vehicles["brake"][self._row[vehicle]] = brake
            case Accelerate(vehicle, told) if not self._vehicles["cleared"][self._row[vehicle]]:
                self._vehicles["told"][self._row[vehicle]] = told
            case Go(vehicle) | Hold(vehicle):
                self._vehicles["go"][self._row[vehicle]] = isinstance(command, Go)
            case Open(lane, amber):
                self._lanes["open"][lane] = AMBER if amber else 1
            case Close(lane):
                self._lanes["open"][lane] = 0
            case Wake():
                self._alarm.set(command)

    def _check_collisions(self) -> None:
        store(*self._pack, self._vehicles, self._lanes)
        now = collisions_now(self._vehicles, self._layout, self.site, self.time)
        new = {it.vehicles: it for it in now if it.vehicles not in self._collisions}
        self._collisions |= new
        if new and self._hosted.on_collision == "stop":
            replay = partial(_replay, self._hosted, tuple(self._given), self.time)
            raise self._hosted.collided(list(new.values()), replay)

    def _keep_trace(self) -> None:
        self._traces.append(self._trace[: self._traced].copy())
        self._traced = 0


def _replay(hosted: Hosted, given: tuple[Given, ...], time: float, seconds: float = 10.0) -> Run:
    """Run again until shortly after `time`; record the last `seconds` before it."""
    again = Simulation(
        hosted.scenario,
        hosted.controller,
        seed=hosted.seed,
        record="all",
        record_window=(max(0.0, time - seconds), math.inf),
        on_collision="record",
    )
    return repeated(again, given, time + AFTERMATH)


def simulate(
    scenario: ScenarioLike,
    controller: Controller,
    seed: int = 0,
    *,
    record: str | None = None,
    record_window: tuple[float, float] = (0.0, math.inf),
    on_collision: str = "stop",
    timed: bool = False,
    explain: bool = False,
) -> Run:
    """Run a scenario under a controller; see `Simulation` for the arguments and errors.

    Example:
        >>> from minisim.testing import small_scenario
        >>> from minisim.control import Unregulated
        >>> simulate(small_scenario(density=0), Unregulated()).summary()["trips"]
        0
    """
    return Simulation(
        scenario,
        controller,
        seed=seed,
        record=record,
        record_window=record_window,
        on_collision=on_collision,
        timed=timed,
        explain=explain,
    ).run()
