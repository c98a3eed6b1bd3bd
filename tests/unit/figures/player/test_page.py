"""The page of the player: one file, whole, and closed to the network."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import minisim
from baselines import FixedTime
from dim import Dim
from figures import Player, play, scene, style
from figures.player.page import script
from minisim.errors import InputError
from scenarios import four_way


@pytest.fixture(scope="module")
def pair() -> list[dict[str, Any]]:
    what = four_way(300, horizon=40.0)
    return [
        scene(minisim.simulate(what, it), start=30.0, seconds=5.0) for it in (Dim(), FixedTime())
    ]


def test_the_page_holds_the_scenes_and_nothing_from_elsewhere(pair: list[dict[str, Any]]) -> None:
    text = Player(*pair).page()
    assert "{{" not in text
    (held,) = re.findall(r'<script type="application/json">(.*?)</script>', text)
    assert json.loads(held) == pair
    addresses = set(re.findall(r"""(?:https?:)?//[\w.]+\.\w+[^\s"']*""", text))
    assert addresses == {"http://www.w3.org/2000/svg"}, "a name, not an address to ask"
    assert "default-src 'none'" in text


def test_names_cannot_break_out_of_the_page(pair: list[dict[str, Any]]) -> None:
    name = '</script><script>alert("x")</script>'
    text = Player(pair[0] | {"title": name, "controller": name}).page()
    assert text.count("<script") == 2
    (held,) = re.findall(r'<script type="application/json">(.*?)</script>', text)
    assert json.loads(held)[0]["title"] == name


def test_two_runs_need_the_same_arrivals(pair: list[dict[str, Any]]) -> None:
    for change in ({"seed": 1}, {"demand": "x"}, {"title": "five-way"}):
        with pytest.raises(InputError, match="the same arrivals"):
            Player(pair[0], pair[1] | change)
    other = json.loads(json.dumps(pair[1]))
    known = {track["id"] for track in pair[0]["tracks"]}
    track = next(it for it in other["tracks"] if it["id"] in known)
    track["way"] = (track["way"] + 1) % len(other["ways"])
    with pytest.raises(InputError, match=f"vehicle {track['id']} takes"):
        Player(pair[0], other)


def test_a_player_of_two_runs(pair: list[dict[str, Any]], tmp_path: Path) -> None:
    what, file = four_way(300, horizon=40.0), tmp_path / "two.html"
    runs = [minisim.simulate(what, it) for it in (Dim(), FixedTime())]
    play(*runs, start=30.0, seconds=5.0).save(file)
    assert file.read_text(encoding="utf-8") == Player(*pair).page()


class Frames(HTMLParser):
    """What the frames of a page hold."""

    def __init__(self) -> None:
        super().__init__()
        self.held: list[dict[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag == "iframe"
        self.held.append(dict(attrs))


def test_in_a_notebook_it_is_a_frame_of_its_own(pair: list[dict[str, Any]]) -> None:
    quoted = pair[0] | {"title": """<b>'a' & "b"</b>"""}
    frames = Frames()
    frames.feed(Player(quoted)._repr_html_())
    (frame,) = frames.held
    assert frame["srcdoc"] == Player(quoted).page("")
    assert frame["sandbox"] == "allow-scripts"
    assert "<minisim-player fill >" in Player(quoted).page(""), "several would start at once"


def test_the_player_has_the_look_of_the_figures() -> None:
    text = script()
    for name, colour in (("goes", style.RIGHT_OF_WAY), ("zone-red", style.ZONES["red"]),
                         ("head-amber", style.HEADS["amber"].colour)):  # fmt: skip
        assert f"--{name}: {colour};" in text
    used = set(re.findall(r"var\(--([\w-]+)\)", text)) | set(
        re.findall(r'look\("([\w-]+)"\)', text)
    )
    assert used - {"side", "full", "graph", "colour", "large", "small"} <= set(
        re.findall(r"--([\w-]+): #", text)
    )


def test_runs_may_be_named_and_what_is_wrong_is_told(tmp_path: Path) -> None:
    """Two headings that only differ after the cut tell a reader nothing."""
    run = minisim.simulate(four_way(density=300, horizon=30.0, warmup=0.0), Dim())
    named = play(run, run, seconds=20, names=("without a monitor", "with a monitor"))
    assert [it["controller"] for it in named.scenes] == ["without a monitor", "with a monitor"]
    for wrong, said in (
        (lambda: play(None), "run must be a Run"),  # type: ignore[arg-type]
        (
            lambda: play(run, seconds=20, names=("one", "two")),
            "names must be one per run, 1, got 2",
        ),
        (
            lambda: play(run, seconds=20, names="one"),
            "names must be a sequence of text, one per run",
        ),
        (lambda: named.save(tmp_path / "x.txt"), "ends in .html"),
    ):
        with pytest.raises(InputError, match=said):
            wrong()
    assert list(tmp_path.iterdir()) == []
