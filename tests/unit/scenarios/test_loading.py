"""Controllers of the caller's own, from files."""

from __future__ import annotations

import copy
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from minisim.errors import InputError
from minisim.testing import check_controller
from scenarios import four_way
from scenarios.controllers import controller_named
from scenarios.recipe import Recipe
from scenarios.sweep.keys import key_of
from tests.builders import python

MINE = '''
from dataclasses import dataclass
from own_helper import Greens
from baselines import FixedTime


@dataclass(frozen=True)
class Mine:
    """A signal of my own."""

    k: float = 10.0
    label: str = "x"
    parts: int | None = None
    greens: Greens = Greens()

    @property
    def name(self):
        return f"mine-{self.k:g}"

    def start(self, site):
        return FixedTime(greens=self.k).start(site)


class Plain:
    name = "plain"

    def __init__(self, k: int = 1):
        self.k = k

    def start(self, site):
        return FixedTime().start(site)


class Failing(Plain):
    def __init__(self):
        raise RuntimeError("no luck")


class Nothing:
    pass
'''
HELPER = """
from dataclasses import dataclass


@dataclass(frozen=True)
class Greens:
    factor: float = 1.0
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "own_mine.py").write_text(MINE, encoding="utf-8")
    (tmp_path / "own_helper.py").write_text(HELPER, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("own_")]:
        del sys.modules[name]


@pytest.mark.usefixtures("folder")
def test_a_class_of_the_working_directory() -> None:
    before = list(sys.path)
    mine = controller_named("own_mine:Mine(k=3)")
    assert (mine.name, mine) == ("mine-3", controller_named("own_mine.py:Mine(3)"))
    assert controller_named("own_mine:Mine").name == "mine-10"
    assert controller_named({"name": "own_mine:Mine", "k": 4}).name == "mine-4"
    assert controller_named("own_mine:Plain(k=2)").name == "plain"
    assert sys.path == before
    check_controller(mine, arms=(4,), horizon=60.0)
    assert copy.deepcopy(mine) == mine


def test_a_file_by_its_path_and_a_package(folder: Path) -> None:
    (folder / "deep").mkdir()
    (folder / "deep" / "own_deep.py").write_text(MINE.replace("own_helper", "own_beside"))
    (folder / "deep" / "own_beside.py").write_text(HELPER, encoding="utf-8")
    assert controller_named("deep/own_deep.py:Mine(k=3)").name == "mine-3"
    assert controller_named(f"{folder}/deep/own_deep.py:Mine").name == "mine-10"
    (folder / "own_package").mkdir()
    (folder / "own_package" / "__init__.py").write_text("")
    (folder / "own_package" / "rules.py").write_text(MINE)
    mine = controller_named("own_package.rules:Mine(k=5)")
    assert pickle.loads(pickle.dumps(mine)) == mine


def test_a_changed_file_is_imported_again(folder: Path) -> None:
    """Within one second, of one length: as quickly as an editor and a notebook go."""
    before = key_of(Recipe(four_way(), controller_named("own_mine:Mine"), 1))
    (folder / "own_mine.py").write_text(MINE.replace("10.0", "12.0"), encoding="utf-8")
    after = controller_named("own_mine:Mine")
    assert after.name == "mine-12"
    assert key_of(Recipe(four_way(), after, 1)) != before


@pytest.mark.usefixtures("folder")
def test_other_processes_find_it() -> None:
    recipe = Recipe(four_way(), controller_named("own_mine:Mine(k=3)"))
    data = pickle.dumps([recipe, {"a": recipe.controller}])
    code = f"import pickle; a, b = pickle.loads({data!r}); print(a.name, b['a'] == a.controller)"
    assert python("-c", code, cwd=Path("/")).stdout == "mine-3 True\n"


@pytest.mark.usefixtures("folder")
def test_a_sweep_says_what_a_plain_class_lacks() -> None:
    recipe = Recipe(four_way(), "own_mine:Plain(k=3)")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"Plain is not a dataclass.*it a frozen dataclass") as it:
        key_of(recipe)
    assert "0x" not in str(it.value)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("own_mine:Mien", "unknown controller of own_mine 'Mien'; allowed: Mine, Plain, Failing;"),
        ("own_mine:Mine(kk=3)", "unknown own_mine:Mine parameter 'kk'.*; did you mean 'k'"),
        ("own_mine:Mine(k='a')", "k of own_mine:Mine must be a number, got 'a'"),
        ("own_mine:Mine(k=true)", "k of own_mine:Mine must be a number, got True"),
        ("own_mine:Mine(parts=1.5)", "parts of .* must be a whole number or none, got 1.5"),
        ("own_mine:Plain(k=1.5)", "k of own_mine:Plain must be a whole number, got 1.5"),
        ("own_mine:Mine(1,'a',3,4,5)", "own_mine:Mine: too many positional arguments"),
        ("own_mine:Failing", "own_mine:Failing cannot be made: RuntimeError: no luck"),
        ("own_mine:Nothing", "own_mine:Nothing is not a controller: it has no name and no start"),
        ("own_mine", "cannot read controller 'own_mine'.*'own_mine:Mine' or 'own_mine:Plain' or"),
        ("own_mine:", "cannot read controller 'own_mine:'.*; did you mean 'own_mine:Mine' or"),
        ("own_mine.py", "did you mean 'own_mine.py:Mine' or"),
        ("own_mine:Mine(greens=x(3))", "greens of own_mine:Mine has no recipe x"),
        ("own_none:Mine", "no module 'own_none': there is no own_none.py in the working directory"),
        ("nowhere/own.py:Mine", "cannot read nowhere/own.py: no such file"),
        ("own_syntax:Mine", "cannot import own_syntax: own_syntax.py, line 2: SyntaxError: "),
        ("own_raises:Mine", "cannot import own_raises: own_raises.py, line 2: ValueError: no"),
        ("own_exits:Mine", "cannot import own_exits: own_exits.py, line 1: SystemExit: 3"),
        ("own_lacks:Mine", "own_lacks.py, line 1: ModuleNotFoundError: No module named 'own_gone'"),
        ("own_empty:Mine", "own_empty has no 'Mine', and no other controller either"),
        ("json.py:Mine", "json.py has the name of another module, json; rename it"),
        ("time:Mine", "time.py has the name of another module, time; rename it"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_sentence(folder: Path, spec: str, message: str) -> None:
    files = {
        "own_syntax": "a = 1\nclass :\n",
        "own_raises": "def f():\n    raise ValueError('no')\nf()\n",
        "own_exits": "raise SystemExit(3)\n",
        "own_lacks": "import own_gone\n",
        "own_empty": "",
        "json": MINE,
        "time": MINE,
    }
    for name, text in files.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    import json  # the standard one, which the file must not replace

    with pytest.raises(InputError, match=message) as error:
        controller_named(spec)
    assert "\n" not in str(error.value)
    assert sys.modules["json"] is json
