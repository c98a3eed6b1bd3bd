"""SUMO on the same arrivals: 4 arms, 350 veh/h/lane, dt 0.1 s; CPU seconds of a simulated hour.

- libsumo stepping SUMO's own junction while Python reads every vehicle's position and speed at
  each step: an all-way stop, whose queues are the shortest, so that it moves the fewest vehicles
  (DIM's own queues are longer), and a priority junction, netconvert's default;
- libsumo hosting the very same controller (`minisim.sumo`);
- the bare `sumo` binary with a static program and Webster's greens: no Python, no output, but its
  start (a twentieth of a second) counts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from tests import ROOT

#: Options of every run of SUMO.
STEPPED = ["--step-length", "0.1", "--time-to-teleport", "-1"]
STEPPED += ["--no-step-log", "true", "--no-warnings", "true"]


def sumo_home() -> Path | None:
    """Where SUMO is; None without the extra `sumo`."""
    try:
        import libsumo  # noqa: F401
        import sumo
    except ImportError:
        return None
    return Path(sumo.SUMO_HOME)


def bare_hour(home: Path) -> float:
    """The `sumo` binary alone: children's CPU time, from start to exit."""
    with tempfile.TemporaryDirectory() as folder:
        _write_network(Path(folder), home, "traffic_light")
        _write_routes(Path(folder))
        _write_signal(Path(folder))
        command = [home / "bin" / "sumo", "-n", "x.net.xml", "-r", "x.rou.xml", "-a", "x.add.xml"]
        before = os.times()
        _run([*command, "--end", "3600", *STEPPED], home, cwd=folder)
        after = os.times()
    return after.children_user + after.children_system - before[2] - before[3]


def _run(command: list[Any], home: Path, **options: Any) -> str:
    environment = {**os.environ, "SUMO_HOME": str(home)}
    options |= {"check": True, "capture_output": True, "text": True, "env": environment}
    return str(subprocess.run(command, **options).stdout)


def _write_signal(folder: Path) -> None:
    """One phase per arm in turn, with the greens and ambers of minisim's fixed-time signal."""
    from baselines import FixedTime
    from scenarios import four_way

    controller = FixedTime()
    greens = controller.timing(four_way(density=350, profile="fair").site()).greens
    network = ElementTree.parse(folder / "x.net.xml").getroot()
    links = {
        int(connection.get("linkIndex", "")): connection.get("from", "")[0]
        for connection in network.iter("connection")
        if connection.get("tl") == "C"
    }
    phases = []
    for arm, green in zip("abcd", greens, strict=True):
        for seconds, colour in ((green, "G"), (controller.amber, "y")):
            state = "".join(colour if links[i] == arm else "r" for i in sorted(links))
            phases.append(f'<phase duration="{seconds:.3f}" state="{state}"/>')
    program = '<tlLogic id="C" type="static" programID="webster" offset="0">'
    head = f"<additional>{program}{''.join(phases)}"
    (folder / "x.add.xml").write_text(f"{head}</tlLogic></additional>")


def hosted_hour() -> float:
    """libsumo hosting DIM, in this process and its children."""
    from dim import Dim
    from minisim.sumo import simulate
    from scenarios import four_way

    before = os.times()
    simulate(four_way(density=350, profile="fair"), Dim(), seed=1)
    return sum(os.times()[:4]) - sum(before[:4])


def stepped_hour(home: Path, junction: str) -> float:
    """libsumo stepping a junction of SUMO's own, with every vehicle read."""
    with tempfile.TemporaryDirectory() as folder:
        _write_network(Path(folder), home, junction)
        _write_routes(Path(folder))
        printed = _run([sys.executable, "-m", "tests.bench.rivals", folder], home, cwd=ROOT)
    return float(json.loads(printed.splitlines()[-1]))


def _write_network(folder: Path, home: Path, junction: str) -> None:
    """The 4-arm left-hand junction as netconvert reads it: arms of 500 m, 14 m/s."""
    ends = {"a": (0, 500), "b": (500, 0), "c": (0, -500), "d": (-500, 0)}
    nodes = [f'<node id="C" x="0" y="0" type="{junction}"/>']
    edges = []
    for arm, (x, y) in ends.items():
        nodes.append(f'<node id="{arm}" x="{x}" y="{y}" type="dead_end"/>')
        for name, origin, target in ((f"{arm}in", arm, "C"), (f"{arm}out", "C", arm)):
            ends_of = f'from="{origin}" to="{target}"'
            edges.append(f'<edge id="{name}" {ends_of} numLanes="1" speed="14"/>')
    (folder / "x.nod.xml").write_text(f"<nodes>{''.join(nodes)}</nodes>")
    (folder / "x.edg.xml").write_text(f"<edges>{''.join(edges)}</edges>")
    command = [home / "bin" / "netconvert", "-n", "x.nod.xml", "-e", "x.edg.xml", "-o", "x.net.xml"]
    _run([*command, "--lefthand", "true", "--no-turnarounds", "true"], home, cwd=folder)


def _write_routes(folder: Path) -> None:
    from scenarios import four_way

    arrivals = four_way(density=350, profile="fair").arrivals(seed=1)
    lines = ['<routes><vType id="car" carFollowModel="IDM" speedDev="0"/>']
    for i in range(len(arrivals)):
        origin = arrivals.lane[i]
        target = (origin + arrivals.manoeuvre[i]) % 4
        lines.append(
            f'<vehicle id="{i}" type="car" depart="{arrivals.time[i]}" departSpeed="max">'
            f'<route edges="{"abcd"[origin]}in {"abcd"[target]}out"/></vehicle>'
        )
    (folder / "x.rou.xml").write_text("\n".join([*lines, "</routes>"]))


def _step_sumo(folder: Path) -> None:
    import libsumo

    command = ["sumo", "-n", str(folder / "x.net.xml"), "-r", str(folder / "x.rou.xml")]
    libsumo.start([*command, *STEPPED])
    start = time.process_time()
    metres = 0.0
    for _ in range(36_000):
        libsumo.simulationStep()
        for vehicle in libsumo.vehicle.getIDList():
            x, _y = libsumo.vehicle.getPosition(vehicle)
            metres += x + libsumo.vehicle.getSpeed(vehicle)
    elapsed = time.process_time() - start
    libsumo.close()
    print(json.dumps(elapsed))


if __name__ == "__main__":
    _step_sumo(Path(sys.argv[1]))
