"""The page of the player: one file, whole, and closed to the network."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

import minisim
from baselines import FixedTime
from dim import Dim
from figures import scene, style, write_page, write_player
from figures.player.page import page, script
from minisim.errors import InputError
from scenarios import four_way


@pytest.fixture(scope="module")
def pair() -> list[dict[str, Any]]:
    what = four_way(300, horizon=40.0)
    return [
        scene(minisim.simulate(what, it), start=30.0, seconds=5.0) for it in (Dim(), FixedTime())
    ]


def test_the_page_holds_the_scenes_and_nothing_from_elsewhere(pair: list[dict[str, Any]]) -> None:
    text = page(*pair)
    assert "{{" not in text
    (held,) = re.findall(r'<script type="application/json">(.*?)</script>', text)
    assert json.loads(held) == pair
    addresses = set(re.findall(r"""(?:https?:)?//[\w.]+\.\w+[^\s"']*""", text))
    assert addresses == {"http://www.w3.org/2000/svg"}, "a name, not an address to ask"
    assert "default-src 'none'" in text


def test_names_cannot_break_out_of_the_page(pair: list[dict[str, Any]]) -> None:
    name = '</script><script>alert("x")</script>'
    text = page(pair[0] | {"title": name, "controller": name})
    assert text.count("<script") == 2
    (held,) = re.findall(r'<script type="application/json">(.*?)</script>', text)
    assert json.loads(held)[0]["title"] == name


def test_two_runs_need_the_same_arrivals(pair: list[dict[str, Any]], tmp_path: Path) -> None:
    for change in ({"seed": 1}, {"demand": "x"}, {"title": "five-way"}):
        with pytest.raises(InputError, match="the same arrivals"):
            write_page(tmp_path / "two.html", pair[0], pair[1] | change)
    other = json.loads(json.dumps(pair[1]))
    known = {track["id"] for track in pair[0]["tracks"]}
    track = next(it for it in other["tracks"] if it["id"] in known)
    track["way"] = (track["way"] + 1) % len(other["ways"])
    with pytest.raises(InputError, match=f"vehicle {track['id']} takes"):
        write_page(tmp_path / "two.html", pair[0], other)
    assert not list(tmp_path.iterdir())


def test_a_player_of_two_runs(pair: list[dict[str, Any]], tmp_path: Path) -> None:
    what, file = four_way(300, horizon=40.0), tmp_path / "two.html"
    runs = [minisim.simulate(what, it) for it in (Dim(), FixedTime())]
    write_player(file, *runs, start=30.0, seconds=5.0)
    assert file.read_text(encoding="utf-8") == page(*pair)


def test_the_player_has_the_look_of_the_figures() -> None:
    text = script()
    for name, colour in (("goes", style.RIGHT_OF_WAY), ("zone-red", style.ZONES["red"]),
                         ("head-amber", style.HEADS["amber"].colour)):  # fmt: skip
        assert f"--{name}: {colour};" in text
    used = set(re.findall(r"var\(--([\w-]+)\)", text)) | set(
        re.findall(r'look\("([\w-]+)"\)', text)
    )
    assert used - {"side", "full", "graph", "colour"} <= set(re.findall(r"--([\w-]+): #", text))
