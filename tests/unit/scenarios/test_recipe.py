"""A recipe of a run: what it takes, what it refuses, and the run that it makes."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from baselines import V2IC, AllWayStop, FixedTime
from dim import AsRunDim, Dim, Mixed
from minisim import simulate
from minisim.channel import Channel
from minisim.control import Session, Site, Unregulated
from minisim.errors import InputError
from minisim.link import Linked
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


@pytest.mark.parametrize(
    ("metrics", "asked", "options"),
    [
        ((), {}, {}),
        (("stops", "pets"), {}, {"record": "all"}),
        (("queue",), {"record": "junction"}, {"record": "all"}),
        (("order_reversals",), {}, {"record": "junction"}),
        (("order_reversals",), {"record": "all"}, {"record": "all"}),
        (("p99_decision_us",), {}, {"timed": True}),
        (("decisions", "messages", "throughput_vph", "level_of_service"), {}, {}),
    ],
)
def test_only_what_metrics_need_is_recorded(
    metrics: tuple[str, ...], asked: dict[str, Any], options: dict[str, Any]
) -> None:
    given: dict[str, Any] = {}
    Recipe(SHORT, Dim(), metrics=metrics).run(lambda *_, **more: given.update(more), **asked)
    assert given == {"on_collision": "stop", **options}


def test_humans_drive_among_vehicles_of_dim() -> None:
    dim = Dim(order="lanes")
    assert Recipe(SHORT, dim).driven is dim
    assert Recipe(SHORT, dim, humans=1).driven == Mixed(dim, 1.0)
    assert Recipe(SHORT, AllWayStop()).driven == AllWayStop()
    with pytest.raises(InputError, match=r"among vehicles of DIM .* not with 'all-way-stop'"):
        Recipe(SHORT, AllWayStop(), humans=0.5)


def test_messages_fail_only_where_some_are_sent() -> None:
    failing = Recipe(SHORT, V2IC(), latency=0.1, jitter=0.2, loss=0.3)
    assert failing.driven == Linked(V2IC(), Channel(0.1, 0.2, 0.3))
    assert failing.name == "v2ic+latency=0.1+jitter=0.2+loss=0.3"
    assert Recipe(SHORT, V2IC(), loss=0).driven == V2IC()
    for silent in (Dim(), FixedTime(), AllWayStop()):
        with pytest.raises(InputError, match=f"such as v2ic; {silent.name} sends none"):
            Recipe(SHORT, silent, loss=0.3)
    with pytest.raises(InputError, match="loss must be at least 0 and at most 1, got 2"):
        Recipe(SHORT, V2IC(), loss=2)


def test_without_a_label_it_is_called_as_its_controller() -> None:
    assert Recipe(SHORT, Dim()).name == "dim"
    assert Recipe(SHORT, Dim(), humans=0.2).name == Mixed(Dim(), 0.2).name
    assert Recipe(SHORT, Dim(), label="ours").name == "ours"


def test_it_is_a_value() -> None:
    recipe, again = (Recipe(SHORT, Dim(), 1, humans=0.2) for _ in range(2))
    assert pickle.loads(pickle.dumps(recipe)) == again
    assert hash(recipe) == hash(again)


def test_a_text_or_table_names_the_controller() -> None:
    said: Any = ("dim:gate=harmonious", {"name": "dim", "gate": "harmonious"})
    wanted = Recipe(four_way(), Dim(gate="harmonious"))
    assert [Recipe(four_way(), one) for one in said] == [wanted, wanted]
    published: Any = "dim"
    assert Recipe(four_way(profile="as_run"), published).controller == AsRunDim()
    with pytest.raises(InputError, match="unknown gate 'harmonius'"):
        Recipe(four_way(), "dim:gate=harmonius")  # type: ignore[arg-type]


def test_simulate_says_how_a_text_becomes_a_controller() -> None:
    named: Any = "dim:gate=harmonious"
    with pytest.raises(InputError, match=r"make it with scenarios.controllers.controller_named"):
        simulate(four_way(), named)


def test_a_controller_that_cannot_serve_a_site_is_named() -> None:
    with pytest.raises(InputError, match=r"^fixed-time:greens=\(5,5,5\): greens has 3 values"):
        simulate(four_way(), FixedTime(greens=(5, 5, 5)))


@dataclass(frozen=True)
class Constant:
    """A controller with one name for all its parameters."""

    k: float = 1.0
    name = "dc"

    def start(self, site: Site) -> Session:
        return Unregulated().start(site)


def test_rows_tell_parameters_of_one_name_apart() -> None:
    recipes = [Recipe(four_way(0, horizon=1), Constant(k)) for k in (1.0, 2.0)]
    assert [recipe.name for recipe in recipes] == ["dc", "dc:k=2"]
    assert recipes[1].run().summary()["controller"] == "dc:k=2"


@pytest.mark.parametrize("name", ["", "a\nb", 3])
def test_a_controller_needs_a_name_that_can_be_printed(name: Any) -> None:
    nameless: Any = SimpleNamespace(name=name, start=Unregulated().start)
    with pytest.raises(InputError, match=r"the name of controller .* must be a text"):
        Recipe(four_way(), nameless)
