"""Experiments from a TOML file: every combination of what is listed, block by block.

    seeds = 10                          # 1 … 10, or a list
    profile = "fair"
    density = [150, 250, 350]
    split = ["balanced", "4:3:2:1"]
    controller = ["dim", "fixed-time"]
    # humans = [0, 0.2]                 # with controllers of DIM only

    [[experiment]]                      # what is above holds here too
    scenario = "four-way"

    [[experiment]]
    scenario = { name = "custom", label = "skewed", bearings = [0, 80, 190, 260] }
    controller = { name = "dim", label = "west first", priorities = [1, 2, 3, 0] }

Without `[[experiment]]` the file is one block. In a controller's table, everything but `name` and
`label` is a parameter of its recipe.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from minisim.arrivals import Arrivals, read_arrivals
from minisim.control import Controller
from minisim.errors import (
    FileError,
    InputError,
    MinisimError,
    choice,
    instance,
    integer,
    show,
)
from minisim.hosting import ON_COLLISION
from minisim.results.metrics import named_metrics
from scenarios.controllers import controller_named
from scenarios.library import scenario_named
from scenarios.recipe import Recipe
from scenarios.scenario import Profile, Scenario, profile_named
from scenarios.sweep.keys import key_of
from scenarios.sweep.rows import identity_of

#: More is surely a typing error.
MAX_EXPERIMENTS = 1_000_000

#: What may be listed, and its value where it is not; every combination is run.
AXES: dict[str, Any] = {
    "scenario": "four-way",
    "side": "left",
    "profile": "paper",
    "model": "poisson",
    "split": "balanced",
    "turns": "uniform",
    "density": 350.0,
    "arrivals": None,
    "controller": "dim",
    "humans": 0.0,
    "seeds": 10,
}
#: What holds for a whole block.
SINGLE: dict[str, Any] = {
    "horizon": 3600.0, "warmup": 0.0, "min_headway": 1.5, "on_collision": "stop",
    "metrics": (),
}  # fmt: skip

#: What recorded arrivals replace.
DRAWN = ("density", "split", "turns", "model", "min_headway")

#: Shares, written "4:3:2:1" or [4, 3, 2, 1]; of several, either way, every one is run.
SHARES = ("split", "turns")

#: A junction of one's own.
CUSTOM = '{ name = "custom", bearings = [0, 80, 190, 260] }'

#: Keys of a scenario's table.
JUNCTION = ("name", "label", "bearings", "lane_width", "junction_radius", "arm_length")


def read_experiments(
    path: str | os.PathLike[str], *, seeds: int | None = None, horizon: float | None = None
) -> list[Recipe]:
    """The experiments of a file, each once; `seeds` and `horizon` replace what it says of them.

    Raises:
        FileError: unreadable, or no TOML.
        InputError: an unknown key (with the nearest one), a value that is not allowed, or a
            combination that cannot be run; the message names file, block and key.
    """
    instance("experiment file", path, (str, os.PathLike))
    place = os.fspath(path)
    table = _load(path)
    blocks = table.pop("experiment", [{}])
    given = {"seeds": seeds, "horizon": horizon}
    overrides = {key: value for key, value in given.items() if value is not None}
    with _at(place):
        _check_keys("key", table, [*AXES, *SINGLE, "experiment"])
        if not isinstance(blocks, list) or not all(isinstance(block, dict) for block in blocks):
            raise InputError("experiments are written [[experiment]], with two brackets")
    found: dict[str, Recipe] = {}
    for number_, block in enumerate(blocks, start=1):
        with _at(f"{place}: [[experiment]] {number_}" if len(blocks) > 1 else place):
            _check_keys("key", block, [*AXES, *SINGLE])
            if not {**table, **block}:
                raise InputError(
                    "nothing is said of what to run; name a scenario, a controller and a density, "
                    "or any other of " + ", ".join((*AXES, *SINGLE))
                )
            merged = {**table, **block, **overrides}
            for experiment in _block(merged, Path(path).parent):
                found.setdefault(key_of(experiment), experiment)
    with _at(place):
        _check_names(found.values())
    return list(found.values())


def check_can_run(experiments: Iterable[Recipe]) -> None:
    """Start every controller at every site once, since most that cannot work says so there.

    Raises:
        InputError: a controller that cannot serve a scenario.
    """
    tried: set[tuple[str, ...]] = set()
    for experiment in experiments:
        what = identity_of(experiment)
        del what["seed"]
        cell = tuple(map(str, what.values()))
        if cell in tried:
            continue
        tried.add(cell)
        try:
            experiment.driven.start(experiment.scenario.site(experiment.seed))
        except MinisimError as error:
            raise InputError(
                f"{experiment.name} cannot serve {what['scenario']} at {what['density']:g} "
                f"veh/h/lane, profile {what['profile']}: {error}"
            ) from error


def _load(path: str | os.PathLike[str]) -> dict[str, Any]:
    try:
        with open(path, "rb") as file:
            return tomllib.load(file)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{os.fspath(path)} is not valid TOML: {error}") from error
    except (OSError, ValueError, RecursionError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"cannot read experiments from {os.fspath(path)}: {reason}") from error


def _block(block: Mapping[str, Any], folder: Path) -> Iterator[Recipe]:
    """Every combination of a block."""
    if "arrivals" in block:
        clash = [key for key in DRAWN if key in block]
        if clash:
            raise InputError(f"arrivals replaces {', '.join(clash)}; give one or the other")
    axes = {key: _listed(key, block.get(key, default)) for key, default in AXES.items()}
    axes["seeds"] = _seeds(block.get("seeds", AXES["seeds"]))
    count = prod(map(len, axes.values()))
    if count > MAX_EXPERIMENTS:
        raise InputError(f"{count} experiments are more than {MAX_EXPERIMENTS}")
    single = {key: block.get(key, default) for key, default in SINGLE.items()}
    choice("on_collision", single["on_collision"], ON_COLLISION)
    metrics = named_metrics(single["metrics"])
    seeds, controllers, shares = (axes.pop(key) for key in ("seeds", "controller", "humans"))
    for values in product(*axes.values()):
        chosen = dict(zip(axes, values, strict=True))
        scenario = _scenario(chosen, single, folder)
        for given, share in product(controllers, shares):
            with _at("controller"):
                controller, label = _controller(given, scenario.profile)
            for seed in seeds:
                yield Recipe(
                    scenario, controller, seed, share, label, single["on_collision"], metrics
                )


def _scenario(chosen: Mapping[str, Any], single: Mapping[str, Any], folder: Path) -> Scenario:
    with _at("scenario"):
        junction = _table(chosen["scenario"])
        _check_keys("key of a scenario", junction, JUNCTION)
        name, label = junction.pop("name"), junction.pop("label", "")
        instance("label", label, str)
        if name == "custom" and "bearings" not in junction:
            raise InputError(f"custom needs bearings, such as scenario = {CUSTOM}")
    made = scenario_named(
        name,
        junction.pop("bearings", None),
        **junction,
        side=_text("side", chosen["side"]),
        profile=profile_named(_text("profile", chosen["profile"])),
        model=_text("model", chosen["model"]),
        min_headway=single["min_headway"],
        density=chosen["density"],
        split=chosen["split"],
        turns=chosen["turns"],
        horizon=single["horizon"],
        warmup=single["warmup"],
    )
    return replace(
        made, name=label or made.name, recorded=_recorded(chosen["arrivals"], folder, made)
    )


def _recorded(file: object, folder: Path, scenario: Scenario) -> Arrivals | None:
    if file is None:
        return None
    return read_arrivals(folder / _text("arrivals", file), scenario.intersection.n)


def _controller(given: object, profile: Profile) -> tuple[Controller, str]:
    """The controller that an entry describes, and its label."""
    table = _table(given)
    label = table.pop("label", "")
    instance("label", label, str)
    return controller_named(table, profile), label


def _table(given: object) -> dict[str, Any]:
    """A name or a table with one, as a table."""
    if isinstance(given, str):
        return {"name": given}
    if not isinstance(given, dict):
        raise InputError(f"must be a name or a table with one, got {show(given)}")
    if "name" not in given:
        raise InputError(f"the table {show(given)} has no name")
    return dict(given)


def _listed(key: str, value: object) -> list[Any]:
    one = key in SHARES and isinstance(value, list) and not any(map(_is_many, value))
    values = [value] if one or not isinstance(value, list) else value
    if not values:
        raise InputError(f"{key} is an empty list; leave it out, or list something")
    return values


def _is_many(value: object) -> bool:
    """Whether it is shares of its own, and no single one."""
    return isinstance(value, (str, list))


def _seeds(value: object) -> list[int]:
    if isinstance(value, list):
        return [integer("seeds: a seed", seed, low=0) for seed in _listed("seeds", value)]
    try:
        count = integer("seeds", value, low=1, high=MAX_EXPERIMENTS)
    except InputError as error:
        raise InputError(f"{error}; or a list of seeds") from error
    return list(range(1, count + 1))


def _text(key: str, value: object) -> str:
    if not isinstance(value, str):
        raise InputError(f"{key} must be a text, got {show(value)}")
    return value


def _check_keys(what: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
    allowed = list(known)
    for key in table:
        choice(what, key, allowed)


def _check_names(experiments: Iterable[Recipe]) -> None:
    """Rows of different experiments must be told apart by what they say of themselves."""
    seen: set[tuple[str, ...]] = set()
    for experiment in experiments:
        what = identity_of(experiment)
        row = tuple(map(str, what.values()))
        if row in seen:
            raise InputError(
                f"two different experiments would both be called {what['controller']} on "
                f"{what['scenario']}; give a controller or a scenario a label"
            )
        seen.add(row)


@contextmanager
def _at(place: str) -> Iterator[None]:
    """Put the place before the message of whatever is wrong inside."""
    try:
        yield
    except (InputError, FileError) as error:
        kind: Callable[[str], MinisimError] = type(error)
        raise kind(f"{place}: {error}") from error
