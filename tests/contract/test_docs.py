"""The pages tell the truth: examples run, commands are valid, figures and pages exist."""

from __future__ import annotations

import ast
import builtins
import re
import shlex
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest
import typer

import figures
from dim import Dim
from minisim.counts import read_counts
from minisim.simulation import simulate
from scenarios.cli import app
from scenarios.controllers import controller_named
from scenarios.library import scenario_named
from scenarios.profiles import profile_named
from tests import ROOT
from tests.builders import digest

FENCE = re.compile(r"^```(python|toml|sh|console)\n(.*?)^```", re.DOTALL | re.MULTILINE)
#: The first line of an example that is a file.
FILE = re.compile(r"# (\w+\.(?:py|toml))\n")
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    if "generated" not in path.parts
}
READ = [page for page in PAGES if page != "CONTRIBUTING.md"]  # whose examples are for users
HOWTO = sorted(page for page in PAGES if page.startswith("docs/howto/"))
#: Those whose examples have tests of their own below or need a long run before, and slow ones.
OWN = {f"docs/howto/{name}.md" for name in ("counts", "stepping", "benchmark")}
SLOW = {"docs/howto/messages.md", "docs/howto/property-tests.md", "docs/howto/sumo.md"}
#: What an example may import -> what that needs, which may not be installed.
NEEDS = {
    "minisim.sumo": "libsumo", "figures.notebook": "anywidget", "gymnasium": "gymnasium",
}  # fmt: skip
#: What a command may name without having it: a reader's own files.
OWN_FILE = re.compile(r"^(?!.*/).*(?:mine|\.(?:xml|toml|csv|osm))$")


def blocks(page: str, *kinds: str) -> list[str]:
    return [text for kind, text in FENCE.findall(PAGES[page]) if kind in kinds]


def commands(page: str) -> list[str]:
    """The lines of a page that call minisim or a file of the project, without their comments."""
    text = "\n".join(blocks(page, "sh", "console")).replace("\\\n", " ")
    return re.findall(r"^(?:\$ )?((?:minisim|python) .*?)(?: +#.*)?$", text, re.MULTILINE)


@pytest.mark.parametrize("page", [page for page in READ if blocks(page, "python")])
def test_a_page_imports_what_its_examples_use(page: str) -> None:
    """Read from the top: an example may use what one before it made."""
    nodes = list(ast.walk(ast.parse("\n".join(blocks(page, "python")))))
    made = {it.asname or it.name.partition(".")[0] for it in nodes if isinstance(it, ast.alias)}
    made |= {it.name for it in nodes if isinstance(it, ast.FunctionDef | ast.ClassDef)}
    made |= {it.arg for it in nodes if isinstance(it, ast.arg)}
    names = [it for it in nodes if isinstance(it, ast.Name)]
    made |= {it.id for it in names if isinstance(it.ctx, ast.Store)}
    used = {it.id for it in names if isinstance(it.ctx, ast.Load)}
    assert used - made - set(dir(builtins)) - {"__name__"} == set()


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[pytest.mark.slow] * (page in SLOW), id=Path(page).stem)
        for page in HOWTO if page not in OWN and blocks(page, "python")
    ],
)  # fmt: skip
def test_the_examples_of_a_how_to_run(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In their order, in an empty folder; one that begins with a file's name is that file."""
    from matplotlib import pyplot as plt

    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "out").mkdir()
    made: dict[str, Any] = {"__name__": "__main__"}
    try:
        for example in blocks(page, "python", "toml"):
            if named := FILE.match(example):
                (tmp_path / named[1]).write_text(example, encoding="utf-8")
                continue
            for needing, module in NEEDS.items():
                if needing in example:
                    pytest.importorskip(module, reason=f"needs {module}")
            if example in blocks(page, "python"):
                exec(compile(example, page, "exec"), made)
    finally:
        plt.close("all")
        sys.modules.pop("mine", None)


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)])
def test_the_commands_of_a_page_are_valid(page: str) -> None:
    """Parsed as the command line does, and everything that they name exists."""
    click: Any = typer.main.get_command(app)
    for command in commands(page):
        program, name, *arguments = shlex.split(command)
        if program == "python":
            assert name in ("-m", "-c") or (ROOT / name).is_file()
            assert "pytest" not in arguments or (ROOT / arguments[-1]).is_file()
            continue
        values = click.commands[name].make_context(name, arguments).params
        profile = profile_named(values.get("profile") or "fair")
        named = values.get("controller") or ()
        for controller in [named] if isinstance(named, str) else named:
            if not controller.startswith("mine:"):
                controller_named(controller, profile)
        for scenario in values.get("scenarios") or [values.get("scenario")]:
            if scenario not in (None, "custom") and not OWN_FILE.search(scenario):
                scenario_named(scenario)
        arrivals = str(values.get("arrivals") or "two.csv")
        assert OWN_FILE.search(arrivals) or (ROOT / arrivals).is_file()


def test_pages_that_are_named_exist() -> None:
    """In code, comments and pages alike: `docs/howto/counts.md` and the like."""
    texts = {path: path.read_text(encoding="utf-8")
             for room in ("minisim", "dim", "baselines", "scenarios", "figures", "tests")
             for path in (ROOT / room).rglob("*") if path.suffix in {".py", ".js"}}  # fmt: skip
    texts |= {ROOT / page: text for page, text in PAGES.items()}
    texts[ROOT / "CHANGELOG.md"] = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    named = [(path, page) for path, text in texts.items()
             for page in re.findall(r"\bdocs/[\w/-]+\.(?:md|png|gif)\b", text)]  # fmt: skip
    assert len(named) > 40
    assert [it for it in named if not (ROOT / it[1]).is_file()] == []


def test_the_gallery_has_every_figure() -> None:
    gallery = PAGES["docs/reference/gallery.md"]
    assert [name for name in figures.__all__ if f"`{name}" not in gallery] == []


def test_every_page_is_in_a_list() -> None:
    """Of its folder's index, or it could not be found."""
    lost = [
        page for page in PAGES
        if page.startswith("docs/") and not page.endswith("index.md")
        and f"\n{Path(page).stem}\n" not in PAGES[str(Path(page).parent / "index.md")]
    ]  # fmt: skip
    assert lost == []


def test_a_sheet_becomes_a_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example in docs/howto/counts.md, with a sheet of ten minutes."""
    rows = [
        f"{time},{arm},{turn},2" for time in ("7:00", "7:05") for arm in "NESW" for turn in "LTR"
    ]
    (tmp_path / "sheet.csv").write_text("\n".join(["start,approach,turn,car", *rows]))
    monkeypatch.chdir(tmp_path)
    (example,) = blocks("docs/howto/counts.md", "python")
    exec(compile(example, "docs/howto/counts.md", "exec"), {})
    assert (tmp_path / "day.png").stat().st_size > 10_000


def test_its_mapping_is_one(tmp_path: Path) -> None:
    """For a sheet with such columns, classes and turns."""
    (mapping,) = blocks("docs/howto/counts.md", "toml")
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
    """The examples in docs/howto/stepping.md: DIM from outside, and a tree search.

    `tests/sumo/test_stepping.py` runs the second.
    """
    outside, _, _, search = blocks("docs/howto/stepping.md", "python")
    made: dict[str, Any] = {}
    exec(compile(outside, "docs/howto/stepping.md", "exec"), made)
    assert digest(made["run"]) == digest(simulate(made["scenario"], Dim(), 1))
    exec(compile(search, "docs/howto/stepping.md", "exec"), {})
    assert int(capsys.readouterr().out) > 0


@pytest.mark.parametrize(("commanded", "waited"), [("sim.view().vehicles", 0.0), ("()", 8.4)])
def test_vehicles_glide_to_a_signal(
    commanded: str, waited: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """The example in docs/howto/stepping.md, and the same without its commands."""
    example = blocks("docs/howto/stepping.md", "python")[2].replace(
        "sim.view().vehicles", commanded
    )
    exec(compile(example, "docs/howto/stepping.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(waited)


@pytest.mark.slow
def test_what_is_learnt_runs() -> None:
    pytest.importorskip("cma", reason="needs the extra gym")
    cells = re.findall(
        r"^```\{code-cell\} ipython3\n(.*?)^```",
        (ROOT / "docs/howto/learning.md").read_text(),
        re.S | re.M,
    )
    assert len(cells) == 2
    exec(compile("\n".join(cells), "docs/howto/learning.md", "exec"), {})
