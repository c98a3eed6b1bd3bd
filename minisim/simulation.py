"""`Simulation`, the one mutable object of a run, and `simulate`, which makes one and runs it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from functools import partial

import numpy as np

from minisim.control import (
    NO_REPORTS,
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
from minisim.engine.collision import Collision, collisions_now
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
from minisim.errors import InputError, choice, number
from minisim.hosting import AFTERMATH, REACTIONS, Alarm, Hosted, begin
from minisim.jit import direct
from minisim.laws import build_law
from minisim.results.run import Run, ScenarioLike
from minisim.results.trips import collect_trips
from minisim.ticks import NEVER, first_tick, time_of
from minisim.vehicle import CruiseVehicle

#: `Observed._make` without its check of the number of fields, which `OBSERVED` guarantees.
_as_observed: Callable[[Iterable[float]], Observed] = partial(tuple.__new__, Observed)


#: Of `Simulation.run_until`.
EVENTS = ("wake", "collision")


class Simulation:
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
        self._hosted = hosted = begin(
            scenario, controller, seed, record=record, record_window=record_window,
            on_collision=on_collision, reactions=REACTIONS, timed=timed, explain=explain,
        )  # fmt: skip
        self.site, plan = hosted.site, hosted.plan
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
        self._collisions: dict[tuple[int, int], Collision] = {}
        self._horizon_tick = first_tick(scenario.horizon, self.site.dt)
        self._alarm = Alarm(plan.period, self.site.dt)
        self._stride = 1 if explain else NEVER  # most steps between two looks for reasons
        self._given: list[tuple[int, tuple[Command, ...]]] = []  # commands from outside, by tick
        self._started = False
        self._done = False
        self.tick = 0

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return time_of(self.tick, self.site.dt)

    @property
    def finished(self) -> bool:
        """Whether the horizon is reached or every vehicle has arrived."""
        return self._done or self.tick >= self._horizon_tick

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """The collisions so far, each pair of vehicles once."""
        return tuple(self._collisions.values())

    def advance(self, until: float) -> None:
        """Advance to time `until` [s], to the horizon, or to the last arrival.

        Raises:
            CollisionError: two bodies touched, unless collisions are only recorded.
            ControllerError: the controller answered with something that is not a command.
        """
        until = number("until [s]", until, low=0)
        for _ in self._stretches(first_tick(until, self.site.dt)):
            pass

    def run_until(self, event: float | str | Callable[[Simulation], bool]) -> bool:
        """Advance until something happens, or to the end of the run.

        Args:
            event: a time [s]; "wake", whenever the plan wakes the session, first at time 0;
                "collision", when one is recorded; or a function that is asked after each step.

        Returns:
            Whether it happened. If not, the run is over.

        Raises:
            InputError: no such event.
            CollisionError, ControllerError: as `advance` raises them.
        """
        if not isinstance(event, str) and not callable(event):
            self.advance(event)
            return self.tick >= first_tick(event, self.site.dt)
        by_step, before = callable(event), len(self._collisions)
        if isinstance(event, str):
            choice("event", event, EVENTS)
        for woken in self._stretches(self._horizon_tick, 1 if by_step else NEVER):
            if callable(event):
                happened = event(self)
            else:
                happened = woken if event == "wake" else len(self._collisions) > before
            if happened:
                return True
        return False

    def command(self, *commands: Command) -> None:
        """Carry out commands from outside; what is set at a time acts from the next step on.

        If the session is woken at the same time, it has decided before, so these count.

        Raises:
            InputError: one of them cannot be carried out; then none is.
        """
        self._hosted.take(commands, self.tick)
        self._begin()
        self._given.append((self.tick, commands))
        for command in commands:
            self._apply(command)

    def fork(self) -> Simulation:
        """A copy that goes on by itself: left alone, both give identical trips.

        It shares what no run changes (scenario, controller, site, arrivals) and copies the rest,
        the session with its random streams included. What a session keeps must be in attributes: a
        closure or a generator cannot be copied.
        """
        hosted = self._hosted
        shared = (
            hosted.scenario, hosted.controller, hosted.arrivals, hosted.plan,
            self.site, self._layout, self._law, NO_REPORTS,
        )  # fmt: skip
        return deepcopy(self, {id(it): it for it in shared})

    def _begin(self) -> bool:
        """Ask the session for the first time; returns whether it is now."""
        if self._started:
            return False
        self._started = True
        self._decide()
        return True

    def _stretches(self, target: int, most: int = NEVER) -> Iterator[bool]:
        """Advance, at most `most` steps at once; yields each time whether the session was woken."""
        if self._begin():
            yield True
        target = min(target, self._horizon_tick)
        world = *self._pack, self._vehicles, self._lanes, self._layout, self._law, self._cruise
        scratch = self._trace, self._bodies, self._observed
        step = direct(
            kernel.advance, self._cruise is None, (*world, *scratch, self._traced, self.tick, 0)
        )
        while self.tick < target and not self._done:
            end = min(target, self._alarm.tick, self.tick + min(most, self._stride))
            self.tick, reasons, self._traced, self._seen = step(
                *world, *scratch, self._traced, self.tick, end
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

    def run(self) -> Run:
        """Advance to the end and return the result."""
        self.advance(self._horizon_tick * self.site.dt)
        return self.result()

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
            columns=collect_trips(self._vehicles[self._row], demand, movements, self.site.dt, end),
            trace=np.concatenate([*self._traces, self._trace[:0]]),
            rows=self._vehicles[["id", "path", "type"]].copy(),
            given=tuple(self._given),
        )

    def _decide(self) -> None:
        self._alarm.reset(self.tick)
        for command in self._hosted.ask(self.view(), self.tick):
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


def _replay(
    hosted: Hosted,
    given: tuple[tuple[int, tuple[Command, ...]], ...],
    time: float,
    seconds: float = 10.0,
) -> Run:
    """Run again until shortly after `time`; record the last `seconds` before it.

    Commands `given` from outside are given again at their ticks.
    """
    again = Simulation(
        hosted.scenario,
        hosted.controller,
        seed=hosted.seed,
        record="all",
        record_window=(max(0.0, time - seconds), math.inf),
        on_collision="record",
    )
    for tick, commands in given:
        again.advance(time_of(tick, again.site.dt))
        again.command(*commands)
    again.advance(time + AFTERMATH)
    return again.result()


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
