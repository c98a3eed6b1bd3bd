"""The controller in CONTRIBUTING.md is complete and keeps the contract."""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import minisim
from minisim.control import Controller
from minisim.errors import InputError
from minisim.geometry import ARM_NAMES, Movement
from minisim.testing import check_controller, small_scenario

GUIDE = Path(__file__).parents[2] / "CONTRIBUTING.md"


def example() -> str:
    (block,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    return str(block)


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    """The example as a module that pickle can find."""
    path = tmp_path_factory.mktemp("guide") / "one_at_a_time.py"
    path.write_text(example(), encoding="utf-8")
    spec = importlib.util.spec_from_file_location("one_at_a_time", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


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
