"""The lab in a notebook: its widget answers as the server does."""

from __future__ import annotations

import json
from typing import Any

import pytest

from minisim.errors import InputError

pytest.importorskip("anywidget", reason="needs anywidget: the extra notebook")

from figures.notebook import Lab


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What a widget sends to its page."""
    sent: list[Any] = []
    monkeypatch.setattr(Lab, "send", lambda _, content, buffers: sent.append((content, *buffers)))
    return sent


def test_it_answers_its_page_and_keeps_the_setting(told: list[Any]) -> None:
    lab = Lab("density=300&seconds=60")
    assert 'alone ? location.hash.slice(1) : "density=300&seconds=60"' in lab.page
    lab.answer(lab, {"id": 0.5, "what": "scene", "query": "density=200&seconds=60&run=0"}, [])
    ((head, data),) = told
    assert head == {"id": 0.5, "status": 200}
    assert json.loads(data)["scene"]["demand"] == "200 veh/h/lane"
    assert lab.setting == "density=200&seconds=60"


def test_a_wrong_value_is_told_in_a_sentence(told: list[Any]) -> None:
    with pytest.raises(InputError, match="density"):
        Lab("density=-1")
    lab = Lab()
    lab.answer(lab, {"id": 1, "what": "scene", "query": "gate=open"}, [])
    ((head, data),) = told
    assert head["status"] == 400
    assert "gate" in json.loads(data)["error"]
    assert lab.setting == ""
