"""`minisim controllers`, and `-c` with a controller of your own."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from minisim.parameters import parameters
from scenarios import controllers as table
from scenarios.controllers import CONTROLLERS
from tests.unit.scenarios.cli.test_cli import Captured, answer, fails, ok


def test_it_lists_all_of_them(capsys: Captured) -> None:
    text = ok(capsys, "controllers")
    assert max(map(len, text.splitlines())) <= 80
    assert [line.split()[0] for line in text.splitlines() if line[0] != " "] == list(CONTROLLERS)
    assert set(answer(capsys, "controllers")) == set(CONTROLLERS)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_it_lists_the_parameters_of_each(capsys: Captured, name: str) -> None:
    text = ok(capsys, "controllers", name)
    assert max(map(len, text.splitlines())) <= 80
    declared = [it.name for it in parameters(CONTROLLERS[name].make)]
    found = answer(capsys, "controllers", name)["parameters"]
    assert [it["name"] for it in found] == declared
    assert all(f"\n  {it['name']}={it['default']}" in text for it in found)


def test_nested_recipes_are_listed_too(capsys: Captured) -> None:
    text = ok(capsys, "controllers", "dim")
    assert "perception=noisy(…): " in text
    given = ok(capsys, "controllers", "dim:gate=harmonious,monitor=on(patience=3)")
    assert "\n  gate=harmonious  (clear | harmonious | passed)" in given
    assert "\n  patience=3 [s]" in given
    assert "\n  patience=2 [s]  (0.5 … 60)\n      how long " in text


def test_your_own_class(capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own_signal.py").write_text(
        "from baselines import FixedTime\n\n"
        "class Slow:\n"
        '    """A slow signal."""\n'
        '    name = "slow"\n'
        "    def __init__(self, green: float = 30.0) -> None:\n"
        "        self.green = green\n"
        "    def start(self, site):\n"
        "        return FixedTime(self.green).start(site)\n",
        encoding="utf-8",
    )
    text = ok(capsys, "controllers", "own_signal:Slow")
    assert text == "own_signal:Slow: A slow signal.\n\n  green=30  (float)\n"
    given = ok(capsys, "controllers", "own_signal:Slow(green=20)")
    assert given.endswith("\n\n  green=20  (float)\n")
    run = ("run", "four-way", "--horizon", "60", "--no-safety", "-c", "own_signal:Slow(green=20)")
    assert answer(capsys, *run)["controller"] == "slow"


@pytest.mark.parametrize("name", ["dim:bogus=1", "os:PathLike", "dim:", "baselines:FixedTime(x=1)"])
def test_what_is_not_a_controller_has_no_page(capsys: Captured, name: str) -> None:
    fails(capsys, "controllers", name)


def test_registered_names_are_listed(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    values = {"extra": "baselines:FixedTime", "broken": "no_such:Thing", "dim": "dim:Dim"}
    points = [EntryPoint(name, value, "minisim.controllers") for name, value in values.items()]
    monkeypatch.setattr(table, "entry_points", lambda group: points)
    table.plugins.cache_clear()
    listed = answer(capsys, "controllers")
    table.plugins.cache_clear()
    assert listed["extra"].startswith("A signal that gives each approach its green")
    assert "cannot be loaded: ModuleNotFoundError" in listed["broken"]
    assert listed["dim of dim"] == "not used: minisim has a controller of that name"
