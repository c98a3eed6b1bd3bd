"""The examples in CONTRIBUTING.md are complete: each is run as the guide shows it."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shutil
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
from minisim.testing import check_controller, small_scenario
from scenarios import four_way
from scenarios.cli import main
from scenarios.recipe import Recipe
from scenarios.sweep.keys import description_of, key_of
from tests import ROOT
from tests.builders import python

GUIDE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def example(chapter: str = "Add a controller", kind: str = "python") -> str:
    """The first block of a kind in a chapter."""
    text = GUIDE.split(f"\n## {chapter}\n")[1].split("\n## ")[0]
    return text.split(f"```{kind}\n")[1].split("```")[0]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the source with everything added that the guide adds in `+++` blocks and files."""
    tree = tmp_path_factory.mktemp("tree")
    for room in ("minisim", "dim", "baselines", "scenarios", "figures"):
        shutil.copytree(ROOT / room, tree / room, ignore=shutil.ignore_patterns("__pycache__"))
    for edit in re.findall(r"^\+\+\+ .*?(?=^\+\+\+|^```)", GUIDE, re.MULTILINE | re.DOTALL):
        head, *lines = edit.rstrip("\n").split("\n")
        path = tree / head.removeprefix("+++ ")
        old, new = ("\n".join(line[1:] for line in lines if line[:1] != mark) for mark in "+-")
        text = path.read_text(encoding="utf-8")
        assert text.count(f"{old}\n") == 1, edit
        path.write_text(text.replace(f"{old}\n", f"{new}\n"), encoding="utf-8")
    (tree / "baselines" / "one_at_a_time.py").write_text(example(), encoding="utf-8")
    (tree / "scenarios" / "cli" / "arms.py").write_text(example("Add a subcommand"), "utf-8")
    return tree


def output(tree: Path, *arguments: str) -> str:
    places = f"{tree}{os.pathsep}{ROOT}"
    done = python(*arguments, cwd=tree, MINISIM_JIT="0", PYTHONPATH=places)
    assert not done.returncode, done.stderr
    return done.stdout


LAW = """
import minisim
from baselines import FixedTime
from minisim.vehicle import VehicleType
from scenarios import four_way
from scenarios.profiles import Profile

assert minisim.__file__.startswith({tree!r})
for model in ("iidm", "idm-plus"):
    profile = Profile(name="mine", vehicle=VehicleType(model=model), speed_limit=14.0)
    run = minisim.simulate(four_way(300, profile=profile, horizon=120.0), FixedTime(), 1)
    print(run.summary()["travel_time_s"])
"""


def test_its_law_drives_and_is_no_other(tree: Path) -> None:
    other, ours = map(float, output(tree, "-c", LAW.format(tree=str(tree))).split())
    assert other != ours
    assert 60.0 < ours < 120.0


def test_its_controller_is_compared_by_name(tree: Path) -> None:
    run = "-m minisim run three-way -c one-at-a-time:sight=60 -d 100 --horizon 60 --json"
    assert json.loads(output(tree, *run.split()))["controller"] == "one-at-a-time:sight=60"
    rivals = output(tree, "-c", "from scenarios.controllers import RIVALS; print(RIVALS)")
    assert "one-at-a-time" in rivals


def test_its_subcommand_answers(tree: Path) -> None:
    printed = output(tree, "-m", "minisim", "arms", "four-way").splitlines()
    assert printed == ["a 0°", "b 90°", "c 180°", "d 270°"]


def test_its_figure_is_in_the_gallery(tree: Path) -> None:
    code = """
from figures.gallery import item_named
from scenarios.studies.shared.archive import Archive
from scenarios.studies.shared.effort import Effort
from tests.builders import synthetic_find

figure = item_named("gate-losses").build(Archive(synthetic_find, Effort(seeds=2)))
print(len(figure.axes[0].get_legend_handles_labels()[0]))
"""
    assert output(tree, "-c", code) == "3\n"


def test_every_file_that_the_guide_names_exists() -> None:
    rooms = GUIDE.split("- `minisim/`")[1].split("`minisim` imports no")[0]
    room, known = Path("minisim"), 0
    for name in re.findall(r"`([a-z_/]+(?:\.py|/))`", rooms):
        inside = room / name
        known += 1
        if name.endswith("/") and not (ROOT / inside).is_dir():
            room = inside = Path(name)
        assert (ROOT / inside).exists(), inside
    assert known >= 90
    rooms = "minisim|dim|baselines|scenarios|figures|tests"
    for path in re.findall(rf"`((?:{rooms})/[a-z_/]+\.py)`", GUIDE):
        made = path in ("baselines/one_at_a_time.py", "scenarios/cli/arms.py")
        assert (ROOT / path).is_file() is not made, path
    assert len(GUIDE.splitlines()) < 360


def loaded(text: str, folder: Path) -> ModuleType:
    """A text as a module that pickle can find."""
    path = folder / "one_at_a_time.py"
    path.write_text(text, encoding="utf-8")
    spec: Any = importlib.util.spec_from_file_location("one_at_a_time", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def module(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ModuleType]:
    module = loaded(example(), tmp_path_factory.mktemp("guide"))
    yield module
    del sys.modules[module.__name__]


def test_it_keeps_the_contract_in_fifty_lines(module: ModuleType) -> None:
    assert len(example().splitlines()) <= 50
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
    exits = {(str(p.movement)[0], p.movement.manoeuvre): p.exit for p in intersection.paths}
    ways = zip(rows["lane"], rows["manoeuvre"], strict=True)
    past = rows["s_m"] - length - [exits[way] for way in ways]
    inside = (rows["s_m"] > intersection.approach_length + 1e-6) & (past < -1e-6)
    counts = rows[inside].groupby("time_s")["vehicle"].nunique()
    assert len(counts) > 100
    assert counts.max() == 1


def test_its_metric_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made: dict[str, Any] = {}
    exec(example("Add a metric"), made)
    run = minisim.simulate(four_way(300, horizon=120.0), Dim(), 1)
    complete = run.summary(metrics=[made["delay"]])["complete"]
    expected = float((run.columns.time_loss + run.columns.depart_delay).mean())
    assert complete["delay_s"] == pytest.approx(expected)
    (tmp_path / "guide_metric.py").write_text(example("Add a metric"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    run_it = "run four-way -d 300 --horizon 120 -s 1 --json --metrics guide_metric:delay"
    assert main(run_it.split()) == 0
    assert json.loads(capsys.readouterr().out)["complete"]["delay_s"] == complete["delay_s"]
    del sys.modules["guide_metric"]
