"""The site: it builds without a warning, has every public name, and makes no request."""

from __future__ import annotations

import importlib
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from minisim.results.metrics import METRICS
from scenarios.controllers import CONTROLLERS
from tests import ROOT

GENERATE = runpy.run_path(str(ROOT / "docs/generate.py"))

#: What a browser would fetch by itself; links that a reader may follow are no requests.
REQUEST = re.compile(r"""<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)=["'](?:https?:)?//""")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for package in ("sphinx", "myst_nb", "furo"):
        pytest.importorskip(package, reason="needs the extra docs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def test_every_package_that_exports_names_has_a_page() -> None:
    """Those of `__init__.py` files with an `__all__`, without the command line's."""
    inits = [path for room in ("minisim", "dim", "baselines", "scenarios", "figures")
             for path in (ROOT / room).rglob("__init__.py")]  # fmt: skip
    exporting = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in inits if "\n__all__" in path.read_text(encoding="utf-8")
    }  # fmt: skip
    assert set(GENERATE["PACKAGES"]) == exporting - {"scenarios.cli"}


def test_the_tables_have_every_controller_and_metric() -> None:
    pages = GENERATE["pages"]()
    assert [name for name in CONTROLLERS if f"| `{name}` |" not in pages["controllers"]] == []
    assert [name for name in METRICS if f"| `{name}` |" not in pages["metrics"]] == []


@pytest.mark.slow
def test_the_reference_has_every_public_name(site: Path) -> None:
    for package in GENERATE["PACKAGES"]:
        html = (site / f"generated/{package}.html").read_text(encoding="utf-8")
        names = importlib.import_module(package).__all__
        assert [name for name in names if f'id="{package}.{name}"' not in html] == []


@pytest.mark.slow
def test_no_page_asks_for_anything_from_outside(site: Path) -> None:
    pages = {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    assert len(pages) > 20
    assert [path.name for path, html in pages.items() if REQUEST.search(html)] == []


@pytest.mark.slow
def test_every_link_inside_the_site_leads_somewhere(site: Path) -> None:
    for path in site.rglob("*.html"):
        html = path.read_text(encoding="utf-8")
        for target, anchor in re.findall(r'<a\b[^>]*\bhref="([^":#?]*)(?:#([^"]*))?"', html):
            file = (path.parent / target) if target else path
            assert file.exists(), (path.name, target)
            if anchor and file.suffix == ".html":
                assert f'id="{anchor}"' in file.read_text(encoding="utf-8"), (path.name, anchor)
