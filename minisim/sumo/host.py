"""`simulate` in SUMO: builds what it needs, hosts the session, and reads the trips back."""

from __future__ import annotations

import importlib.util
import math
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

from minisim.arrivals import Arrivals
from minisim.control import Command, Controller, Site, View
from minisim.errors import (
    FileError,
    InputError,
    MissingExtraError,
    SumoError,
    choice,
    instance,
)
from minisim.geometry import ARM_NAMES, Floats
from minisim.simulation import (
    AFTERMATH,
    ON_COLLISION,
    RECORDS,
    Beginning,
    Run,
    ScenarioLike,
    ask,
    begin,
    checked_window,
    collision_error,
)
from minisim.state import Records, build_law, build_road, build_vehicles, first_tick
from minisim.sumo.network import NETWORK, build_network, sumo_environment, tag, write_xml
from minisim.sumo.worker import Asked, Ended, Failed, Job, Started
from minisim.trips import Trips

#: SUMO's car-following models that a run may use.
MODELS = ("IDM", "Krauss")

ROUTES, CONFIGURATION, TRIPS = "minisim.rou.xml", "minisim.sumocfg", "tripinfo.xml"
LOG, STDERR = "sumo.log", "stderr.txt"

INSTALL = "pip install 'minisim[sumo]'"

#: What the child runs. Its messages have to come from the module, not from `__main__`.
CHILD = "from minisim.sumo.worker import main; main()"

#: Called with the steps done and all steps.
Progress = Callable[[int, int], None]


def simulate(
    scenario: ScenarioLike,
    controller: Controller,
    seed: int = 0,
    *,
    model: str = "IDM",
    record: str | None = None,
    record_window: tuple[float, float] = (0.0, math.inf),
    on_collision: str = "stop",
    keep_files: str | os.PathLike[str] | None = None,
    gui: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Run a scenario under a controller in SUMO, as `minisim.simulate` does in minisim.

    The same arrivals, vehicles, geometry, limits and commands; SUMO follows leaders, integrates,
    inserts, measures the trips and finds collisions. libsumo runs in a process of its own.

    Args:
        scenario: what to simulate.
        controller: who decides; its session runs here, in the caller's process.
        seed: of the arrivals and of SUMO.
        model: SUMO's car-following model, "IDM" or "Krauss" (without its random part).
        record: None, "junction" or "all": keep trajectories. Their x and y are positions on
            minisim's paths, which SUMO's network repeats.
        record_window: from and to [s].
        on_collision: "stop" raises `CollisionError`; "record" notes each pair once and goes on.
        keep_files: folder for the network, the routes, the configuration, SUMO's log and its
            trips; by default they are temporary.
        gui: show it in sumo-gui.
        progress: called at every wake-up, with the steps done and the steps up to the horizon.

    Raises:
        MissingExtraError: SUMO is not installed.
        InputError: a value that is not allowed, or a scenario that the controller cannot serve.
        SumoError: SUMO refused or died; the message tells why as far as it is known.
        CollisionError: two bodies touched, unless collisions are only recorded.
        ControllerError: the controller broke its contract.
    """
    return _run(
        _Request(
            scenario=scenario, controller=controller, seed=seed, model=model, record=record,
            record_window=record_window, on_collision=on_collision, keep_files=keep_files,
            gui=gui, progress=progress,
        )
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _Request:
    """The arguments of `simulate`; a replay of a collision ends at `until` [s]."""

    scenario: ScenarioLike
    controller: Controller
    seed: int
    model: str
    record: str | None
    record_window: tuple[float, float]
    on_collision: str
    keep_files: str | os.PathLike[str] | None
    gui: bool
    progress: Progress | None
    until: float = math.inf

    def replay(self, time: float, seconds: float = 10.0) -> Run:
        """Run again up to a little after `time`; records the last `seconds` before it."""
        again = replace(
            self, record="all", record_window=(max(0.0, time - seconds), math.inf),
            on_collision="record", keep_files=None, gui=False, progress=None,
            until=time + AFTERMATH,
        )  # fmt: skip
        return _run(again)


def _run(request: _Request) -> Run:
    home = sumo_home()
    choice("SUMO model", request.model, MODELS)
    if request.record is not None:
        choice("record", request.record, RECORDS)
    choice("on_collision", request.on_collision, ON_COLLISION)
    if request.gui:
        _check_display()
    beginning = begin(request.scenario, request.controller, request.seed)
    with _folder(request.keep_files) as folder:
        job = _prepare(request, beginning, folder, home)
        version, ended = _host(job, home, _session(request, beginning, job))
        if ended.collisions and job.stop_on_collision:
            raise collision_error(
                ended.collisions, request.scenario, request.controller, int(request.seed),
                partial(request.replay, ended.collisions[0].time),
            )  # fmt: skip
        end = (job.horizon if ended.done else ended.tick) * job.law.dt
        columns = _read_trips(folder / TRIPS, beginning.arrivals, job, ended, end)
    return Run(
        scenario=request.scenario,
        controller=request.controller,
        seed=int(request.seed),
        site=beginning.site,
        plan=beginning.plan,
        collisions=ended.collisions,
        columns=columns,
        record=request.record,
        trace=ended.trace,
        rows=job.vehicles[["id", "path"]].copy(),
        host={"host": "sumo", "sumo": version, "sumo_model": request.model},
    )


def sumo_home() -> Path:
    """SUMO's folder.

    Raises:
        MissingExtraError: SUMO is not installed, with the command that installs it.
    """
    for package in ("sumo", "libsumo"):
        if importlib.util.find_spec(package) is None:
            raise MissingExtraError(f"the host SUMO needs the package {package}: {INSTALL}")
    import sumo

    return Path(sumo.SUMO_HOME)


def _check_display() -> None:
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise SumoError("sumo-gui needs a display, and there is none here; run without the GUI")


@contextmanager
def _folder(keep: str | os.PathLike[str] | None) -> Iterator[Path]:
    """Where SUMO's files go: a folder to keep, made where it is missing, or one that vanishes."""
    if keep is None:
        with tempfile.TemporaryDirectory(prefix="minisim-sumo-") as name:
            yield Path(name)
        return
    instance("keep_files", keep, (str, os.PathLike))
    folder = Path(keep).absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / TRIPS).unlink(missing_ok=True)  # of an earlier run
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"cannot write to folder {keep}: {reason}") from error
    yield folder


def _prepare(request: _Request, beginning: Beginning, folder: Path, home: Path) -> Job:
    """Write all of SUMO's files, and put together what its process needs."""
    site, arrivals, _, plan = beginning
    if request.model == "IDM" and site.vehicle.model != "idm":
        raise InputError(
            f"SUMO has no car-following model {site.vehicle.model!r}: give the vehicles the "
            "model 'idm', or choose SUMO's Krauss"
        )
    depart_speed = request.scenario.depart_speed
    law = build_law(
        site,
        plan,
        depart_speed=depart_speed,
        record=request.record,
        record_window=checked_window(request.record_window),
    )
    vehicles = build_vehicles(site, arrivals)
    network = build_network(site.intersection, site.speed_limit, folder, home)
    write_xml(folder / ROUTES, "routes", _routes(site, vehicles, request.model, depart_speed))
    write_xml(folder / CONFIGURATION, "configuration", _options(site.dt, int(request.seed)))
    return Job(
        command=_command(request.gui),
        folder=str(folder),
        model=request.model,
        plan=plan,
        road=build_road(site, plan),
        law=law,
        network=network,
        vehicles=vehicles,
        lanes=site.intersection.n,
        movements=site.intersection.movements,
        horizon=first_tick(min(request.scenario.horizon, request.until), site.dt),
        stop_on_collision=request.on_collision == "stop",
    )


def _routes(site: Site, vehicles: Records, model: str, depart_speed: float | None) -> Iterator[str]:
    """The vehicle type, a route a movement, and the vehicles in order of demand."""
    kind = site.vehicle
    yield tag(
        "vType",
        {
            "id": "car", "carFollowModel": model, "length": kind.length, "width": kind.width,
            "minGap": kind.min_gap, "accel": kind.acceleration, "decel": kind.deceleration,
            "emergencyDecel": kind.max_deceleration, "tau": kind.headway,
            "maxSpeed": 2.0 * site.speed_limit,  # the fastest driver's
            "speedFactor": 1, "speedDev": 0,
            **({"delta": kind.exponent} if model == "IDM" else {"sigma": 0}),
        },
    )  # fmt: skip
    for path in site.intersection.paths:
        edges = f"{ARM_NAMES[path.movement.origin]}_in {ARM_NAMES[path.exit_arm]}_out"
        yield tag("route", {"id": path.movement, "edges": edges})
    movements = site.intersection.movements
    for i in np.lexsort((vehicles["id"], vehicles["demand_tick"])).tolist():
        yield tag(
            "vehicle",
            {
                "id": vehicles["id"][i],
                "type": "car",
                "route": movements[vehicles["path"][i]],
                "depart": f"{vehicles['demand_tick'][i] * site.dt:.3f}",
                "departPos": kind.length,
                "departSpeed": "max" if depart_speed is None else depart_speed,
                "speedFactor": f"{vehicles['factor'][i]:.9f}",
            },
        )


def _options(dt: float, seed: int) -> Iterator[str]:
    """SUMO's configuration; `sumo -c` shows the scenario without its controller."""
    options = {
        "net-file": NETWORK,
        "route-files": ROUTES,
        "tripinfo-output": TRIPS,
        "tripinfo-output.write-unfinished": "true",
        "tripinfo-output.write-undeparted": "true",
        "precision": 6,
        "log": LOG,
        "begin": 0,
        "step-length": dt,
        "step-method.ballistic": "true",
        "seed": seed % 2**31,
        # Nobody is taken off the road, for waiting or for a collision; "none" would look for none.
        "time-to-teleport": -1,
        "collision.action": "warn",
        "collision.check-junctions": "true",
        "collision.mingap-factor": 0,
        "no-step-log": "true",
        "duration-log.disable": "true",
    }
    return (tag(name, {"value": value}) for name, value in options.items())


def _command(gui: bool) -> tuple[str, ...]:
    if gui:
        return ("sumo-gui", "-c", CONFIGURATION, "--start", "true", "--quit-on-end", "true")
    return ("sumo", "-c", CONFIGURATION)


def _session(request: _Request, beginning: Beginning, job: Job) -> Callable[[Asked], list[Command]]:
    """What answers the worker: the controller's session."""
    dt = beginning.site.dt

    def answer(asked: Asked) -> list[Command]:
        if request.progress is not None:
            request.progress(asked.tick, job.horizon)
        view = View(round(asked.tick * dt, 6), asked.vehicles)
        return ask(
            beginning.session, view, asked.tick,
            controller=request.controller, site=beginning.site, vehicles=len(job.vehicles),
        )  # fmt: skip

    return answer


def _host(job: Job, home: Path, answer: Callable[[Asked], list[Command]]) -> tuple[str, Ended]:
    """Run the job in a process of its own; returns SUMO's version and the result.

    Raises:
        SumoError: the process refused or died. The caller stays as it was.
    """
    environment = sumo_environment(home) | {
        "PYTHONPATH": os.pathsep.join(path for path in sys.path if path),
        "MINISIM_JIT": "0",  # compiled functions are slow to call one vehicle at a time
    }
    version, time = "", 0.0
    with (Path(job.folder) / STDERR).open("w+b") as complaints:
        child = subprocess.Popen(
            [sys.executable, "-P", "-c", CHILD], env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints,
        )  # fmt: skip
        try:
            _send(child, job)
            while True:
                match _receive(child):
                    case Started(version):
                        pass
                    case Asked(tick) as asked:
                        time = tick * job.law.dt
                        _send(child, answer(asked))
                    case Failed(reason):
                        said = _last_words(complaints)
                        raise SumoError(f"SUMO failed{_when(version, time)}: {reason}{said}")
                    case Ended() as ended:
                        child.wait()
                        return version, ended
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            code = child.wait()
            said = _last_words(complaints)
            raise SumoError(
                f"SUMO's process died{_when(version, time)} ({_cause(code)}){said}"
            ) from None
        finally:
            child.kill()
            child.communicate()


def _send(child: subprocess.Popen[bytes], message: object) -> None:
    if child.stdin is None:
        raise EOFError
    pickle.dump(message, child.stdin)
    child.stdin.flush()


def _receive(child: subprocess.Popen[bytes]) -> Any:
    if child.stdout is None:
        raise EOFError
    return pickle.load(child.stdout)


def _when(version: str, time: float) -> str:
    return f" after {time:.1f} s of simulated time" if version else " before the first step"


def _cause(code: int) -> str:
    if code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"


def _last_words(complaints: IO[bytes]) -> str:
    """The end of what it wrote, in one line."""
    complaints.seek(0)
    lines = complaints.read().decode(errors="replace").split("\n")
    words = "; ".join(line.strip() for line in lines[-8:] if line.strip())
    return f": {words}" if words else ""


def _read_trips(file: Path, arrivals: Arrivals, job: Job, ended: Ended, end: float) -> Trips:
    """SUMO's trips of a run that has reached `end` [s], in demand order.

    Only the time loss is ours (`_time_loss`). Since version 1.28 SUMO's own leaves out what a
    vehicle loses while it accelerates for a higher limit, and it knows no markings.

    Raises:
        SumoError: there are no trips, or not those of the arrivals.
    """
    values = np.full((len(arrivals), len(_ATTRIBUTES)), np.nan)
    try:
        for trip in ET.parse(file).getroot().iter("tripinfo"):
            values[int(trip.attrib["id"])] = [float(trip.attrib[name]) for name in _ATTRIBUTES]
    except (OSError, ET.ParseError, LookupError, ValueError) as error:
        raise SumoError(f"SUMO's trips cannot be read: {error}") from error
    if np.isnan(values).any():
        missing = int(np.isnan(values).any(axis=1).argmax())
        raise SumoError(f"SUMO's trips do not tell of vehicle {missing}")
    depart, arrival, waiting = values.T
    # SUMO inserts once more at the very end: a vehicle without a step is not on the road yet.
    departed = (depart >= 0.0) & (depart < end - job.law.dt / 2.0)
    arrived = departed & (arrival >= 0.0)
    travel = np.where(departed, np.where(arrived, arrival, end) - depart, 0.0)
    return Trips(
        end=end,
        demand_time=arrivals.time,
        depart=np.where(departed, depart, np.nan),
        arrival=np.where(arrived, arrival, np.nan),
        lane=arrivals.lane.copy(),
        manoeuvre=arrivals.manoeuvre.copy(),
        exit_lane=(arrivals.lane + arrivals.manoeuvre) % job.lanes,
        waiting_time=np.where(departed, waiting, 0.0),
        travel_time=travel,
        time_loss=np.where(departed, _time_loss(travel, job, ended), 0.0),
        depart_delay=np.maximum(np.where(departed, depart, end) - arrivals.time, 0.0),
        departed=departed,
        arrived=arrived,
    )


_ATTRIBUTES = ("depart", "arrival", "waitingTime")


def _time_loss(travel: Floats, job: Job, ended: Ended) -> Floats:
    """Travel time less what the same way takes at its limits [s], in demand order.

    The integral of 1 − v/v_allowed, as minisim sums it up step by step; an arrival is known to a
    step.
    """
    loss = np.zeros(len(travel))
    for row in job.vehicles:
        i, p = int(row["id"]), int(row["path"])
        start = np.maximum(job.road.section_start[p], job.law.length)
        start = np.minimum(start, ended.positions.get(i, job.road.ends[p, 1]))
        ideal = np.diff(start) / job.road.section_speed[p, :-1] / row["factor"]
        loss[i] = max(travel[i] - math.fsum(ideal.tolist()), 0.0)
    return loss
