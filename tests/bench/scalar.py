"""A step in scalar C, the measure of our kernel: `step.c` over our own rows, called by ctypes.

It does less than the kernel: vehicles follow, hold, keep room and move, but none is inserted or
arrives, no mark wakes a session, and nothing is shown, recorded or checked for collisions.
"""

from __future__ import annotations

import atexit
import ctypes
import math
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from minisim.engine.state import DRIVING, LANE, TRAITS, VEHICLE, Layout, Records
from minisim.laws import Law
from minisim.simulation import Simulation
from scenarios import four_way
from scenarios.controllers import controller_named

#: The fastest that we found. The last one is for results as in Python: no two operations in one.
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-ffp-contract=off")

#: `TRAITS`, and 2√(ab), which the kernel does not compute anew at every step either.
TYPE = np.dtype([*TRAITS.descr, ("root", np.float64)])

#: `Law`, all of it as floats.
LAW = np.dtype([(name, np.float64) for name in Law._fields])


def vehicle_step(seed: int, density: float, horizon: float = 3600.0) -> float:
    """CPU nanoseconds of a vehicle-step in C: 20 steps from each of the states every 20 s."""
    scenario = four_way(density, profile="fair", horizon=horizon)
    simulation = Simulation(scenario, controller_named("dim", "fair"), seed=seed)
    states = []
    for moment in range(20, int(horizon), 20):
        simulation.advance(moment)
        simulation.result()  # brings the rows up to date
        states.append((simulation._vehicles.copy(), simulation._lanes.copy()))
    driving = sum(int((vehicles["status"] == DRIVING).sum()) for vehicles, _ in states)
    road = simulation._layout, simulation._law
    return sum(call("timed", *state, *road, 20) for state in states) / (20 * driving) * 1e9


def call(
    function: str, vehicles: Records, lanes: Records, layout: Layout, law: Law, steps: int
) -> Any:
    """Call `take` or `timed` of step.c, which move the vehicles."""
    types = np.array([(*it, 2.0 * math.sqrt(it.a * it.b)) for it in layout.types], TYPE)
    laws = np.array(tuple(law), LAW)
    arrays = (
        vehicles, lanes, laws, layout.ends, layout.section_start, layout.section_speed,
        layout.branch, types,
    )  # fmt: skip
    numbers = len(lanes), *layout.section_start.shape
    world = np.array([*(it.ctypes.data for it in arrays), *numbers], np.int64)  # `World` there
    return getattr(library(), function)(world.ctypes, steps)


@cache
def library() -> Any:
    """step.c, compiled; None without a compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "records.h").write_text(_records())
    source = Path(__file__).with_name("step.c")
    command = [compiler, *FLAGS, "-shared", "-fPIC", "-I.", "-o", "step.so", source, "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    loaded = ctypes.CDLL(str(folder / "step.so"))
    loaded.take.restype, loaded.timed.restype = ctypes.c_bool, ctypes.c_double
    return loaded


def _records() -> str:
    """The header that step.c includes: our records as structs."""
    kinds = {np.dtype(np.float64): "double", np.dtype(np.int64): "int64_t"}
    lines = ["#include <stdint.h>"]
    for name, record in {"Vehicle": VEHICLE, "Lane": LANE, "Type": TYPE, "Law": LAW}.items():
        fields = " ".join(f"{kinds[kind]} {field};" for field, (kind, *_) in record.fields.items())
        lines.append(f"typedef struct {{ {fields} }} {name};")
    return "\n".join(lines) + "\n"
