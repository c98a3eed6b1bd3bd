"""The examples in CONTRIBUTING.md are complete: a controller that keeps the contract, a metric."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import minisim
from dim import Dim
from minisim.control import Controller
from minisim.errors import InputError
from minisim.junction.movements import ARM_NAMES, Movement
from minisim.testing import check_controller, small_scenario
from scenarios import four_way
from scenarios.recipe import Recipe
from scenarios.sweep.keys import description_of, key_of

GUIDE = Path(__file__).parents[2] / "CONTRIBUTING.md"


def example(chapter: str = "Add a controller") -> str:
    """The first block of Python in a chapter."""
    text = GUIDE.read_text(encoding="utf-8").split(f"## {chapter}\n")[1]
    return text.split("```python\n")[1].split("```")[0]


def loaded(text: str, folder: Path) -> ModuleType:
    """A text as a module that pickle can find."""
    path = folder / "one_at_a_time.py"
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("one_at_a_time", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    module = loaded(example(), tmp_path_factory.mktemp("guide"))
    yield module
    del sys.modules[module.__name__]


def test_it_takes_fifty_lines() -> None:
    assert len(example().splitlines()) <= 50


def test_it_keeps_the_contract(module: ModuleType) -> None:
    controller = module.OneAtATime()
    assert isinstance(controller, Controller)
    check_controller(controller, density=150.0, horizon=120.0)


def test_it_checks_its_values(module: ModuleType) -> None:
    with pytest.raises(InputError, match="sight"):
        module.OneAtATime(sight=0)
    with pytest.raises(InputError, match=r"sight .* at most 52\.8, got 60"):
        module.OneAtATime(sight=60).start(small_scenario(4, arm_length=60.0).site(1))


def key(controller: Controller) -> str:
    return key_of(Recipe(four_way(), controller, 1))


def test_a_changed_rule_is_another_experiment(
    module: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = key(module.OneAtATime())
    monkeypatch.setitem(sys.modules, module.__name__, module)
    other = loaded(example().replace("nearest = min(", "nearest = max("), tmp_path)
    assert key(module.OneAtATime()) == before != key(other.OneAtATime())
    assert key(Dim()) == key(replace(Dim()))
    assert "code" not in description_of(Recipe(four_way(), Dim(), 1)), "RESULTS says it"


def test_a_version_of_ones_own_tells_rules_apart(module: ModuleType) -> None:
    def named(**own: object) -> Controller:
        """A class of a notebook, which is in no file."""
        kind = type("OneAtATime", (module.OneAtATime,), {"__module__": "notebook", **own})
        made: Controller = kind()
        return made

    assert key(named(version=1)) == key(named(version=1)) != key(named(version=2))
    with pytest.raises(InputError, match="give it a text or an integer `version`"):
        key(named())


def test_one_at_a_time_is_what_it_does(module: ModuleType) -> None:
    """Never two vehicles between the entries and the exits, though many wait."""
    run = minisim.simulate(
        small_scenario(4, density=350.0, demand_time=120.0), module.OneAtATime(), record="junction"
    )
    rows = run.trajectories
    intersection, length = run.site.intersection, run.site.vehicle.length
    exits = {path.movement: path.exit for path in intersection.paths}
    movements = (
        Movement(ARM_NAMES.index(lane), manoeuvre)
        for lane, manoeuvre in zip(rows["lane"], rows["manoeuvre"], strict=True)
    )
    past = rows["s_m"] - length - [exits[movement] for movement in movements]
    inside = (rows["s_m"] > intersection.approach_length + 1e-6) & (past < -1e-6)
    counts = rows[inside].groupby("time_s")["vehicle"].nunique()
    assert len(counts) > 100
    assert counts.max() == 1


def test_its_metric_is_measured() -> None:
    made: dict[str, Any] = {}
    exec(example("Add a metric"), made)
    run = minisim.simulate(four_way(300, horizon=120.0), Dim(), 1)
    complete = run.summary(metrics=[made["delay"]])["complete"]
    expected = float((run.columns.time_loss + run.columns.depart_delay).mean())
    assert complete["delay_s"] == pytest.approx(expected)
