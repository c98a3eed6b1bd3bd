"""Our fixed-time, adaptive and actuated signals and all-way stop against SUMO's, same arrivals.

SUMO runs alone here: its junction, drawn by netconvert, its `static`, `delay_based` and `actuated`
programs, its `allway_stop`, its vehicles.
Three things differ from ours by nature; each is tested on its own:

- SUMO's IDM creeps up to a red light, some 4 s longer than a vehicle that brakes comfortably when
  it must (as SUMO's Krauss and our hold lines do). Creeping is no waiting, though it takes as long.
- At an all-way stop, SUMO's vehicles set off as soon as a conflicting one has entered the
  junction; ours wait until it has left their way.
- SUMO's Krauss follows closer than the IDM, so its queues discharge faster.
"""

from __future__ import annotations

import itertools
import statistics
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import minisim
from baselines import Actuated, Adaptive, AllWayStop, FixedTime, all_way_stop
from minisim.control import Controller, Site
from minisim.fleet import Fleet
from minisim.junction.conflicts import conflicts
from minisim.junction.geometry import Intersection
from minisim.junction.movements import ARM_NAMES
from minisim.junction.paths import Floats
from minisim.sumo.network import run_tool, sumo_home, tag, write_xml
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.scenario import Scenario
from tests.builders import replayed

OURS: dict[str, Controller] = {
    "fixed-time": FixedTime(),
    "adaptive": Adaptive(),
    "actuated": Actuated(presence=False),
    "all-way-stop": AllWayStop(),
}
SIGNALS = ("fixed-time", "adaptive", "actuated")
DENSITIES = (150.0, 200.0, 250.0, 300.0, 350.0)
AMBER, REACTION = 2.0, 1.0
#: How much longer SUMO's IDM takes to stand before a red light, to half a second [s]; tested below.
CREEP = 4.1


class Means(NamedTuple):
    """Of the trips that have ended [s]."""

    waiting: float
    travel: float


def rival(name: str, scenario: Scenario, seed: int, model: str = "IDM") -> Means:
    """A run of SUMO's own controller with vehicles of its own."""
    home = sumo_home()
    with tempfile.TemporaryDirectory() as name_of_folder:
        folder = Path(name_of_folder)
        signal = name != "all-way-stop"
        write_network(folder, home, "traffic_light" if signal else "allway_stop")
        write_xml(folder / "x.rou.xml", "routes", routes(scenario, seed, model))
        command = [str(home / "bin" / "sumo"), "-n", "x.net.xml", "-r", "x.rou.xml"]
        if signal:
            write_xml(folder / "x.add.xml", "additional", program(folder, name, scenario.site()))
            command += ["-a", "x.add.xml"]
        command += ["--step-length", "0.1", "--step-method.ballistic", "true"]
        command += ["--end", f"{scenario.horizon:g}", "--time-to-teleport", "-1"]
        command += ["--tripinfo-output", "trips.xml", "--no-step-log", "true"]
        run_tool(command, folder, home)
        trips = ET.parse(folder / "trips.xml").getroot().findall("tripinfo")
    columns = ([float(t.attrib[c]) for t in trips] for c in ("waitingTime", "duration"))
    return Means(*(statistics.fmean(column) for column in columns))


def write_network(folder: Path, home: Path, junction: str) -> None:
    """The 4-arm junction as netconvert draws it: its approach lanes are as long as ours."""
    ends = {arm.name: arm.outward for arm in four_way().intersection.arms}
    nodes = [tag("node", {"id": "C", "x": 0, "y": 0, "type": junction})]
    edges = []
    for arm, (x, y) in ends.items():
        nodes.append(tag("node", {"id": arm, "x": 500 * x, "y": 500 * y, "type": "dead_end"}))
        for way, origin, target in (("in", arm, "C"), ("out", "C", arm)):
            edge = {"id": f"{arm}_{way}", "from": origin, "to": target}
            edges.append(tag("edge", {**edge, "numLanes": 1, "speed": 14}))
    write_xml(folder / "x.nod.xml", "nodes", nodes)
    write_xml(folder / "x.edg.xml", "edges", edges)
    command = [str(home / "bin" / "netconvert"), "-n", "x.nod.xml", "-e", "x.edg.xml"]
    command += ["-o", "x.net.xml", "--lefthand", "true", "--no-turnarounds", "true"]
    run_tool(command, folder, home)


def routes(scenario: Scenario, seed: int, model: str) -> Iterator[str]:
    vehicle, arrivals = scenario.profile.vehicle, scenario.arrivals(seed)
    law = {"delta": vehicle.exponent} if model == "IDM" else {"sigma": 0}
    yield tag("vType", {
        "id": "car", "carFollowModel": model, **law, "length": vehicle.length,
        "width": vehicle.width, "minGap": vehicle.min_gap, "accel": vehicle.acceleration,
        "decel": vehicle.deceleration, "emergencyDecel": vehicle.max_deceleration,
        "tau": vehicle.headway, "maxSpeed": 28, "speedFactor": 1, "speedDev": 0,
        "jmAllwayStopWait": REACTION,
    })  # fmt: skip
    for path in scenario.intersection.paths:
        edges = f"{ARM_NAMES[path.movement.origin]}_in {ARM_NAMES[path.exit_arm]}_out"
        yield tag("route", {"id": path.movement, "edges": edges})
    movements = scenario.intersection.movements
    for i in range(len(arrivals)):
        yield tag("vehicle", {
            "id": i, "type": "car", "depart": f"{arrivals.time[i]:.1f}",
            "route": movements[movements.rows[arrivals.lane[i]][arrivals.manoeuvre[i]]],
            "departPos": vehicle.length, "departSpeed": "max",
        })  # fmt: skip


def program(folder: Path, name: str, site: Site) -> Iterator[str]:
    """One phase per approach: the same greens, or a rule of SUMO's with the same limits."""
    connections = ET.parse(folder / "x.net.xml").getroot().iter("connection")
    arms = {int(c.attrib["linkIndex"]): c.attrib["from"][0] for c in connections if c.get("tl")}
    kind, limits, parameters = "static", {}, {}
    match OURS[name]:
        case Adaptive() as ours:
            kind, limits = "delay_based", {"minDur": ours.min_green, "maxDur": ours.max_green}
            parameters = {"detectorRange": ours.detector_range, "minTimeloss": ours.min_time_loss}
        case Actuated() as ours:
            kind, limits = "actuated", {"minDur": ours.min_green, "maxDur": ours.max_green}
            parameters = {"max-gap": ours.max_gap, "detector-gap": ours.detector_gap}
            parameters["passing-time"] = ours.passing_time
    yield f'<tlLogic id="C" type="{kind}" programID="ours" offset="0">'
    for key, value in parameters.items():
        yield tag("param", {"key": key, "value": value})
    for arm, green in zip("abcd", FixedTime().timing(site).greens, strict=True):
        for light, seconds, more in (("G", green, limits), ("y", AMBER, {})):
            state = "".join(light if arms[i] == arm else "r" for i in range(len(arms)))
            yield tag("phase", {"duration": f"{seconds:.2f}", **more, "state": state})
    yield "</tlLogic>"


def our(name: str, scenario: Scenario, seed: int) -> Means:
    summary = minisim.simulate(scenario, OURS[name], seed, on_collision="record").summary()
    return Means(summary["waiting_time_s"], summary["travel_time_s"])


def over(runs: list[Means]) -> Means:
    return Means(*(statistics.fmean(column) for column in zip(*runs, strict=True)))


def order(means: dict[str, Means], measure: str) -> list[str]:
    """The controllers from the best to the worst."""
    return sorted(means, key=lambda name: float(getattr(means[name], measure)))


def alike(ours: Means, theirs: Means) -> bool:
    """A signal's travel time within 5 %; its waiting within 15 %, or one creeping approach."""
    return (
        abs(ours.travel - theirs.travel) <= 0.05 * theirs.travel
        and abs(ours.waiting - theirs.waiting) <= max(0.15 * theirs.waiting, CREEP)
    )  # fmt: skip


def enter_as_sumo_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let vehicles in the junction no longer be in the way of those at the line."""

    def at_entry(intersection: Intersection, _: VehicleType, others: Fleet) -> Floats:
        crossing = conflicts(intersection, others) & intersection.movements.apart
        return np.where(crossing, 0.01, -np.inf)

    monkeypatch.setattr(all_way_stop, "clearing_distances", at_entry)


@pytest.mark.parametrize("manoeuvre", [1, 2, 3])
def test_sumos_idm_creeps_up_to_a_red_light(manoeuvre: int) -> None:
    """The same time on the road, but less of it at a standstill; Krauss brakes as ours do."""
    scenario = replayed(four_way(250, profile="fair"), (0.0, 0, manoeuvre), horizon=200.0)
    # The greens follow from the demand, and this one is of a single vehicle.
    ours = our("fixed-time", scenario, 1)
    creeping, braking = (rival("fixed-time", scenario, 1, model) for model in ("IDM", "Krauss"))
    assert ours.waiting > 5.0
    assert braking.waiting == pytest.approx(ours.waiting, abs=0.3)
    assert creeping.waiting == pytest.approx(ours.waiting - CREEP, abs=0.6)
    assert creeping.travel == pytest.approx(ours.travel, abs=0.5)


LENGTHS = pytest.mark.parametrize(
    ("densities", "seeds", "horizon"),
    [((250.0,), (1,), 900.0), pytest.param(DENSITIES, (1, 2, 3), 3600.0, marks=pytest.mark.slow)],
    ids=["a quarter of an hour", "hours at every density"],
)


@LENGTHS
def test_entering_behind_each_other_makes_sumos_short_waits(
    monkeypatch: pytest.MonkeyPatch, densities: tuple[float, ...], seeds: tuple[int, ...],
    horizon: float,
) -> None:  # fmt: skip
    """With SUMO's moment of setting off, our all-way stop waits as long as SUMO's."""
    honest = our("all-way-stop", four_way(250, profile="fair", horizon=horizon), 1).waiting
    enter_as_sumo_does(monkeypatch)
    for density in densities:
        scenario = four_way(density, profile="fair", horizon=horizon)
        entering = over([our("all-way-stop", scenario, seed) for seed in seeds]).waiting
        theirs = over([rival("all-way-stop", scenario, seed, "Krauss") for seed in seeds]).waiting
        print(f"entering      {density:4.0f} {entering:7.2f} {theirs:7.2f}")  # noqa: T201
        assert abs(entering - theirs) <= max(0.15 * theirs, 0.4)
        assert density != 250.0 or honest > 1.3 * theirs


@LENGTHS
def test_all_compare(densities: tuple[float, ...], seeds: tuple[int, ...], horizon: float) -> None:
    outside = []
    for density in densities:
        scenario = four_way(density, profile="fair", horizon=horizon)
        ours, theirs = (
            {name: over([run(name, scenario, seed) for seed in seeds]) for name in OURS}
            for run in (our, rival)
        )
        for name in OURS:
            cells = itertools.chain(ours[name], theirs[name])
            print(f"{name:<13} {density:4.0f}", *(f"{c:7.2f}" for c in cells))  # noqa: T201
        assert order(ours, "waiting") == order(theirs, "waiting")
        outside += [(n, density) for n in SIGNALS if not alike(ours[n], theirs[n])]
    assert outside == []
