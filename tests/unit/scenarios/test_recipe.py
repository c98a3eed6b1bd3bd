"""A recipe of a run: what it takes, what it refuses, and the run that it makes."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

from baselines import AllWayStop
from dim import Dim, Mixed
from minisim import simulate
from minisim.errors import InputError
from scenarios import four_way
from scenarios.recipe import Recipe

SHORT = four_way(150.0, horizon=60.0, profile="fair")


def test_it_runs_as_simulate_does() -> None:
    run = Recipe(SHORT, Dim(), 3).run(record="junction")
    assert run.trips.equals(simulate(SHORT, Dim(), 3).trips)
    assert (run.seed, run.record) == (3, "junction")


def test_a_host_gets_all_of_it() -> None:
    given: dict[str, Any] = {}

    def host(*what: Any, **options: Any) -> Any:
        given.update(what=what, options=options)

    Recipe(SHORT, Dim(), 1, humans=0.5, on_collision="teleport").run(host, model="IDM")
    assert given["what"] == (SHORT, Mixed(Dim(), 0.5), 1)
    assert given["options"] == {"on_collision": "teleport", "model": "IDM"}


def test_humans_drive_among_vehicles_of_dim() -> None:
    dim = Dim(order="lanes")
    assert Recipe(SHORT, dim).driven is dim
    assert Recipe(SHORT, dim, humans=1).driven == Mixed(dim, 1.0)
    assert Recipe(SHORT, AllWayStop()).driven == AllWayStop()
    with pytest.raises(InputError, match=r"among vehicles of DIM .* not with 'all-way-stop'"):
        Recipe(SHORT, AllWayStop(), humans=0.5)
    with pytest.raises(InputError, match="share of humans must be at least 0 and at most 1"):
        Recipe(SHORT, dim, humans=1.5)


def test_its_name_is_that_of_the_controller_unless_told() -> None:
    assert Recipe(SHORT, Dim()).name == "dim"
    assert Recipe(SHORT, Dim(), humans=0.2).name == Mixed(Dim(), 0.2).name
    assert Recipe(SHORT, Dim(), label="ours").name == "ours"


def test_it_is_a_value() -> None:
    recipe = Recipe(SHORT, Dim(), 1, humans=0.2)
    assert pickle.loads(pickle.dumps(recipe)) == recipe
    assert hash(recipe) == hash(Recipe(SHORT, Dim(), 1, humans=0.2))
