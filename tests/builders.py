"""Builders that many tests share: runs, views made by hand, rows without a run, examples."""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from hypothesis import settings

from baselines.flows import Rule, Waiting, plan
from dim import Dim, NoisyPerception
from dim.perception import See
from minisim.arrivals import Arrivals
from minisim.control import (
    Accelerate,
    Close,
    Command,
    Controller,
    Observed,
    Open,
    Plan,
    Radio,
    Session,
    Site,
    Unregulated,
    View,
    Wake,
)
from minisim.counts import Count, read_counts
from minisim.engine import packed
from minisim.engine.state import DRIVING, TRACE, Layout, Records
from minisim.errors import FileError
from minisim.junction.movements import ARM_NAMES
from minisim.laws import Law
from minisim.results.run import Run
from minisim.results.trajectories import TRAJECTORY_COLUMNS
from minisim.simulation import Simulation
from minisim.testing import SmallScenario, small_scenario
from minisim.vehicle import VehicleType
from scenarios import Scenario
from scenarios.library import four_way
from scenarios.paper import Cell, reference_rows
from scenarios.profiles import AS_RUN, FAIR
from scenarios.recipe import Recipe
from scenarios.sweep.rows import identity_of
from scenarios.sweep.store import Store
from tests import ROOT


def replayed(scenario: Scenario, *trips: tuple[float, int, int], horizon: float) -> Scenario:
    """The scenario with exactly these (demand time, lane, manoeuvre) and this horizon [s]."""
    time, lane, manoeuvre = (list(column) for column in zip(*trips, strict=True))
    recorded = Arrivals(np.array(time, float), np.array(lane, int), np.array(manoeuvre, int))
    return dataclasses.replace(scenario, recorded=recorded, horizon=horizon)


def drained(scenario: Scenario, seed: int, horizon: float) -> Scenario:
    """The scenario's own arrivals of one seed, with time until `horizon` to serve them all."""
    arrivals = scenario.arrivals(seed)
    return dataclasses.replace(scenario, recorded=arrivals, horizon=horizon)


def queues(vehicle: VehicleType, limit: float = 14.0) -> Scenario:
    """A scenario in which eight vehicles queue on each of two lanes, and two on each other lane."""
    profile = dataclasses.replace(FAIR, vehicle=vehicle, speed_limit=limit)
    scenario = four_way(0, profile=profile)
    road = dataclasses.replace(scenario.intersection, arm_length=100.0 + 8 * vehicle.length)
    trips = [(0.0, lane, 2) for lane, count in enumerate((8, 8, 2, 2)) for _ in range(count)]
    return replayed(dataclasses.replace(scenario, intersection=road), *trips, horizon=600.0)


def driven(run: Run, *lines: tuple[int, int, float, float, float]) -> Run:
    """The run as if this had been recorded: (vehicle, tick, s [m], v [m/s], a [m/s²]) each."""
    row = {vehicle: k for k, vehicle in enumerate(run.rows["id"].tolist())}
    trace = [(tick, row[vehicle], s, v, a, 1) for vehicle, tick, s, v, a in lines]
    return dataclasses.replace(run, record="all", trace=np.array(trace, TRACE))


class Greens:
    """A signal, and for each green the vehicles that stood in its queue and were left behind.

    A vehicle that stands in the first 50 m of its road has just entered there.
    """

    name = "greens"

    def __init__(self, signal: Controller) -> None:
        self.signal = signal
        self.left: list[set[int]] = []

    def start(self, site: Site) -> Session:
        """Begin a run that is watched."""
        longest = site.intersection.arm_length - 50.0
        return _Watched(self.signal.start(site), self.left, longest)


class _Watched:
    def __init__(self, session: Session, left: list[set[int]], longest: float) -> None:
        self.plan, self._session, self._left, self._longest = session.plan, session, left, longest
        self._green = -1
        self._stood: set[int] = set()

    def decide(self, view: View) -> list[Command]:
        commands = list(self._session.decide(view))
        lane = [v for v in view.vehicles if v.lane == self._green and v.distance >= 0.0]
        self._stood |= self._standing(lane)
        for command in commands:
            if isinstance(command, Close):
                self._left.append(self._stood & {v.id for v in lane})
            if isinstance(command, Open):
                here = [v for v in view.vehicles if v.lane == command.lane]
                self._green, self._stood = command.lane, self._standing(here)
        return commands

    def _standing(self, lane: list[Observed]) -> set[int]:
        return {v.id for v in lane if v.speed <= 0.1 and v.distance < self._longest}


def digest(run: Run) -> str:
    """A hash of every byte of a run's trips and recording."""
    state = hashlib.sha256()
    for column in run.columns:
        state.update(np.ascontiguousarray(column).tobytes())
    state.update(run.trace.tobytes())
    state.update(repr(run.collisions).encode())
    return state.hexdigest()


@dataclass(frozen=True)
class Fixed:
    """A controller with the same plan and commands in every run."""

    plan: Plan = field(default_factory=Plan)
    first: tuple[Command, ...] = ()  # at time 0; none later
    name: str = "fixed"

    def start(self, site: Site) -> Session:
        return ScriptedSession(self.plan, lambda view: () if view.time else self.first)


@dataclass(frozen=True)
class Scripted:
    """A controller whose sessions answer a view by calling `answer`."""

    answer: Callable[[View], Iterable[Command]]
    plan: Plan = field(default_factory=Plan)
    name: str = "scripted"
    radio: Radio | None = None

    def start(self, site: Site) -> Session:
        return ScriptedSession(self.plan, self.answer)


class ScriptedSession(NamedTuple):
    plan: Plan
    decide: Callable[[View], Iterable[Command]]


@dataclass(frozen=True)
class EveryStep:
    """A controller that is asked at every step, too."""

    controller: Controller
    name: str = "every-step"

    def start(self, site: Site) -> Session:
        session = self.controller.start(site)
        plan = dataclasses.replace(session.plan, period=site.dt)
        return ScriptedSession(plan, session.decide)


#: What `Pedals` asks for [m/s²]; infinity leaves a vehicle to its law.
PEDALS = (math.inf, math.inf, -1000.0, -9.0, -3.0, -1.0, 0.0, 0.5, 2.0, 1000.0)


@dataclass(frozen=True)
class Pedals:
    """A controller that also sets random accelerations, of all vehicles up to the exit."""

    controller: Controller
    seed: int = 0
    often: float = 0.2
    press: Callable[[int, float], Command] = Accelerate
    name: str = "pedals"

    def start(self, site: Site) -> Session:
        session, chance = self.controller.start(site), Random(self.seed)
        plan = session.plan

        def decide(view: View) -> Iterable[Command]:
            near = tuple(it for it in view.vehicles if it.distance <= plan.sight)
            yield from session.decide(view._replace(vehicles=near))
            for vehicle in view.vehicles:
                if chance.random() < self.often:
                    yield self.press(vehicle.id, chance.choice(PEDALS))

        sight = site.intersection.approach_length
        return ScriptedSession(dataclasses.replace(plan, period=0.5, sight=sight), decide)


@dataclass(frozen=True)
class Deadly:
    """A controller that kills its process, as a bug in compiled code or a lack of memory would.

    Attributes:
        once: as for `killing`, but empty kills every time.
    """

    once: str = ""
    name: str = "deadly"

    def start(self, site: Site) -> Session:
        """Kill, or begin a run in which all vehicles may go (of a scenario without vehicles)."""
        killing(self.once or "always")
        return Unregulated().start(site)


def hardest_braking(run: Run) -> float:
    """The hardest braking in a run that recorded all, from the speeds alone [m/s²]."""
    trace = run.trace[np.lexsort((run.trace["tick"], run.trace["row"]))]
    same = (np.diff(trace["row"]) == 0) & (np.diff(trace["tick"]) == 1)
    return float(-np.diff(trace["v"])[same].min(initial=0.0) / run.site.dt)


def repeatable(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows without the columns that differ when a run is repeated."""
    return rows.drop(columns="cpu_s")


def as_run(scenario: SmallScenario) -> SmallScenario:
    """The same with the vehicle of the published runs, inserted at rest, and steps of 0.02 s."""
    return dataclasses.replace(scenario, vehicle=AS_RUN.vehicle, dt=0.02, depart_speed=0.0)


def killing(once: str) -> int:
    """A task that kills its process: "always", never (""), or if there is no such file yet."""
    if once and not Path(once).exists():
        if once != "always":
            Path(once).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 7


def seen(id: int, lane: int, manoeuvre: int, distance: float, speed: float = 0.0) -> Observed:
    """One vehicle of 5 m, whose rank is its id."""
    return Observed(id, lane, manoeuvre, distance, speed, 5.0, rank=id)


def car(id: int, movement: str, distance: float, speed: float = 0.0) -> Observed:
    """A vehicle by the name of its movement, such as a1."""
    return seen(id, ARM_NAMES.index(movement[0]), int(movement[1]), distance, speed)


def view(*vehicles: Observed, time: float = 0.0) -> View:
    """These vehicles, by lane and front to back."""
    return View(time, tuple(sorted(vehicles, key=lambda v: (v.lane, v.distance))))


@dataclass(frozen=True)
class Reading:
    """A perception that errs in intents as told."""

    #: A view, an ego and a vehicle -> the manoeuvre that the ego reads.
    read: Callable[[View, Observed, Observed], int]
    period: float | None = 0.1

    def start(self, site: Site) -> See:
        return lambda view, ego: view._replace(
            vehicles=tuple(v._replace(manoeuvre=self.read(view, ego, v)) for v in view.vehicles)
        )


def queued(rule: Rule, lanes: int, rate: float, clearance: float, seeds: range) -> list[float]:
    """How long vehicles wait that need 1 s each, and `clearance` more after another lane [s].

    5000 for each seed, as a Poisson process of this rate [1/s], and as many of each lane.
    """
    between = 1.0 + clearance * (1.0 - np.eye(lanes))
    waits: list[float] = []
    for seed in seeds:
        random = np.random.default_rng(seed)
        time = random.exponential(size=5000).cumsum()
        time *= len(time) / rate / time[-1]
        lane = random.permutation(np.arange(len(time)) % lanes)
        lines: list[list[Waiting]] = [[] for _ in range(lanes)]
        for i, (t, k) in enumerate(zip(time.tolist(), lane.tolist(), strict=True)):
            lines[k].append(Waiting(i, k, i, t, t))
        served = plan(lines, rule, between, np.full(lanes, -math.inf), -math.inf)
        waits += [it.time - it.vehicle.came for it in served]
    return waits


def said(commands: Iterable[Command]) -> list[str]:
    """Commands in words."""
    return [f"{type(command).__name__} {dataclasses.astuple(command)[0]:g}" for command in commands]


def show(session: Session, time: float, *vehicles: Observed) -> list[str]:
    """The answer to a view, but for its wake-ups."""
    answer = session.decide(View(time, vehicles))
    return said(command for command in answer if not isinstance(command, Wake))


def drive(
    controller: Controller,
    site: Site,
    until: float,
    vehicles: Callable[[float], tuple[Observed, ...]] = lambda time: (),
) -> dict[float, list[str]]:
    """Commands by time of a session that a host wakes only when it asks for it."""
    session = controller.start(site)
    answers: dict[float, list[str]] = {}
    tick = 0
    while tick * site.dt < until:
        time = round(tick * site.dt, 6)
        commands = list(session.decide(View(time, vehicles(time))))
        (wake,) = [c for c in commands if isinstance(c, Wake)]
        answers[time] = said(c for c in commands if c is not wake)
        tick, before = math.ceil(wake.time / site.dt - 1e-6), tick
        assert tick > before
    return {time: commands for time, commands in answers.items() if commands}


#: Label -> waiting at low demand [s] and capacity on four arms [veh/h/lane].
CURVES = {
    "dim": (0.6, 380.0), "dim:gate=harmonious": (0.4, 520.0),
    "dim:priorities=rotating": (0.6, 380.0), "dim:priorities=waiting": (0.6, 380.0),
    "dim:gate=passed": (0.4, 540.0), "fixed-time": (8.0, 400.0), "adaptive": (5.0, 450.0),
    "v2ic": (0.1, 480.0), "all-way-stop": (1.5, 550.0), "schedule": (0.1, 700.0),
    "reservation": (0.3, 600.0), "max-pressure": (4.0, 460.0),
    "fixed-time:facing=true": (2.0, 380.0), "max-pressure:facing=true": (2.0, 440.0),
    "slots": (0.2, 580.0), "slots:batch=1": (0.3, 560.0),
    "platoons": (0.2, 620.0), "platoons:service=gated": (0.2, 600.0),
    "unregulated": (0.1, 900.0), "dim without conflicts": (0.3, 800.0),
    "dim:gate=passed,priorities=waiting": (0.4, 560.0),
    "dim:gate=harmonious,priorities=waiting": (0.4, 530.0),
}  # fmt: skip


def capacity_of(label: str, arms: int) -> float:
    """The capacity that is built into the rows [veh/h/lane]."""
    return CURVES[label][1] * 4.0 / arms


def synthetic_row(experiment: Recipe) -> dict[str, Any]:
    """A queue of the M/M/1 kind, with a little noise from the seed."""
    arms, density = experiment.scenario.intersection.n, experiment.scenario.density
    horizon = experiment.scenario.horizon
    # Studies of perception label what errs, and that of humans their share.
    label, _, share = (experiment.label or "dim").partition("+humans=")
    base = CURVES[label][0] * (1.0 + 5.0 * float(share or 0.0))
    load = density / capacity_of(label, arms)
    wobble = 1.0 + 0.1 * math.sin(7.0 * experiment.seed)
    waiting = wobble * base / max(1.0 - load, 0.02)
    trips = int(density * arms * horizon / 3600.0)
    excess = max(0.0, 1.0 - 1.0 / load) * trips / 2.0
    lanes = {
        f"lanes_{lane}_{key}": value
        for i, lane in enumerate(ARM_NAMES[:arms])
        for key, value in {
            "trips": trips // arms,
            "queue_growth": excess / arms,
            "waiting_time_s": waiting * (i + 1) / arms,
            "complete_waiting_time_s": waiting * (i + 1) / arms,
        }.items()
    }
    times = {
        "waiting_time_s": waiting,
        "travel_time_s": 70.0 + 1.5 * waiting,
        "time_loss_s": 3.0 + 1.5 * waiting,
        "depart_delay_s": 10.0 * max(load - 1.0, 0.0),
    }
    groups = ("human", "automated") if share else ()
    kinds = {
        f"kinds_{group}_complete_{key}": (k + 1.0) * value if float(share) + k < 2.0 else None
        for k, group in enumerate(groups)
        for key, value in times.items()
    }
    return kinds | {
        **identity_of(experiment), "trips": trips, "unfinished": 9, "collisions": 0, **times,
        **{f"complete_{key}": value for key, value in times.items()},
        **lanes, **tally(experiment, trips), "queue_growth": excess, "growing": excess > 0.0,
        "least_delay_s": 2.0, "delay_s": 2.0 + waiting, "above_least_percent": 50.0 * waiting,
        "arrivals": "same", "cpu_s": 0.1, "version": "test", "error": None,
    }  # fmt: skip


def tally(experiment: Recipe, trips: int) -> dict[str, float]:
    """Counts of `dim.senses.tally`, in proportion to the intent errors, if there are any."""
    controller = experiment.controller
    if not isinstance(controller, Dim) or controller.perception.period is None:
        return {}
    perception = controller.perception
    assert isinstance(perception, NoisyPerception)
    errors = max(perception.intent_error, *perception.unsignalled)
    return {
        "collisions": int(errors * 40), "crossings": trips - 9, "false_grants": int(errors * 300),
        "disagreement_s": 400.0 * errors, "deadlock_s": 0.0 if perception.shared else 50.0,
    }  # fmt: skip


def synthetic_find(experiments: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
    """A store that holds everything."""
    return [synthetic_row(experiment) for experiment in experiments]


def free_flow(seconds: float) -> dict[str, float | None]:
    """Columns of a run of an hour with this travel time on a free road [s]."""
    return {
        "horizon_s": 3600.0, "warmup_s": 0.0, "travel_time_s": seconds + 10.0, "time_loss_s": 10.0,
        "complete_travel_time_s": seconds, "complete_time_loss_s": 30.0,
    }  # fmt: skip


def share(part: float) -> settings:
    """Decorator: only this share of the profile's examples, for costly properties."""
    return settings(max_examples=max(1, round(part * settings().max_examples)))


def reference_value(cell: Cell, metric: str, lane: str = "all") -> float:
    """One published mean [s]."""
    return float(reference_rows(cell, metric, lane)["value"].item())


def python(
    *arguments: str, cwd: Path = ROOT, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python with the project's code in a process of its own, and wait for it."""
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
    )  # fmt: skip


def stored(path: Path) -> int:
    """The number of rows in a store, even while a process makes it."""
    try:
        with Store(path, create=False) as store:
            return len(store)
    except FileError:
        assert not path.exists() or not path.stat().st_size, "never a broken store"
        return 0


def town_text(
    places: Mapping[str, tuple[float, float]],
    *,
    one_way: Sequence[str] = (),
    lanes: Mapping[str, Sequence[str]] = MappingProxyType({}),
    missing: Sequence[tuple[str, str]] = (),
    left: bool = False,
    extra: str = "",
) -> str:
    """A network of SUMO: a node C in the origin, with straight roads to other places [m].

    Edges are called like `aC` and `Ca`; of `one_way` ones there is no other. `lanes` gives edges
    attributes for each of their lanes, in XML; connections in `missing` are left out.
    """
    edges, text = {}, []
    for name, place in places.items():
        edges |= {
            f"{name}C": (name, "C", place, (0.0, 0.0)),
            f"C{name}": ("C", name, (0, 0), place),
        }
    for edge in one_way:
        edges.pop(edge[::-1])
    for edge, (origin, target, start, end) in edges.items():
        (x, y), (u, v) = start, end
        length = math.dist(start, end)
        dx, dy = (u - x) / length, (v - y) / length
        side = 0.0 if edge in one_way else -1.6 if left else 1.6
        cut = 7.2
        begin, stop = (cut, length) if origin == "C" else (0.0, length - cut)
        shape = " ".join(f"{x + dx * s + dy * side:.3f},{y + dy * s - dx * side:.3f}"
                         for s in (begin, stop))  # fmt: skip
        text.append(f'<edge id="{edge}" from="{origin}" to="{target}" name="{edge} street">')
        common = f'speed="13.89" length="{stop - begin:.2f}" shape="{shape}"'
        for k, own in enumerate(lanes.get(edge, [""])):
            text.append(f'<lane id="{edge}_{k}" {common} {own}/>')
        text.append("</edge>")
    for name, (x, y) in {**places, "C": (0.0, 0.0)}.items():
        text.append(f'<junction id="{name}" type="priority" x="{x}" y="{y}"/>')
    for into, out_of in itertools.product(edges, edges):
        if into[-1] == out_of[0] == "C" and (into, out_of) not in missing:
            text.append(f'<connection from="{into}" to="{out_of}" fromLane="0" toLane="0"/>')
    lefthand = ' lefthand="true"' if left else ""
    return "\n".join([f"<net{lefthand}>", *text, extra, "</net>", ""])


def pack_of(
    vehicles: Records, lanes: Records, layout: Layout, law: Law
) -> tuple[packed.Floats, packed.Ints]:
    """The vehicles that drive, packed as `minisim.engine.packed` does when they are inserted."""
    floats, ints = packed.empty_pack(vehicles, lanes, layout)
    for name in ("slot", "driving", "entered"):
        lanes[name] = 0
    for lane in range(len(lanes)):
        for row in range(lanes["first"][lane], lanes["next"][lane]):
            if vehicles["status"][row] == DRIVING:
                packed.admit(floats, ints, vehicles, lanes, layout, law, row)
                lanes["entered"][lane] += row < lanes["front"][lane]
    return floats, ints


def rearranged(simulation: Simulation) -> None:
    """Let a simulation go on from its rows, which a test has changed."""
    simulation._pack = pack_of(
        simulation._vehicles, simulation._lanes, simulation._layout, simulation._law
    )


#: German: a row per stream and interval, a column per class; streams by approach and letter.
GERMAN = "\n".join([
    "zufahrt,spur,kennung,intervall_start,intervall_ende,rad,krad,pkw,lkw,bus",
    *(f"{arm},1,{arm}{turn}..(1),{start},{end},2,1,{n},0,{bus}"
      for start, end, n in (("06:00", "06:15", 20), ("06:15", "06:30", 40))
      for arm in "ABCD" for turn, bus in (("L", 0), ("G", 3), ("R", 0))),
    "B,2,BW..(14),06:00,06:15,0,0,7,0,0",
    "B,2,BW..(14),06:15,06:30,0,0,0,0,0",
])  # fmt: skip

#: American: a row per interval with a column per movement, no classes.
MOVES = [f"{way}{turn}" for way in ("NB", "SB", "EB", "WB") for turn in "LTRU"]
AMERICAN = "\n".join([
    "\t".join(["Time", *MOVES]),
    "\t".join(["7:45 AM", *(["10", "80", "5", "1"] * 4)]),
    "\t".join(["8:00 AM", *(["20", "90", "15", "0"] * 4)]),
])  # fmt: skip

#: British: a row per interval, pair of arms and class; semicolons and decimal commas.
BRITISH = "\n".join([
    "Time;From;To;Class;Vehicles",
    *(f"{time};{a};{b};{kind};{n}"
      for time in ("07:00 - 07:15", "07:15 - 07:30")
      for a in "123" for b in "123" if a != b
      for kind, n in (("Car", "12,5"), ("OGV1", "2"), ("PSV", "1"), ("Pedal Cycle", "4"))),
])  # fmt: skip


def read_count(
    folder: Path, text: str, mapping: Mapping[str, Any] | None = None, encoding: str = "utf-8"
) -> Count:
    """A count from the text of a sheet."""
    path = folder / "sheet.csv"
    path.write_bytes(text.encode(encoding))
    return read_counts(path, mapping)


def at(
    vehicle: int, movement: str, s: float, v: float, *, time: float = 0.0, row: bool = True,
    a: float = 0.0,
) -> dict[str, Any]:  # fmt: skip
    """One row of a trajectory frame of a `small_scenario`; `s` from the junction entry."""
    entry = small_scenario(4).intersection.approach_length
    zero = dict.fromkeys(TRAJECTORY_COLUMNS, 0.0)
    return zero | {
        "time_s": time, "vehicle": vehicle, "lane": movement[0], "manoeuvre": int(movement[1]),
        "s_m": entry + s, "speed_mps": v, "acceleration_mps2": a, "right_of_way": row,
    }  # fmt: skip


def frame_of(*rows: dict[str, Any]) -> pd.DataFrame:
    """A trajectory frame."""
    return pd.DataFrame(list(rows), columns=list(TRAJECTORY_COLUMNS))


def glide(vehicle: int, movement: str, start: float, v: float) -> list[dict[str, Any]]:
    """A vehicle at constant speed whose front passes the entry at `start`; a row per 0.1 s."""
    times = np.arange(round(start * 10) - 60, round(start * 10) + 60) / 10.0
    return [at(vehicle, movement, v * (t - start), v, time=t) for t in times.tolist()]
