"""Figures show themselves in a fresh notebook, without magic words."""

from __future__ import annotations

from pathlib import Path

import pytest

CELLS = (
    "import minisim\nfrom dim import Dim, HarmonyMatrix, explain\nfrom scenarios import four_way\n"
    "import figures\n"
    "scenario = four_way(300, horizon=40)\n"
    "run = minisim.simulate(scenario, Dim(), seed=1, record='all')",
    "figures.time_space(run, 'a')",
    "figures.queues(run)",
    "figures.cumulative(run)",
    "site = scenario.site(0)\n"
    "matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)\n"
    "figures.decision(explain(['a1', 'b2'], matrix), site, Dim().start(site).plan)",
    "figures.animation(run, start=20, seconds=0.3)",
)


@pytest.mark.slow
def test_every_figure_shows_itself(tmp_path: Path) -> None:
    reason = "needs nbclient and ipykernel, which the extra `docs` brings"
    nbformat = pytest.importorskip("nbformat", reason=reason)
    nbclient = pytest.importorskip("nbclient", reason=reason)
    pytest.importorskip("ipykernel", reason=reason)
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code) for code in CELLS])
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(book, timeout=120, resources=resources).execute()
    shown = [[it["data"] for it in cell.outputs if "data" in it] for cell in book.cells]
    assert shown[0] == []
    for outputs in shown[1:-1]:
        (data,) = outputs
        assert len(data["image/png"]) > 5000
    assert "data:image/png" in shown[-1][0]["text/html"]
