"""Every lesson is whole, and its code runs: its assertions are what its text says."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import pytest

from tests import ROOT

LESSONS = sorted(
    path for path in (ROOT / "docs/lessons").glob("*.md") if path.name != "index.md"
)  # fmt: skip
CELL = re.compile(
    r"^```\{code-cell\} ipython3\n(?::tags: ([^\n]*)\n)?(.*?)^```", re.DOTALL | re.MULTILINE
)
names = pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)


@names
def test_a_lesson_asks_predicts_runs_explains_and_has_exercises_with_solutions(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    parts = ("## The question", "## Predict", "## Run", "## Why", "## Exercises")
    assert [part for part in parts if f"\n{part}" not in text] == []
    exercises = re.findall(r"^(\d)\. ", text.split("## Exercises")[1], re.MULTILINE)
    solutions = re.findall(r"<summary>Worked solution of (\d)</summary>", text)
    assert solutions == exercises
    assert len(exercises) >= 3
    assert text.count("<details>") == text.count("</details>") == len(solutions)
    assert "$$" in text, "it has a formula"
    assert f"\n{path.stem}\n" in (path.parent / "index.md").read_text(encoding="utf-8")


@names
def test_what_a_reader_sees_is_enough(path: Path) -> None:
    """Cells use no name that only a hidden cell, which the page does not show, makes."""
    cells = CELL.findall(path.read_text(encoding="utf-8"))
    made: dict[bool, set[str]] = {True: set(), False: set()}
    used: set[str] = set()
    for tags, code in cells:
        hidden = "remove-cell" in tags
        for node in ast.walk(ast.parse(code)):
            if isinstance(node, ast.alias):
                made[hidden].add(node.asname or node.name)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                made[hidden].add(node.id)
            elif isinstance(node, ast.Name) and not hidden:
                used.add(node.id)
    assert used & made[True] - made[False] == set()


@names
def test_the_code_of_a_lesson_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib import pyplot as plt

    mpl.use("Agg")
    lesson = ModuleType("lesson")  # its classes can be pickled, as those of a notebook can
    monkeypatch.setitem(sys.modules, "lesson", lesson)
    cells = [code for _, code in CELL.findall(path.read_text(encoding="utf-8"))]
    code = "\n".join(cells)
    assert len(cells) > 5
    assert "assert " in code
    try:
        exec(compile(code, str(path), "exec"), lesson.__dict__)
    finally:
        plt.close("all")
