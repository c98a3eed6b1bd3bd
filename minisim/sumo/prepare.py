"""What SUMO's process needs before it starts: files in a folder, and a `Job`."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from minisim.engine.cruise.law import build_cruise
from minisim.engine.state import build_layout, build_vehicles
from minisim.errors import FileError, InputError, instance
from minisim.hosting import Hosted
from minisim.laws import build_law
from minisim.sumo.files import CONFIGURATION, write_configuration, write_routes
from minisim.sumo.messages import Job
from minisim.sumo.network import build_network
from minisim.ticks import first_tick
from minisim.vehicle import MODELS as CAR_FOLLOWING
from minisim.vehicle import CruiseVehicle, VehicleType

#: SUMO's car-following models that a run may use.
MODELS = tuple(model.sumo for model in CAR_FOLLOWING.values() if model.sumo)

#: Called with the number of steps done and the total.
Progress = Callable[[int, int], None]


class Options(NamedTuple):
    """SUMO's folder and the arguments of `simulate` that only this host has."""

    home: Path
    model: str | None
    keep_files: str | os.PathLike[str] | None = None
    fcd: str | os.PathLike[str] | None = None
    gui: bool = False
    progress: Progress | None = None


def prepare(hosted: Hosted, options: Options, folder: Path) -> Job:
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
        horizon=first_tick(hosted.scenario.horizon, site.dt),
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


class Folder:
    """The folder of SUMO's files: one to keep, created if missing, or else a temporary one.

    Raises:
        FileError: the folder to keep is in use, or cannot be made.
    """

    def __init__(self, keep: str | os.PathLike[str] | None) -> None:
        self._keep = keep
        self._temporary: tempfile.TemporaryDirectory[str] | None = None
        if keep is None:
            self._temporary = tempfile.TemporaryDirectory(
                prefix="minisim-sumo-", ignore_cleanup_errors=True
            )
            self.path = Path(self._temporary.name)
        else:
            self.path = _kept(keep)

    def close(self, error: BaseException | None = None) -> None:
        """Remove a temporary folder; a note to the error names one that is kept."""
        if self._temporary is not None:
            self._temporary.cleanup()
        elif error is not None and any(self.path.iterdir()):
            error.add_note(f"SUMO's files up to there are in {self._keep}")


def _kept(keep: str | os.PathLike[str]) -> Path:
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
    return folder
