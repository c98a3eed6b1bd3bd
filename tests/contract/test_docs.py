"""The examples of the pages can be pasted: they import what they use, and a count becomes a day."""

from __future__ import annotations

import ast
import builtins
import re
from pathlib import Path
from typing import Any

import pytest

from dim import Dim
from minisim.counts import read_counts
from minisim.simulation import simulate
from tests import ROOT
from tests.builders import digest

DOCS = "benchmark", "counts", "messages", "pcu", "safety", "scene", "stepping"
PAGES = ("README.md", *(f"docs/{name}.md" for name in DOCS))


def blocks(page: str, kind: str = "python") -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.findall(rf"^```{kind}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert found, page
    return found


@pytest.mark.parametrize("page", PAGES)
def test_a_page_imports_what_its_examples_use(page: str) -> None:
    """Read from the top: an example may use what one before it made."""
    nodes = list(ast.walk(ast.parse("\n".join(blocks(page)))))
    made = {it.asname or it.name for it in nodes if isinstance(it, ast.alias)}
    made |= {it.name for it in nodes if isinstance(it, ast.FunctionDef)}
    made |= {it.arg for it in nodes if isinstance(it, ast.arg)}
    names = [it for it in nodes if isinstance(it, ast.Name)]
    made |= {it.id for it in names if isinstance(it.ctx, ast.Store)}
    used = {it.id for it in names if isinstance(it.ctx, ast.Load)}
    assert used - made - set(dir(builtins)) == set()


def test_a_sheet_becomes_a_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example in docs/counts.md, with a sheet of ten minutes."""
    rows = [
        f"{time},{arm},{turn},2" for time in ("7:00", "7:05") for arm in "NESW" for turn in "LTR"
    ]
    (tmp_path / "sheet.csv").write_text("\n".join(["start,approach,turn,car", *rows]))
    monkeypatch.chdir(tmp_path)
    (example,) = blocks("docs/counts.md")
    exec(compile(example, "docs/counts.md", "exec"), {})
    assert (tmp_path / "day.png").stat().st_size > 10_000


def test_its_mapping_is_one(tmp_path: Path) -> None:
    """For a sheet with such columns, classes and turns."""
    (mapping,) = blocks("docs/counts.md", kind="toml")
    rows = [
        f"{time},{arm},{turn},9,1"
        for time in ("06:15", "06:30", "06:45") for arm in "ABCD" for turn in ("L", "GA", "R")
    ]  # fmt: skip
    (tmp_path / "sheet.csv").write_text("\n".join(["begins,approach,turn,Kfz,SV", *rows]))
    (tmp_path / "map.toml").write_text(mapping)
    count = read_counts(tmp_path / "sheet.csv", tmp_path / "map.toml")
    assert count.arms == ("B", "C", "D", "A")
    assert count.left_out == {"outside from … until": 120}
    assert count.vehicles.sum() == 2 * 12 * 10


def test_a_search_looks_ahead(capsys: pytest.CaptureFixture[str]) -> None:
    """The examples in docs/stepping.md: DIM from outside, and a tree search."""
    outside, _, search = blocks("docs/stepping.md")  # the other one: `tests/sumo/test_stepping.py`
    made: dict[str, Any] = {}
    exec(compile(outside, "docs/stepping.md", "exec"), made)
    assert digest(made["run"]) == digest(simulate(made["scenario"], Dim(), 1))
    exec(compile(search, "docs/stepping.md", "exec"), {})
    assert int(capsys.readouterr().out) > 0


def test_an_environment_is_used(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("gymnasium", reason="needs the extra gym")
    (example,) = blocks("docs/environments.md")
    exec(compile(example, "docs/environments.md", "exec"), {})
    assert int(capsys.readouterr().out) > 30
