"""Every lesson is whole, and its code runs: its assertions are what its text says."""

from __future__ import annotations

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
    r"^```\{code-cell\} ipython3\n(?::tags:[^\n]*\n)?(.*?)^```", re.DOTALL | re.MULTILINE
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
@pytest.mark.slow
def test_the_code_of_a_lesson_runs(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib import pyplot as plt

    mpl.use("Agg")
    lesson = ModuleType("lesson")  # its classes can be pickled, as those of a notebook can
    monkeypatch.setitem(sys.modules, "lesson", lesson)
    cells = CELL.findall(path.read_text(encoding="utf-8"))
    code = "\n".join(cells)
    assert len(cells) > 5
    assert "assert " in code
    try:
        exec(compile(code, str(path), "exec"), lesson.__dict__)
    finally:
        plt.close("all")
