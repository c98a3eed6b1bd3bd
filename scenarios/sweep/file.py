"""Recipes from a TOML file: every combination of the listed values, block by block.

    seeds = 10                          # 1 … 10, or a list
    profile = "fair"
    density = [150, 250, 350]
    split = ["balanced", "4:3:2:1"]
    controller = ["dim", "fixed-time"]
    # fleet = { car = 0.9, bus = 0.1 }  # shares of vehicle types, perhaps with unit = "pcu"
    # humans = [0, 0.2]                 # with controllers of DIM only
    # loss = [0, 0.1]                   # of messages, with latency and jitter [s]
    # arrivals = "count.csv"            # a table to replay instead of density, split and turns,
    # demand = "day.toml"               # or demand by time of day (`minisim.demandfile`)
    # start = "07:00"                   # from this time of day on

    [[experiment]]                      # the lines above apply here too
    scenario = "four-way"

    [[experiment]]
    scenario = { name = "custom", label = "skewed", bearings = [0, 80, 190, 260] }
    controller = { name = "dim", label = "west first", priorities = [1, 2, 3, 0] }

    [[experiment]]                      # a file, see `scenarios.junctions`; or a junction.toml
    scenario = { name = "town.net.xml", node = "252016277" }

Without one, the file is a block. A controller's table has a name, a label and parameters.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from minisim import hosting
from minisim.demandfile import read_demand
from minisim.errors import (
    FileError,
    InputError,
    MinisimError,
    choice,
    instance,
    integer,
    number,
    show,
)
from minisim.files import read_file
from minisim.inflow import MAX_TIME
from minisim.parameters import parameters
from scenarios.controllers import CONTROLLERS, controller_named
from scenarios.defaults import AXES, CUSTOM, SINGLE
from scenarios.junctions import is_junction_file
from scenarios.library import DRAWN, refuse_beside, replayed, scenario_named
from scenarios.loading import metrics_named
from scenarios.recipe import Recipe
from scenarios.scenario import Scenario
from scenarios.sweep.keys import key_of
from scenarios.sweep.rows import identity_of

#: More runs must be a mistake.
MAX_RUNS = 1_000_000

#: Keys of shares, written "4:3:2:1" or [4, 3, 2, 1]; a list may hold several of both forms.
SHARES = ("split", "turns")

#: Keys that say how a controller's vehicles are driven and told.
DRIVING = ("humans", "latency", "jitter", "loss")

#: Keys of a scenario's table.
JUNCTION = (
    "name", "label", "bearings", "lane_width", "junction_radius", "arm_length", "roads",
    "forbidden", "node",
)  # fmt: skip


def read_experiments(
    path: str | os.PathLike[str], *, seeds: int | None = None, horizon: float | None = None
) -> list[Recipe]:
    """The recipes of a file, each once; `seeds` and `horizon` replace those of the file.

    Raises:
        FileError: unreadable, or not TOML.
        InputError: an unknown key (with the nearest one), a value that is not allowed, or a
            combination that cannot be run; the message names file, block and key.
    """
    given = {"seeds": seeds, "horizon": horizon}
    overrides = {key: value for key, value in given.items() if value is not None}
    return experiments_of(read_toml("experiments", path), path, overrides)


def read_toml(what: str, path: str | os.PathLike[str]) -> dict[str, Any]:
    """The table of a TOML file; raises `FileError`."""
    try:
        return tomllib.loads(read_file(what, path).decode())
    except (ValueError, RecursionError) as error:
        raise FileError(f"{os.fspath(path)} is not valid TOML: {error}") from error


def experiments_of(
    table: Mapping[str, Any], path: str | os.PathLike[str], overrides: Mapping[str, Any]
) -> list[Recipe]:
    """The recipes of a file's table; `overrides` replace keys of all blocks; raises as above."""
    place, table = os.fspath(path), dict(table)
    blocks = table.pop("experiment", [{}])
    with _at(place):
        _check_keys("key", table, [*AXES, *SINGLE, "experiment"])
        if not isinstance(blocks, list) or not all(isinstance(block, dict) for block in blocks):
            raise InputError("experiments are written [[experiment]], with two brackets")
        for key in table:
            if all(key in block for block in blocks):
                raise InputError(f"{key} above the blocks is never used: each has its own")
    recipes: dict[str, Recipe] = {}
    for count, block in enumerate(blocks, start=1):
        with _at(f"{place}: [[experiment]] {count}" if len(blocks) > 1 else place):
            _check_keys("key", block, [*AXES, *SINGLE])
            said = {**table, **block}
            if not said:
                raise InputError(
                    "the file does not say what to run; name a scenario, a controller and a "
                    "density, or any other of " + ", ".join((*AXES, *SINGLE))
                )
            _seeds(said.get("seeds", 1))  # checked even if the command line replaces it
            number("horizon [s]", said.get("horizon", 1.0), above=0, high=MAX_TIME)
            for recipe in _recipes({**said, **overrides}, Path(path).parent):
                recipes.setdefault(key_of(recipe), recipe)
    with _at(place):
        _check_names(recipes.values())
    return list(recipes.values())


def check_can_run(recipes: Iterable[Recipe]) -> None:
    """Start every controller at every site once; `InputError` for a site that one cannot serve."""
    first = {tuple({**identity_of(it), "seed": 0}.values()): it for it in recipes}
    for recipe in first.values():
        scenario = recipe.scenario
        try:
            hosting.start(recipe.driven, scenario.site(recipe.seed))
        except MinisimError as error:
            raise InputError(
                f"{recipe.name} cannot serve {scenario.name} at {scenario.density:g} veh/h/lane, "
                f"profile {scenario.profile.name}: {error}"
            ) from error


def _recipes(block: Mapping[str, Any], folder: Path) -> Iterator[Recipe]:
    """Every combination of a block."""
    for whole in ("arrivals", "demand"):
        if whole in block:
            refuse_beside(whole, (key for key in ("demand", *DRAWN) if key in block))
    axes = {key: _listed(key, block.get(key, default)) for key, default in AXES.items()}
    if "side" not in block:  # a file of a junction has its own
        axes["side"] = [None]
    if "min_headway" in block and "shifted" not in axes["model"]:
        raise InputError("min_headway needs the model 'shifted'")
    seeds = axes["seeds"] = _seeds(block.get("seeds", AXES["seeds"]))
    if (count := prod(map(len, axes.values()))) > MAX_RUNS:
        raise InputError(f"{count} runs are more than {MAX_RUNS}")
    single = {key: block.get(key, default) for key, default in SINGLE.items()}
    reaction = choice("on_collision", single.pop("on_collision"), hosting.ON_COLLISION)
    metrics = metrics_named(single.pop("metrics"))
    del axes["seeds"]
    controllers = axes.pop("controller")
    drivings = [*product(*(axes.pop(key) for key in DRIVING))]
    for values in product(*axes.values()):
        scenario = _scenario({**dict(zip(axes, values, strict=True)), **single}, folder)
        for given, driving in product(controllers, drivings):
            with _at("controller"):
                table = _table(given)
                label = table.pop("label", "")
                controller = controller_named(table, scenario.profile)
            for seed in seeds:
                yield Recipe(
                    scenario, controller, seed, label=label, on_collision=reaction,
                    metrics=metrics, **dict(zip(DRIVING, driving, strict=True)),
                )  # fmt: skip


def _scenario(chosen: dict[str, Any], folder: Path) -> Scenario:
    recorded, start = chosen.pop("arrivals"), chosen.pop("start")
    if recorded is None and chosen["demand"] is None and start is not None:
        raise InputError("start needs arrivals or demand: it is a time of day there")
    if chosen["demand"] is not None:
        instance("demand", chosen["demand"], str)
        chosen["demand"] = read_demand(folder / chosen["demand"], start)
        chosen = {key: value for key, value in chosen.items() if key not in DRAWN}
    elif chosen["model"] != "shifted":
        del chosen["min_headway"]
    for key in ("side", "horizon", "demand_time"):
        if chosen[key] is None:
            del chosen[key]
    with _at("scenario"):
        junction = _table(chosen.pop("scenario"))
        label = junction.pop("label", "")
        _check_keys("key of a scenario", junction, JUNCTION)
        if junction["name"] == "custom" and "bearings" not in junction:
            raise InputError(f"custom needs bearings, such as scenario = {CUSTOM}")
        if isinstance(junction["name"], str) and is_junction_file(junction["name"]):
            junction["name"] = str(folder / junction["name"])
    made = scenario_named(**junction, **chosen)
    if recorded is not None:
        instance("arrivals", recorded, str)
        made = replayed(made, folder / recorded, start)
    return replace(made, name=label or made.name)


def _table(given: object) -> dict[str, Any]:
    """A name or named table, as a table."""
    if isinstance(given, str):
        return {"name": given}
    if not isinstance(given, dict):
        raise InputError(f"must be a name or a table with a name, got {show(given)}")
    if "name" not in given:
        raise InputError(f"the table {show(given)} has no name")
    instance("label", given.get("label", ""), str)
    return dict(given)


def _listed(key: str, value: object) -> list[Any]:
    if not isinstance(value, list):
        return [value]
    if not value:
        raise InputError(f"{key} is an empty list; leave it out, or list something")
    one = key in SHARES and not any(isinstance(item, str | list) for item in value)
    return [value] if one else value


def _seeds(value: object) -> list[int]:
    if isinstance(value, list):
        return [integer("seeds: a seed", seed, low=0) for seed in _listed("seeds", value)]
    try:
        return list(range(1, integer("seeds", value, low=1, high=MAX_RUNS) + 1))
    except InputError as error:
        raise InputError(f"{error}; or a list of seeds") from error


def _check_keys(what: str, table: Iterable[str], known: Iterable[str]) -> None:
    """Raise `InputError` for an unknown key; it says where one belongs that is known elsewhere."""
    for key in table:
        if key not in known and (home := _home(key)):
            raise InputError(f"unknown {what} {key!r}; {home}")
        choice(what, key, known)


def _home(key: str) -> str:
    """Where in a file a key belongs; empty if nowhere."""
    if key in (*AXES, *SINGLE):
        return f"it belongs on a line of its own: {key} = …"
    if key in JUNCTION:
        return f'it belongs to the scenario: scenario = {{ name = "four-way", {key} = … }}'
    makers: dict[str, Any] = {name: entry.make for name, entry in CONTROLLERS.items()}
    for name, make in makers.items():
        if any(it.name == key for it in parameters(make)):
            return f'it belongs to a controller: controller = {{ name = "{name}", {key} = … }}'
    return ""


def _check_names(recipes: Iterable[Recipe]) -> None:
    """Raise `InputError` if the rows of two recipes would look alike."""
    seen: set[tuple[Any, ...]] = set()
    for recipe in recipes:
        row = tuple(identity_of(recipe).values())
        if row in seen:
            raise InputError(
                f"two different runs would both be called {recipe.name} on "
                f"{recipe.scenario.name}; give a controller or a scenario a label"
            )
        seen.add(row)


@contextmanager
def _at(place: str) -> Iterator[None]:
    """Put the place in front of the message of an error in the block."""
    try:
        yield
    except (InputError, FileError) as error:
        raise type(error)(f"{place}: {error}") from error
