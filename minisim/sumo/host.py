"""`simulate` in SUMO: builds what it needs, hosts the session, and reads the trips back."""

from __future__ import annotations

import importlib.util
import math
import os
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple

from minisim.control import Command, Controller, View
from minisim.engine.cruise.law import build_cruise
from minisim.engine.state import build_layout, build_vehicles
from minisim.errors import (
    FileError,
    InputError,
    MissingExtraError,
    SumoError,
    choice,
    extra,
    instance,
)
from minisim.files import replacing
from minisim.hosting import AFTERMATH, REACTIONS, Hosted, begin
from minisim.laws import build_law
from minisim.results.run import Run, ScenarioLike
from minisim.sumo.files import CONFIGURATION, FCD, read_trips, write_configuration, write_routes
from minisim.sumo.messages import Asked, Channel, Ended, Failed, Job, Started
from minisim.sumo.network import build_network, sumo_environment
from minisim.ticks import first_tick, time_of
from minisim.vehicle import MODELS as CAR_FOLLOWING
from minisim.vehicle import CruiseVehicle, VehicleType

#: SUMO's car-following models that a run may use.
MODELS = tuple(model.sumo for model in CAR_FOLLOWING.values() if model.sumo)

#: What the child writes on stderr.
STDERR = "stderr.txt"

#: What the child runs. The classes of its messages must belong to the module, not to `__main__`.
CHILD = "from minisim.sumo.worker import main; main()"

#: Called with the number of steps done and the total.
Progress = Callable[[int, int], None]


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
        explain: write down at each wake-up why each vehicle in view waits or goes (`Run.reasons`),
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
    home = sumo_home()
    if model is not None:
        choice("SUMO model", model, MODELS)
    if gui:
        _check_display()
    hosted = begin(
        scenario, controller, seed, record=record, record_window=record_window,
        on_collision=on_collision, reactions=REACTIONS, timed=timed, explain=explain,
    )  # fmt: skip
    return _run(hosted, _Options(home, model, keep_files, fcd, gui, progress))


class _Options(NamedTuple):
    """SUMO's folder and the arguments of `simulate` that only this host has."""

    home: Path
    model: str | None
    keep_files: str | os.PathLike[str] | None = None
    fcd: str | os.PathLike[str] | None = None
    gui: bool = False
    progress: Progress | None = None
    until: float = math.inf  # when a replay of a collision ends [s]


def _run(hosted: Hosted, options: _Options) -> Run:
    with _folder(options.keep_files) as folder:
        job = _prepare(hosted, options, folder)
        version, ended = _host(job, options.home, _session(hosted, options, job))
        if ended.collisions and job.stop_on_collision:
            replay = partial(_replay, hosted, options, ended.collisions[0].time)
            raise hosted.collided(ended.collisions, replay)
        columns = read_trips(folder, hosted.arrivals, job, ended)
        if options.fcd is not None:
            with replacing(options.fcd) as target:
                shutil.copyfile(folder / FCD, target)
    return hosted.result(
        collisions=ended.collisions,
        columns=columns,
        trace=ended.trace,
        rows=job.vehicles[["id", "path", "type"]].copy(),
        host={"host": "sumo", "sumo": version, "sumo_model": job.model},
    )


def _replay(hosted: Hosted, options: _Options, time: float, seconds: float = 10.0) -> Run:
    """Run again until shortly after `time`; record the last `seconds` before it."""
    again = begin(
        hosted.scenario, hosted.controller, hosted.seed, record="all",
        record_window=(max(0.0, time - seconds), math.inf), on_collision="record",
    )  # fmt: skip
    return _run(again, _Options(options.home, options.model, until=time + AFTERMATH))


def sumo_home() -> Path:
    """SUMO's folder; raises `MissingExtraError` with the command that installs SUMO."""
    origin = None
    for package in ("libsumo", "sumo"):
        found = importlib.util.find_spec(package)
        origin = found and found.origin
        if origin is None:
            raise MissingExtraError(f"the host SUMO needs the package {package}: {extra('sumo')}")
    return Path(str(origin)).parent  # importing it would change the environment


def _check_display() -> None:
    shown = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not shown:
        raise SumoError("sumo-gui needs a display, and there is none here; run without the GUI")


@contextmanager
def _folder(keep: str | os.PathLike[str] | None) -> Iterator[Path]:
    """The folder for SUMO's files: the one to keep, created if missing, or a temporary one."""
    if keep is None:
        with tempfile.TemporaryDirectory(prefix="minisim-sumo-") as name:
            yield Path(name)
        return
    instance("keep_files", keep, (str, os.PathLike))
    folder = Path(keep).absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        used = any(folder.iterdir())
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"cannot write to folder {keep}: {reason}") from error
    if used:
        raise FileError(f"folder {keep} is not empty: give SUMO's files a new or an empty one")
    try:
        yield folder
    except BaseException as error:
        if any(folder.iterdir()):
            error.add_note(f"SUMO's files up to there are in {keep}")
        raise


def _prepare(hosted: Hosted, options: _Options, folder: Path) -> Job:
    """Write all of SUMO's files, and put together what its process needs."""
    site, plan = hosted.site, hosted.plan
    if abs(site.dt * 1000.0 - round(site.dt * 1000.0)) > 1e-9:
        raise InputError(f"SUMO counts in milliseconds; it cannot step {site.dt:g} s")
    if site.vehicle.sumo is not None and not isinstance(site.vehicle, CruiseVehicle):
        raise InputError(
            f"vehicles with sumo={site.vehicle.sumo!r} give way to those crossing inside the "
            "junction; hosted in SUMO, the controller does that, so leave out sumo"
        )
    for it in site.types:
        if it.rear_axle is not None:
            raise InputError(
                f"SUMO's bodies drag no rear axle, but {it.name} has one at {it.rear_axle:g} m: "
                "leave out rear_axle"
            )
    model = _model(options.model, site.vehicle)
    depart_speed = hosted.scenario.depart_speed
    vehicles = build_vehicles(site, hosted.arrivals)
    write_routes(folder, site, vehicles, model, depart_speed)
    network = build_network(site, folder, options.home)
    job = Job(
        command=_command(options.gui),
        folder=str(folder),
        temporary=options.keep_files is None,
        model=model,
        plan=plan,
        layout=build_layout(site, plan),
        law=build_law(
            site, plan, depart_speed=depart_speed, record=hosted.record,
            record_window=hosted.record_window,
        ),
        cruise=build_cruise(site, len(vehicles)),
        top_speed=site.vehicle.top_speed(site.speed_limit),
        network=network,
        vehicles=vehicles,
        movements=site.intersection.movements,
        horizon=first_tick(min(hosted.scenario.horizon, options.until), site.dt),
        stop_on_collision=hosted.on_collision == "stop",
        teleport=hosted.on_collision == "teleport",
    )  # fmt: skip
    write_configuration(folder, job, hosted.seed, options.fcd is not None)
    return job


def _model(asked: str | None, vehicle: VehicleType) -> str:
    """The SUMO model that drives the vehicles; raises `InputError` if none can."""
    drives = {name: (it.sumo, *it.stand_ins) for name, it in CAR_FOLLOWING.items()}
    fitting = [model for model in MODELS if model in drives[vehicle.model]]
    model = drives[vehicle.model][0] if asked is None else asked
    if model in fitting:
        return model
    choose = f"choose {' or '.join(fitting)}"
    if asked is None:
        raise InputError(f"SUMO has no model of the law {vehicle.model!r}; {choose}")
    driven = " or ".join(repr(name) for name, models in drives.items() if asked in models)
    other = f"a vehicle of the model {driven}"
    if asked == "CC":
        other = "a CruiseVehicle: use --profile as_run"
    raise InputError(
        f"SUMO's model {asked} does not drive vehicles of the model {vehicle.model!r}; {choose}, "
        f"or {other}"
    )


def _command(gui: bool) -> tuple[str, ...]:
    options = ("--start", "true", "--quit-on-end", "true") if gui else ()
    return ("sumo-gui" if gui else "sumo", "-c", CONFIGURATION, *options)


def _session(hosted: Hosted, options: _Options, job: Job) -> Callable[[Asked], list[Command]]:
    """The function that answers the worker with the session's commands."""

    def answer(asked: Asked) -> list[Command]:
        if options.progress is not None:
            options.progress(asked.tick, job.horizon)
        return hosted.ask(View(time_of(asked.tick, job.law.dt), asked.vehicles), asked.tick)

    return answer


def _host(job: Job, home: Path, answer: Callable[[Asked], list[Command]]) -> tuple[str, Ended]:
    """Run the job in a process of its own; returns SUMO's version and the result.

    Raises `SumoError` if the process refused or died; the caller is unaffected.
    """
    environment = sumo_environment(home) | {
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        "MINISIM_JIT": "0",  # compiled functions are slow to call one vehicle at a time
    }
    version, time, failed = "", 0.0, "SUMO failed"
    with (Path(job.folder) / STDERR).open("w+b") as complaints:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", CHILD], env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints,
        )  # fmt: skip
        assert child.stdin is not None
        assert child.stdout is not None
        channel = Channel(child.stdout, child.stdin)
        try:
            channel.send(job)
            while True:
                match channel.receive():
                    case Started(version):
                        pass
                    case Asked(tick) as asked:
                        time = tick * job.law.dt
                        channel.send(answer(asked))
                    case Failed(reason):
                        what = f": {reason}"
                        break
                    case Ended() as ended:
                        child.wait()
                        return version, ended
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            what = f" ({_cause(child.wait())})"
            failed = "SUMO's process died"
        finally:
            child.kill()
            child.communicate()
        when = f"after {time:.1f} s of simulated time" if version else "before the first step"
        raise SumoError(f"{failed} {when}{what}{_last_words(complaints)}")


def _cause(code: int) -> str:
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"exit code {code}"


def _last_words(complaints: IO[bytes]) -> str:
    """The last lines that the process wrote, as one line."""
    complaints.seek(0)
    lines = complaints.read().decode(errors="replace").split("\n")
    words = "; ".join(line.strip() for line in lines[-8:] if line.strip())
    return f": {words}" if words else ""
