"""The table of controllers, and the ways to name one."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from baselines import FixedTime, V2ICAsRun
from dim import AsRunDim, Dim, HarmonyMatrix, Monitor, NoisyPerception, Zones
from minisim.control import Controller
from minisim.errors import InputError
from scenarios import controllers
from scenarios.controllers import (
    CONTROLLERS,
    RIVALS,
    VARIANTS,
    controller_named,
    plugins,
    safe,
    unused_plugins,
)

NOISY = Dim(perception=NoisyPerception(0.1))


@pytest.mark.parametrize("name", [*CONTROLLERS, *VARIANTS])
def test_names_are_spellings(name: str) -> None:
    assert controller_named(name, "fair").name == name


def test_the_paper_s_four_come_first_among_the_rivals() -> None:
    assert RIVALS == (
        "dim", "dim:gate=harmonious", "dim:gate=passed", "fixed-time", "fixed-time:facing=true",
        "adaptive", "v2ic", "all-way-stop", "reservation", "max-pressure",
        "max-pressure:facing=true", "slots", "slots:batch=1", "platoons", "platoons:service=gated",
    )  # fmt: skip
    assert set(RIVALS) < set(safe()) < set(VARIANTS)
    assert not any("as-run" in name or name == "unregulated" for name in safe())


@pytest.mark.parametrize(
    ("spec", "wanted"),
    [
        ("dim:gate=harmonious", Dim(gate="harmonious")),
        ("dim: gate = harmonious , order = lanes", Dim(order="lanes", gate="harmonious")),
        ("dim:monitor=on", Dim(monitor=Monitor())),
        ("dim:monitor=ON(patience=3)", Dim(monitor=Monitor(patience=3))),
        ("dim:monitor=off,matrix=None", Dim()),
        ("dim:priorities=(1,0,2,3)", Dim(priorities=(1, 0, 2, 3))),
        ("dim:matrix=paper(4)", Dim(matrix=HarmonyMatrix.paper(4))),
        ("fixed-time:order=(c,b,a,d)", FixedTime(order=(2, 1, 0, 3))),
        ("dim:zones=zones(green=3)", Dim(zones=Zones(green=3))),
        ("fixed-time:equal_greens=TRUE", FixedTime(equal_greens=True)),
        ("fixed-time:greens=[5,6.5,7,8]", FixedTime(greens=(5, 6.5, 7, 8))),
        ("dim-as-run:names='acbd'", AsRunDim(names="acbd")),
        ("baselines:FixedTime(amber=3)", FixedTime(amber=3)),
        ("baselines.signals.fixed_time:FixedTime(5)", FixedTime(5)),
        ({"name": "dim", "gate": "harmonious"}, Dim(gate="harmonious")),
        ({"name": "dim", "monitor": "on", "period": "none"}, Dim(monitor=Monitor())),
        ({"name": "dim:gate=harmonious", "order": "lanes"}, Dim(order="lanes", gate="harmonious")),
        ({"name": "dim", "perception": {"name": "noisy", "intent_error": 0.1}}, NOISY),
        ({"name": "dim", "perception": "noisy(intent_error=0.1)"}, NOISY),
        ({"name": "dim", "perception": NoisyPerception(0.1)}, NOISY),
        (Dim(order="lanes"), Dim(order="lanes")),
    ],
)  # fmt: skip
def test_texts_tables_and_recipes_say_the_same(spec: Any, wanted: Controller) -> None:
    assert controller_named(spec) == wanted


def test_the_profile_as_run_means_the_published_rules() -> None:
    assert controller_named("dim", "as_run") == AsRunDim()
    assert controller_named({"name": "v2ic"}, "as_run") == V2ICAsRun()
    assert controller_named("dim:gate=harmonious", "as_run") == Dim(gate="harmonious")
    assert controller_named("dim", "as_run_signals") == Dim()


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("dum", "unknown controller 'dum'; allowed: dim, .*; did you mean 'dim'"),
        ("dim:gat=clear", "unknown dim parameter 'gat'.*; did you mean 'gate'"),
        ("dim:gate=harmonius", "dim: unknown gate 'harmonius'.*; did you mean 'harmonious'"),
        ("dim:gate=harmonious(k=1)", r"unknown gate harmonious\(k=1\)"),
        ("dim:period=-1", r"dim: period \[s\] must be above 0, got -1"),
        ("dim:period=1e999", r"period \[s\] must be a finite number, got inf"),
        ("dim:monitor=on(patience=100)", r"monitor=on: patience \[s\] must be .* at most 60"),
        ("dim:monitor=onn", "unknown monitor 'onn'; allowed: on, off, none; did you mean 'on'"),
        ("dim:monitor=3", "monitor must be on, off, none or a Monitor, got 3"),
        ("dim:perception=noisy(knd=1)", "unknown perception=noisy parameter 'knd'.*mean 'kind'"),
        ("dim:gate=clear,gate=clear", "dim is given gate twice"),
        ("dim:gate", "written dim:key=value,key=value, got 'dim:gate'"),
        ("dim:gate=", "cannot read 'gate=', the parameters of dim"),
        ("dim:a=b)(c", "cannot read"),
        ("dim:gate=1+1", r"cannot read '1\+1' among the parameters of dim"),
        ("dim:gate=b'x'", "cannot read"),
        ("dim:**x", "cannot read 'x'"),
        ("dim:matrix=HarmonyMatrix#12345678", "a value that only Python can give"),
        ("unregulated:k=1", "unregulated has no parameters, got k"),
        ("DIM", "unknown controller 'DIM'.*or a class of your own.*; did you mean 'dim'"),
        ("DIM:gate=clear", "cannot read controller .*; did you mean 'dim:gate=clear'"),
        ("dim(gate=clear)", "; did you mean 'dim:gate=clear'"),
        ("dim:gate=clear,", "the parameters of dim end with a comma"),
        ("dim:monitor=on(patience=3", "cannot read .*; a bracket is missing"),
        ("dim:perception=none", "perception must be exact, noisy or a Perception, got None"),
        ("dim:perception=noisy(shared=no)", "shared must be true or false, got 'no'"),
        ("dim:matrix=paper", r"matrix=paper needs n; write matrix=paper\(n=…\)"),
        ("dim:matrix=file(my/m.csv)", "cannot read 'my/m.csv' .* quoted texts such as 'my/file."),
        ("dim:matrix=file(/m.csv)", "cannot read .* paths in quotes"),
        ("dim:turn_time=5", "turn_time has an effect only with priorities=rotating or waiting"),
        ("dim:priorities=rotating,sensor_range=90", "sensor_range .* only with priorities=waiting"),
        ("fixed-time:greens=5,max_cycle=99", "max_cycle has an effect only with Webster's greens"),
        ("adaptive:order=(a,z)", "unknown lane in order 'z'"),
        ("mine.Fast", "; did you mean 'mine:Fast'"),
        ("pkg.mine.Fast(k=3)", r"; did you mean 'pkg.mine:Fast\(k=3\)'"),
        ("mine:Fast(k=(1,2)", "the parameters of mine:Fast: .*; a bracket is missing"),
        ("mine:Fast(k=3", r"; did you mean 'mine:Fast\(k=3\)'"),
        ("mine:Fast:k=3", r"; did you mean 'mine:Fast\(k=3\)'"),
        ("one-at-a-time:sight=60", "unknown controller 'one-at-a-time'.*or a class of your own"),
        ("os:PathLike", "os:PathLike is not a controller: it has no name and no start"),
        ("minisim.control:Controller", "Controller is not a controller: it is a class"),
        ({"name": 3}, "needs a text as its name"),
        ({"name": "dim", "gate": 3}, "unknown gate 3"),
        (Dim, "is not a controller: it is a class"),
        (5, "5 is not a controller: it has no name and no start"),
    ],
)
def test_what_is_wrong_is_one_sentence(spec: Any, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        controller_named(spec)
    assert "\n" not in str(error.value)


class Distribution:
    name = "minisim-extra"


def plugin(monkeypatch: pytest.MonkeyPatch, *points: tuple[str, str]) -> None:
    """Pretend that a package registers these (name, value)."""
    registered = [EntryPoint(name, value, "minisim.controllers") for name, value in points]
    for point in registered:
        vars(point)["dist"] = Distribution()
    monkeypatch.setattr(controllers, "entry_points", lambda group: registered)
    plugins.cache_clear()


@pytest.fixture(autouse=True)
def _no_plugins_left() -> Any:
    yield
    plugins.cache_clear()


def test_installed_packages_add_names(monkeypatch: pytest.MonkeyPatch) -> None:
    plugin(monkeypatch, ("webster", "baselines:FixedTime"))
    assert controller_named("webster:amber=3") == FixedTime(amber=3)


def test_names_that_are_taken_are_listed_as_unused(monkeypatch: pytest.MonkeyPatch) -> None:
    twice = ("own", "baselines:FixedTime"), ("own", "baselines:Adaptive")
    plugin(monkeypatch, ("dim", "baselines:FixedTime"), *twice)
    assert controller_named("dim") == Dim(), "ours are not hidden"
    assert controller_named("own") == FixedTime()
    assert unused_plugins() == {
        "dim of minisim-extra": "not used: minisim has a controller of that name",
        "own of minisim-extra": "not used: minisim-extra has a controller of that name",
    }


def test_a_registered_class_that_is_not_a_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    plugin(monkeypatch, ("extra", "os:PathLike"))
    with pytest.raises(InputError, match="extra is not a controller: it has no name and no start"):
        controller_named("extra")


@pytest.mark.parametrize("value", ["no_such_module:Thing", "baselines:Thing"])
def test_a_broken_package_is_named(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    plugin(monkeypatch, ("extra", value))
    assert controller_named("dim") == Dim()
    with pytest.raises(InputError, match="controller extra of package minisim-extra cannot be"):
        controller_named("extra")
    with pytest.raises(InputError, match="did you mean 'extra'"):
        controller_named("extras")
    assert "no_such_module" not in sys.modules
