"""What a benchmark consists of: a file of experiments with a name and a version, block by block.

A block is a *cell*: a junction and its demand, how vehicles that decide for themselves perceive and
how many of them humans drive, and how messages fail. Controllers come on top, and all have the same
arrivals.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from baselines import V2IC
from dim import Dim, ExactPerception, Perception
from minisim.channel import Channel
from minisim.control import Controller
from minisim.errors import InputError, choice, instance, integer
from minisim.files import read_file
from minisim.link import Linked, radio_of
from minisim.names import name_of
from minisim.results.metric import Metric
from minisim.results.metrics import METRICS
from scenarios.controllers import controller_named, plugins, safe
from scenarios.defaults import AXES, SINGLE
from scenarios.optimum import ABOVE, DELAY, LEAST, Clairvoyant
from scenarios.recipe import Recipe
from scenarios.scenario import Scenario
from scenarios.sweep.file import experiments_of, read_toml
from scenarios.sweep.keys import digest_of

#: What is measured: the whole table of metrics, and what the optimum needs.
MEASURED: tuple[str | Metric, ...] = (*METRICS, DELAY, LEAST, ABOVE)

#: Knows all arrivals beforehand: shown, but not ranked.
SCHEDULE = Clairvoyant.name


@dataclass(frozen=True)
class Cell:
    """A row of the benchmark."""

    scenario: Scenario
    perception: Perception  # of vehicles that decide for themselves
    humans: float  # share of vehicles that humans drive
    channel: Channel  # what messages go through

    @property
    def name(self) -> str:
        """What readers call it."""
        return self.scenario.name

    @property
    def plain(self) -> bool:
        """Whether every controller can be compared on it: the overall rank is over these."""
        exact = self.perception == ExactPerception()
        return exact and not self.humans and not self.channel

    def recipe(self, name: str, controller: Controller, seed: int) -> Recipe:
        """The run of a controller; raises `InputError` if it cannot serve the cell.

        Only a controller with a parameter `perception` errs, and only messages of one with a radio
        fail. Those without a radio serve humans as they serve any vehicle; those with one cannot,
        as humans send no messages.
        """
        humans = self.humans if isinstance(controller, Dim) else 0.0
        talks = radio_of(controller) is not None
        if self.humans and talks:
            raise InputError("needs messages from every vehicle, and humans send none")
        given: Any = controller
        perceives = is_dataclass(given) and "perception" in {it.name for it in fields(given)}
        if perceives and self.perception != ExactPerception():
            given = replace(given, perception=self.perception)
        channel = self.channel if talks else Channel()
        return Recipe(
            self.scenario, given, seed, humans, **asdict(channel), label=name,
            on_collision="record", metrics=MEASURED,
        )  # fmt: skip


@dataclass(frozen=True)
class Benchmark:
    """A definition that has been read."""

    name: str
    version: int
    digest: str  #: of all that it says, so that equal ones can be told
    quick: bool
    seeds: tuple[int, ...]
    cells: tuple[Cell, ...]

    @property
    def plain(self) -> tuple[str, ...]:
        """The names of the cells that count for the overall rank."""
        return tuple(cell.name for cell in self.cells if cell.plain)

    def runs(
        self, controllers: Sequence[tuple[str, Controller]]
    ) -> Iterator[tuple[Cell, str, int, Recipe | InputError]]:
        """Every run, or why there is none; runs on the same arrivals come one after the other."""
        for cell in self.cells:
            for seed in self.seeds:
                for name, controller in ((SCHEDULE, Clairvoyant(cell.scenario)), *controllers):
                    try:
                        made: Recipe | InputError = cell.recipe(name, controller, seed)
                    except InputError as error:
                        made = error
                    yield cell, name, seed, made


def standard_file() -> Path:
    """The file of the benchmark that comes with minisim."""
    return Path(str(resources.files("scenarios") / "data" / "benchmark.toml"))


def read_benchmark(path: str | os.PathLike[str] | None = None, *, quick: bool = False) -> Benchmark:
    """The benchmark of a file, or ours.

    Raises `FileError` for one that cannot be read, and `InputError` for a wrong key or value, two
    cells of one name, or a block that is not one cell; messages name the file.
    """
    path = standard_file() if path is None else Path(path)
    table = read_toml("the benchmark", path)
    said = json.dumps([table, *_files(table, path.parent)], sort_keys=True, default=str)
    digest = digest_of(said)
    name, version = table.pop("name", ""), table.pop("version", None)
    shorter = table.pop("quick", {})
    try:
        instance("name of the benchmark", name, str)
        if not name:
            raise InputError('the benchmark has no name; it is written name = "…"')
        version = integer("version of the benchmark", version, low=1)
        instance("[quick]", shorter, dict)
        for key in shorter:
            choice("key of [quick]", key, (*AXES, *SINGLE))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    recipes = experiments_of(table, path, shorter if quick else {})
    cells: dict[str, Cell] = {}
    for it in recipes:
        channel = Channel(it.latency, it.jitter, it.loss)
        cell = Cell(it.scenario, _perception_of(it, path), it.humans, channel)
        if cells.setdefault(cell.name, cell) != cell:
            raise InputError(
                f"{path}: two cells are called {cell.name!r}; give each scenario a label of its own"
            )
    seeds = tuple(dict.fromkeys(it.seed for it in recipes))
    return Benchmark(name, version, digest[:16], quick, seeds, tuple(cells.values()))


def _perception_of(recipe: Recipe, path: Path) -> Perception:
    """What a block says about vehicles of DIM; `InputError` for what no cell has."""
    for it in fields(Recipe):
        own = it.name in ("scenario", "controller", "seed", "humans", "latency", "jitter", "loss")
        if not own and getattr(recipe, it.name) != it.default:
            raise InputError(f"{path}: cells have no {it.name}; leave it out")
    controller = recipe.controller
    if controller == V2IC() and isinstance(recipe.driven, Linked):
        return ExactPerception()
    if not isinstance(controller, Dim) or controller != Dim(perception=controller.perception):
        raise InputError(
            f"{path}: the controller of a cell is dim, perhaps with a perception, or v2ic if "
            f"messages fail, got {name_of(controller)!r}; --controller says which take part"
        )
    return controller.perception


def _files(table: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """A digest of each file that a definition names."""
    blocks = table.get("experiment", [])
    for block in (table, *(it for it in blocks if isinstance(it, dict))):
        for key in ("scenario", "demand", "arrivals"):
            given = block.get(key)
            for value in given if isinstance(given, list) else [given]:
                name = value.get("name") if isinstance(value, dict) else value
                if isinstance(name, str) and os.path.isfile(folder / name):
                    text = read_file(key, folder / name).replace(b"\r\n", b"\n")
                    yield hashlib.sha256(text).hexdigest()


def entrants(
    only: Sequence[str] | None = None, added: Sequence[str] = ()
) -> list[tuple[str, Controller]]:
    """The controllers that take part, by name: those that promise no collision, or `only` these.

    Raises `InputError` for one that is unknown, cannot be made or is named twice.
    """
    specs = (*(only if only is not None else (*safe(), *plugins())), *added)
    made: dict[str, Controller] = {}
    for spec in specs:
        controller = controller_named(spec, "fair")
        name = name_of(controller)
        if name in made or name == SCHEDULE:
            raise InputError(f"two controllers are called {name}; each takes part once")
        made[name] = controller
    return list(made.items())
