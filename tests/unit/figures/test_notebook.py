"""Figures and players show themselves in a fresh notebook, without magic words; so does the lab."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from minisim.errors import InputError

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
    "figures.play(run, start=20, seconds=5)",
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
    for outputs in shown[1:-2]:
        (data,) = outputs
        assert len(data["image/png"]) > 5000
    assert "data:image/png" in shown[-2][0]["text/html"]
    assert shown[-1][0]["text/html"].startswith("<iframe")


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What widgets send to their pages."""
    pytest.importorskip("anywidget", reason="needs anywidget, which the extra `notebook` brings")
    from figures.notebook import Lab

    sent: list[Any] = []
    monkeypatch.setattr(Lab, "send", lambda _, content, buffers: sent.append((content, *buffers)))
    return sent


def test_the_lab_answers_its_page_and_keeps_the_setting(told: list[Any]) -> None:
    from figures.notebook import Lab

    lab = Lab("density=300&seconds=60")
    assert 'alone ? location.hash.slice(1) : "density=300&seconds=60"' in lab.page
    lab.answer(lab, {"id": 0.5, "what": "scene", "query": "density=200&seconds=60&run=0"}, [])
    ((head, data),) = told
    assert head == {"id": 0.5, "status": 200}
    assert json.loads(data)["scene"]["demand"] == "200 veh/h/lane"
    assert lab.setting == "density=200&seconds=60"


def test_a_wrong_value_is_told_in_a_sentence(told: list[Any]) -> None:
    from figures.notebook import Lab

    with pytest.raises(InputError, match="density"):
        Lab("density=-1")
    lab = Lab()
    lab.answer(lab, {"id": 1, "what": "scene", "query": "gate=open"}, [])
    ((head, data),) = told
    assert head["status"] == 400
    assert "gate" in json.loads(data)["error"]
    assert lab.setting == ""
