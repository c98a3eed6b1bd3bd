"""SUMO's files: the vehicles and options that it reads, and the trips that it writes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from itertools import compress
from pathlib import Path

import numpy as np

from minisim.arrivals import Arrivals
from minisim.control import Site
from minisim.engine.state import Records
from minisim.errors import SumoError
from minisim.junction.movements import ARM_NAMES
from minisim.results.trips import Trips, trips_of
from minisim.sumo.cruising import attributes
from minisim.sumo.messages import Ended, Job
from minisim.sumo.network import NETWORK, tag, write_xml
from minisim.vehicle import CruiseVehicle, VehicleType

ROUTES, CONFIGURATION = "minisim.rou.xml", "minisim.sumocfg"
_ATTRIBUTES = ("depart", "arrival", "waitingTime")
TRIPS, FCD, LOG = "tripinfo.xml", "fcd.xml", "sumo.log"


def write_routes(
    folder: Path, site: Site, vehicles: Records, model: str, depart_speed: float | None
) -> None:
    """Write the vehicle types, one route per movement, and the vehicles in order of demand."""
    write_xml(folder / ROUTES, "routes", _routes(site, vehicles, model, depart_speed))


def write_configuration(folder: Path, job: Job, seed: int, fcd: bool) -> None:
    """Write SUMO's options; `sumo -c` shows the scenario without its controller."""
    write_xml(folder / CONFIGURATION, "configuration", _options(job, seed, fcd))


def _vehicle_type(kind: VehicleType, limit: float, model: str) -> dict[str, object]:
    common: dict[str, object] = {
        "id": kind.name, "carFollowModel": model, "length": kind.length, "width": kind.width,
        "minGap": kind.min_gap, "emergencyDecel": kind.max_deceleration,
        "maxSpeed": kind.top_speed(limit), "speedFactor": 1, "speedDev": 0,
    }  # fmt: skip
    if isinstance(kind, CruiseVehicle):
        return common | attributes(kind)
    own = {"delta": kind.exponent} if model == "IDM" else {"sigma": 0}
    return common | {
        "accel": kind.acceleration, "decel": kind.deceleration, "tau": kind.headway, **own,
    }  # fmt: skip


def _routes(site: Site, vehicles: Records, model: str, depart_speed: float | None) -> Iterator[str]:
    for kind in site.types:
        yield tag("vType", _vehicle_type(kind, site.speed_limit, model))
    for path in compress(site.intersection.paths, site.intersection.allowed):
        edges = f"{ARM_NAMES[path.movement.origin]}_in {ARM_NAMES[path.exit_arm]}_out"
        yield tag("route", {"id": path.movement, "edges": edges})
    movements = site.intersection.movements
    for i in np.lexsort((vehicles["id"], vehicles["demand_tick"])).tolist():
        row, kind = vehicles[i], site.types[vehicles[i]["type"]]
        yield tag("vehicle", {
            "id": row["id"], "type": kind.name, "route": movements[row["path"]],
            "depart": f"{row['demand_tick'] * site.dt:.3f}",
            "departPos": kind.length + kind.margin,
            "departSpeed": "max" if depart_speed != 0.0 else 0,
            "speedFactor": f"{row['factor']:.9f}",
        })  # fmt: skip


def _options(job: Job, seed: int, fcd: bool) -> Iterator[str]:
    options = {
        "net-file": NETWORK, "route-files": ROUTES, "tripinfo-output": TRIPS,
        "tripinfo-output.write-unfinished": "true", "tripinfo-output.write-undeparted": "true",
        "precision": 6, "log": LOG, "begin": 0,
        "route-steps": 0,  # all vehicles are known before the first step
        "step-length": job.law.dt, "step-method.ballistic": str(not job.law.semi_implicit).lower(),
        "seed": seed % 2**31, "no-step-log": "true", "duration-log.disable": "true",
    }  # fmt: skip
    if not job.teleport:
        # No vehicle is taken off the road, whether for waiting or for a collision. With the action
        # "none", SUMO would not even look for collisions.
        options |= {
            "time-to-teleport": -1, "collision.action": "warn",
            "collision.check-junctions": "true", "collision.mingap-factor": 0,
        }  # fmt: skip
    if fcd:
        options |= {"fcd-output": FCD}
    return (tag(name, {"value": value}) for name, value in options.items())


def read_trips(folder: Path, arrivals: Arrivals, job: Job, ended: Ended) -> Trips:
    """SUMO's trips in demand order; raises `SumoError` if they are not those of the arrivals.

    Only the time loss is ours (`Ended.time_loss`). From version 1.28 on, SUMO's own leaves out what
    a vehicle loses while it accelerates to a higher limit, and SUMO knows no markings.
    """
    end = (job.horizon if ended.done else ended.tick) * job.law.dt
    values = np.full((len(arrivals), len(_ATTRIBUTES)), np.nan)
    # SUMO does not report vehicles that want to enter when the run is over.
    values[arrivals.time > end - 1.5 * job.law.dt] = -1.0, -1.0, 0.0
    try:
        for trip in ET.parse(folder / TRIPS).getroot().iter("tripinfo"):
            values[int(trip.attrib["id"])] = [float(trip.attrib[name]) for name in _ATTRIBUTES]
    except (OSError, ET.ParseError, LookupError, ValueError) as error:
        raise SumoError(f"SUMO's trips cannot be read: {error}") from error
    # Nor does it report vehicles that would have come later.
    missing = np.isnan(values).any(axis=1) & (arrivals.time < end - job.law.dt)
    if missing.any():
        raise SumoError(f"SUMO's trips lack vehicle {int(missing.argmax())}")
    depart, arrival, waiting = values.T
    # SUMO still inserts vehicles at the very end. One that has not made a step is not on the road.
    departed = (depart >= 0.0) & (depart < end - job.law.dt / 2.0)
    arrived = departed & (arrival >= 0.0)
    types = job.vehicles["type"][np.argsort(job.vehicles["id"])]
    loss = np.array([ended.time_loss[i] for i in range(len(arrivals))], dtype=float)
    return trips_of(
        arrivals.time, arrivals.lane, arrivals.manoeuvre, types, job.movements, end,
        depart=np.where(departed, depart, np.nan), arrival=np.where(arrived, arrival, np.nan),
        waiting_time=np.where(departed, waiting, 0.0), time_loss=loss,
    )  # fmt: skip
