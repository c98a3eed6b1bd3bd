"""The published runs in SUMO 1.18, which made them; see CONTRIBUTING for how to have it."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import minisim
from scenarios.paper import controller_of, replay

PYTHON = os.environ.get("MINISIM_SUMO118", "")

#: Runs the first part of a published run in SUMO and prints waiting and travel time of each trip.
#: The installed netconvert builds the network (1.18's differs a little), and the authors' vehicles
#: had a maxSpeed of 20 m/s.
PROGRAM = """
import json, sys
from dataclasses import replace
from pathlib import Path
import minisim.sumo.files as files, minisim.sumo.network as network
from minisim.sumo import simulate
from scenarios.paper import controller_of, replay
kind, tool = files._vehicle_type, network.run_tool
files._vehicle_type = lambda *given: {**kind(*given), "maxSpeed": "20"}
cell, until, home = json.loads(sys.argv[1])
network.run_tool = lambda command, folder, _: tool(
    [home + "/bin/netconvert", *command[1:]], folder, Path(home)
)
scenario = replace(replay(*cell), horizon=until)
trips = simulate(scenario, controller_of(*cell), on_collision="teleport").columns
rows = trips.waiting_time.tolist(), trips.travel_time.tolist()
print(json.dumps([[x if there else None for x, there in zip(r, trips.arrived)] for r in rows]))
"""


@pytest.mark.slow
@pytest.mark.skipif(not PYTHON, reason="MINISIM_SUMO118 names no Python with SUMO 1.18")
@pytest.mark.parametrize(
    ("cell", "until"),
    [(("balanced", 150, 3), 600.0), (("balanced", 350, 3), 600.0), (("balanced", 350, 5), 300.0)],
)
def test_every_trip_of_dim_is_that_of_sumo_1_18(cell: tuple[str, int, int], until: float) -> None:
    """On 3 and 5 arms, where no road leads back at its end."""
    import sumo

    root = str(Path(__file__).parents[2])
    search = os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [PYTHON, "-c", PROGRAM, json.dumps([cell, until, sumo.SUMO_HOME])],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": search},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    theirs = np.array(json.loads(done.stdout.splitlines()[-1]), dtype=float)
    scenario = replace(replay(*cell), horizon=until)
    ours = minisim.simulate(scenario, controller_of(*cell), on_collision="teleport").columns
    times = np.stack([ours.waiting_time, ours.travel_time])
    assert ours.arrived.tolist() == np.isfinite(theirs[0]).tolist()
    assert ours.arrived.sum() >= 40
    assert theirs[:, ours.arrived] == pytest.approx(times[:, ours.arrived], abs=0.1)
