"""`minisim controllers`, and `-c` with a controller of your own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from minisim.parameters import parameters
from scenarios.controllers import CONTROLLERS
from tests.unit.scenarios.cli.test_cli import Captured, ok


def test_it_lists_all_of_them(capsys: Captured) -> None:
    text = ok(capsys, "controllers")
    assert max(map(len, text.splitlines())) <= 80
    assert [line.split()[0] for line in text.splitlines() if line[0] != " "] == list(CONTROLLERS)
    assert set(json.loads(ok(capsys, "controllers", "--json"))) == set(CONTROLLERS)


@pytest.mark.parametrize("name", CONTROLLERS)
def test_it_lists_the_parameters_of_each(capsys: Captured, name: str) -> None:
    text = ok(capsys, "controllers", name)
    assert max(map(len, text.splitlines())) <= 80
    declared = [it.name for it in parameters(CONTROLLERS[name].make)]
    found = json.loads(ok(capsys, "controllers", name, "--json"))["parameters"]
    assert [it["name"] for it in found] == declared
    assert all(f"\n  {it['name']}={it['default']}" in text for it in found)


def test_nested_recipes_are_listed_too(capsys: Captured) -> None:
    text = ok(capsys, "controllers", "dim")
    assert "perception=noisy(…): " in text
    given = ok(capsys, "controllers", "dim:gate=harmonious,monitor=on(patience=3)")
    assert "\n  gate=harmonious  (clear | harmonious)" in given
    assert "\n  patience=3 [s]" in given
    assert "\n  patience=2 [s]  (0.5 … 60)\n      how long " in text


def test_a_class_of_your_own(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    run = ("run", "four-way", "--horizon", "60", "--no-safety", "--json")
    assert json.loads(ok(capsys, *run, "-c", "own_signal:Slow(green=20)"))["controller"] == "slow"
