"""The distribution: what its wheel holds, what the index will show, and whether it runs alone."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tomllib
from email import message_from_bytes
from email.message import Message
from pathlib import Path
from zipfile import ZipFile

import pytest

from minisim.errors import DISTRIBUTION, extra
from minisim.version import __version__
from tests import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ROOMS = ("minisim", "dim", "baselines", "scenarios", "figures")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("hatchling", reason="needs hatchling: pip install -e '.[dev]'")
    folder = tmp_path_factory.mktemp("wheel")
    build = "import sys; from hatchling.build import build_wheel; build_wheel(sys.argv[1])"
    subprocess.run([sys.executable, "-c", build, folder], cwd=ROOT, check=True, capture_output=True)
    (made,) = folder.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    name = f"{DISTRIBUTION.replace('-', '_')}-{__version__}.dist-info/METADATA"
    with ZipFile(wheel) as files:
        return message_from_bytes(files.read(name))


def test_the_wheel_holds_every_file_of_the_rooms(wheel: Path) -> None:
    """Modules, data, players; no tests and nothing that git does not know."""
    said = subprocess.run(["git", "ls-files", *ROOMS], cwd=ROOT, check=True, capture_output=True)
    known = {line for line in said.stdout.decode().splitlines() if (ROOT / line).exists()}
    with ZipFile(wheel) as files:
        packed = {name for name in files.namelist() if ".dist-info/" not in name}
    assert packed >= known
    assert {name.split("/")[0] for name in packed} == set(ROOMS)
    assert not [name for name in packed if name.endswith((".pyc", ".nbi", ".nbc"))]


def test_the_metadata_is_whole(metadata: Message) -> None:
    assert metadata["Name"] == DISTRIBUTION == PROJECT["name"]
    assert metadata["Version"] == __version__
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Description-Content-Type"] == "text/markdown"
    trove = pytest.importorskip("trove_classifiers")  # comes with hatchling
    assert set(metadata.get_all("Classifier", [])) <= trove.classifiers


def test_the_description_renders(metadata: Message) -> None:
    """As the package index shows it, which is with the renderer of GitHub's Markdown."""
    markdown = pytest.importorskip("readme_renderer.markdown", reason="needs readme-renderer")
    html = markdown.render(metadata.get_payload())
    assert html is not None
    assert ">minisim<" in html


def test_every_extra_that_a_message_or_a_page_names_exists() -> None:
    """Messages take the command from `minisim.errors.extra`; pages spell it out."""
    extras = set(PROJECT["optional-dependencies"])
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    for path in [*pages, *(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))]:
        text = path.read_text(encoding="utf-8").replace("\\", "")
        for name, wanted in re.findall(r"pip install '([\w-]+)\[([\w,]+)\]'", text):
            assert name == DISTRIBUTION, path
            assert set(wanted.split(",")) <= extras, path
        assert set(re.findall(r"\bextra\('(\w+)'\)", text)) <= extras, path
    assert extra("sumo") == "pip install 'minisim-traffic[sumo]'"
    own = [need for needs in PROJECT["optional-dependencies"].values() for need in needs]
    assert [need for need in own if need.startswith("minisim[")] == []


def test_the_citation_has_what_its_schema_requires() -> None:
    """CITATION.cff 1.2.0 requires four keys; the version is the one that is here."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    keys = re.findall(r"^([a-z-]+):", text, re.MULTILINE)
    assert {"cff-version", "message", "title", "authors"} <= set(keys)
    assert len(keys) == len(set(keys))
    assert f"\nversion: {__version__}\n" in text


@pytest.mark.slow
def test_the_wheel_runs_in_a_fresh_environment(wheel: Path, tmp_path: Path) -> None:
    """Without this folder: the packages that minisim needs are lent, minisim itself is not."""
    place = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", place], check=True)
    bin_ = place / ("Scripts" if os.name == "nt" else "bin")
    python = next(path for path in bin_.iterdir() if path.stem == "python")
    install = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "install",
        "--no-deps",
        "--no-index",
    ]
    subprocess.run([*install, wheel], check=True, capture_output=True)
    paths = {"base": str(place), "platbase": str(place)}
    site = Path(sysconfig.get_path("purelib", vars=paths))
    (site / "lent.pth").write_text(sysconfig.get_path("purelib"))

    def said(*words: str | Path) -> str:
        env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"MINISIM_JIT": "0"}
        done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert str(place) in said(python, "-c", "import minisim; print(minisim.__file__)")
    command = bin_ / "minisim"
    assert "waiting" in said(command, "run", "four-way", "--horizon", "60")
    said(command, "harmony", "four-way")  # reads dim/data
    said(command, "animate", "four-way", "--seconds", "5", "-o", "film.html")  # a player
    assert (tmp_path / "film.html").stat().st_size > 10_000
