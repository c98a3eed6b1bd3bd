"""`Simulation` in SUMO, and `simulate`, which makes one and runs it."""

from __future__ import annotations

import math
import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from copy import copy, deepcopy
from functools import partial
from typing import Self

from minisim.control import Command, Controller, Observed, View
from minisim.errors import SumoError, choice
from minisim.files import replacing
from minisim.hosting import AFTERMATH, REACTIONS, Hosted, begin
from minisim.results.run import Given, Run, ScenarioLike
from minisim.stepping import Stepped, repeated
from minisim.sumo.files import FCD, read_trips
from minisim.sumo.messages import Asked, Ended, Proceed
from minisim.sumo.network import sumo_home
from minisim.sumo.prepare import MODELS, Folder, Options, Progress, prepare
from minisim.sumo.process import Process, started
from minisim.ticks import NEVER


class Simulation(Stepped):
    """One run in SUMO, driven as `minisim.simulation.Simulation` is.

    It has a process and, unless `keep_files` is given, a temporary folder: close it, best by
    `with Simulation(...) as sim`. The arguments and errors are those of `simulate`.
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        controller: Controller,
        *,
        seed: int = 0,
        model: str | None = None,
        record: str | None = None,
        record_window: tuple[float, float] = (0.0, math.inf),
        on_collision: str = "stop",
        timed: bool = False,
        explain: bool = False,
        keep_files: str | os.PathLike[str] | None = None,
        fcd: str | os.PathLike[str] | None = None,
        gui: bool = False,
        progress: Progress | None = None,
    ) -> None:
        home = sumo_home()
        if model is not None:
            choice("SUMO model", model, MODELS)
        if gui:
            _check_display()
        hosted = begin(
            scenario, controller, seed, record=record, record_window=record_window,
            on_collision=on_collision, reactions=REACTIONS, timed=timed, explain=explain,
        )  # fmt: skip
        super().__init__(hosted)
        self._options = Options(home, model, keep_files, fcd, gui, progress)
        self._folder = Folder(keep_files)
        try:
            self._job = prepare(hosted, self._options, self._folder.path)
        except BaseException as error:
            self._folder.close(error)
            raise
        self._process: Process | None = None
        self._vehicles: tuple[Observed, ...] = ()
        self._orders: list[Command] = []  # to be carried out in the next step
        self._ended: Ended | None = None
        self._run: Run | None = None

    def close(self, error: BaseException | None = None) -> None:
        """End SUMO's process, and remove its files unless they are to be kept."""
        if self._process is not None:
            self._process.close()
        self._folder.close(error)

    def view(self) -> View:
        """What a session would be shown now; steps change it, commands do not."""
        return View(self.time, self._vehicles)

    def fork(self) -> Self:
        """A copy that goes on by itself: left alone, both give identical trips.

        SUMO's process is forked, so this works on Linux only and without the GUI. The copy's files
        are temporary: close it, too. What a session keeps must be in attributes: a closure or a
        generator cannot be copied.

        Raises:
            SumoError: this system cannot do it, or the run is shown in sumo-gui.
        """
        if self._options.gui or not sys.platform.startswith("linux"):
            raise SumoError("a run in SUMO can be forked on Linux only, and not in sumo-gui")
        self._begin()
        if self._ended is not None:
            self.result()  # from files that the copy does not have
        twin = copy(self)
        twin._hosted = deepcopy(self._hosted, {id(it): it for it in self._hosted.shared})
        twin._given, twin._orders = self._given.copy(), self._orders.copy()
        twin._collisions = self._collisions.copy()
        twin._options = self._options._replace(keep_files=None, fcd=None, progress=None)
        twin._folder = Folder(None)
        twin._job = self._job._replace(folder=str(twin._folder.path))
        if self._process is not None and self._ended is None:
            twin._process = self._process.fork(twin._folder.path)
        return twin

    def result(self) -> Run:
        """The result so far. SUMO writes its trips at the end, so this ends the run."""
        self._begin()
        if self._ended is None:
            self._proceed(None)
        if self._run is None:
            self._run = self._result()
        return self._run

    def _result(self) -> Run:
        assert self._ended is not None
        assert self._process is not None
        folder, fcd, ended = self._folder.path, self._options.fcd, self._ended
        columns = read_trips(folder, self._hosted.arrivals, self._job, ended)
        if fcd is not None:
            with replacing(fcd) as target:
                shutil.copyfile(folder / FCD, target)
        host = {"host": "sumo", "sumo": self._process.version, "sumo_model": self._job.model}
        return self._hosted.result(
            collisions=self.collisions,
            columns=columns,
            trace=ended.trace,
            rows=self._job.vehicles[["id", "path", "type"]].copy(),
            given=tuple(self._given),
            host=host,
        )

    def _decide(self) -> None:
        """Start SUMO, which stops before its first step."""
        self._process, first = started(self._job, self._options.home)
        self._meet(first)

    def _stretches(self, target: int, most: int = NEVER) -> Iterator[bool]:
        if self._begin():
            yield True
        target = min(target, self._horizon_tick)
        while self.tick < target and not self._done:
            until = min(target, self.tick + min(most, self._stride))
            yield self._proceed(Proceed(self._orders, until))

    def _carry_out(self, commands: Iterable[Command]) -> None:
        self._orders += commands

    def _proceed(self, order: Proceed | None) -> bool:
        """Have SUMO go on, or end; returns whether the session was woken then."""
        assert self._process is not None
        stopped = self._process.ask(order)
        self._orders = []
        return self._meet(stopped)

    def _meet(self, stopped: Asked | Ended) -> bool:
        """Take over what SUMO shows, and ask the session if it is to be woken."""
        self.tick, self._vehicles = stopped.tick, stopped.vehicles
        self._collisions |= {it.vehicles: it for it in stopped.collisions}
        if isinstance(stopped, Ended):
            self._ended, self._done = stopped, True
            if stopped.collisions and self._job.stop_on_collision:
                replay = partial(
                    _replay, self._hosted, self._options, tuple(self._given), self.time
                )
                raise self._hosted.collided(stopped.collisions, replay)
            return False
        if self._options.progress is not None:
            self._options.progress(self.tick, self._horizon_tick)
        if stopped.woken:
            self._carry_out(self._hosted.ask(self.view(), self.tick))
        elif self._hosted.witness is not None:
            self._hosted.look(self.view())
        return stopped.woken


def _replay(
    hosted: Hosted, options: Options, given: tuple[Given, ...], time: float, seconds: float = 10.0
) -> Run:
    """Run again until shortly after `time`; record the last `seconds` before it."""
    with Simulation(
        hosted.scenario, hosted.controller, seed=hosted.seed, model=options.model, record="all",
        record_window=(max(0.0, time - seconds), math.inf), on_collision="record",
    ) as again:  # fmt: skip
        return repeated(again, given, time + AFTERMATH)


def simulate(
    scenario: ScenarioLike,
    controller: Controller,
    seed: int = 0,
    *,
    model: str | None = None,
    record: str | None = None,
    record_window: tuple[float, float] = (0.0, math.inf),
    on_collision: str = "stop",
    timed: bool = False,
    explain: bool = False,
    keep_files: str | os.PathLike[str] | None = None,
    fcd: str | os.PathLike[str] | None = None,
    gui: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Run a scenario under a controller in SUMO, as `minisim.simulate` does in minisim.

    Arrivals, vehicles, geometry, limits and commands are the same. SUMO does the car following,
    integrates, inserts, measures trips and finds collisions, in a process of its own.

    Args:
        scenario: what to simulate.
        controller: what decides; its session runs here, in the caller's process.
        seed: seed of the arrivals and of SUMO.
        model: SUMO's car-following model: "IDM", "Krauss" (without its random part), or "CC" for
            a `CruiseVehicle`. The default is SUMO's model of the vehicles' own law.
        record: None, "junction" or "all": keep trajectories. Their x and y are positions on
            minisim's paths, which SUMO's network repeats.
        record_window: start and end of the recording [s].
        on_collision: "stop" raises `CollisionError`; "record" notes each pair once and goes on.
            "teleport" is SUMO's default, as in the published runs: a vehicle that runs into the one
            ahead or waits for 300 s is moved to the next road, or counts as arrived if there is
            none. Touching inside the junction does not count.
        timed: keep the CPU time of each decision (`Run.decision_times`).
        explain: write down at each step why each vehicle in view waits or goes (`Run.reasons`),
            and what signal heads show (`Run.heads`).
        keep_files: new or empty folder for SUMO's files, which are temporary by default: network,
            routes, configuration, log and trips. If the run fails, they stay, and the exception
            has a note that names the folder.
        fcd: file for SUMO's own floating-car data of every step, written if the run succeeds.
        gui: show the run in sumo-gui.
        progress: called at every wake-up with the steps done and the total up to the horizon.

    Raises:
        MissingExtraError: SUMO is not installed.
        InputError: a value that is not allowed, or a scenario that the controller cannot serve.
        SumoError: SUMO refused or died; the message says why, as far as that is known.
        CollisionError: two bodies touched, unless collisions are only recorded.
        ControllerError: the controller broke its contract.
    """
    with Simulation(
        scenario, controller, seed=seed, model=model, record=record, record_window=record_window,
        on_collision=on_collision, timed=timed, explain=explain, keep_files=keep_files, fcd=fcd,
        gui=gui, progress=progress,
    ) as sim:  # fmt: skip
        return sim.run()


def _check_display() -> None:
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not shown:
        raise SumoError("sumo-gui needs a display, and there is none here; run without the GUI")
