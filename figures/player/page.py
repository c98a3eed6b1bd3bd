"""A player of one run or two side by side, as a web page in one file that needs no other."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Sequence
from importlib import resources

from figures.player.ground import look
from figures.player.scene import Scene, dumped, scene
from figures.style import suffix_of
from minisim.errors import InputError, instance, items, printable
from minisim.files import AnyPath, write_text
from minisim.results.run import Run

#: The player's script, in this order.
SCRIPTS = ("scene.js", "drawing.js", "pane.js", "player.js")
#: Height of a player of one run in a notebook, and of one of two [px].
HEIGHTS = (580, 960)


class Player:
    """One run, or two side by side on one clock, as `play` makes it.

    It shows itself in a notebook, and `save` writes it as a web page of its own.

    Raises `InputError` for two scenes of different arrivals.
    """

    def __init__(self, one: Scene, other: Scene | None = None) -> None:
        self.scenes = (one,) if other is None else (one, other)
        if other is not None and (different := different_arrivals(one, other)):
            raise InputError(f"two runs side by side need the same arrivals: {different}")

    def save(self, path: AnyPath) -> None:
        """Write the page, whole or not at all; raises `FileError`, or `InputError` unless .html."""
        suffix_of(path, "a page", ("html",))
        write_text(path, self.page())

    def page(self, attributes: str = "autoplay") -> str:
        """The page as a text; `attributes` are those of the element `minisim-player`."""
        names = " beside ".join(it["controller"] for it in self.scenes)
        fields = {
            "title": html.escape(f"{self.scenes[0]['title']} · {names}"),
            "attributes": attributes,
            "scenes": dumped(self.scenes).replace("<", r"\u003c"),
            "player": script(),
        }
        return template("template.html", **fields)

    def _repr_html_(self) -> str:
        """A frame of its own, which shares no style, key or script with the notebook."""
        held = self.page("").replace("&", "&amp;").replace("'", "&#39;")
        style = f"width: 100%; height: {HEIGHTS[len(self.scenes) - 1]}px; border: 0"
        return f"<iframe sandbox='allow-scripts' style='{style}' srcdoc='{held}'></iframe>"


def play(
    run: Run,
    beside: Run | None = None,
    *,
    start: float = 0.0,
    seconds: float = 60.0,
    names: Sequence[str] = (),
) -> Player:
    """`seconds` of a run from `start` on [s], perhaps `beside` another one, to look at.

    Click a vehicle there to read why it waits. Two runs share one clock. For example,
    `play(run, start=300).save("film.html")`. `names` are the headings of the runs, by default
    their controllers.

    Raises `InputError` as `scene`, for runs with different arrivals, and unless there are as many
    names as runs.
    """
    runs = [run] if beside is None else [run, beside]
    for it in runs:
        instance("run", it, Run)
    scenes = [scene(it, start=start, seconds=seconds) for it in runs]
    if names:
        told = items("names", names, "text, one per run")
        if len(told) != len(runs):
            raise InputError(f"names must be one per run, {len(runs)}, got {len(told)}")
        for made, name in zip(scenes, told, strict=True):
            made["controller"] = printable("name of a run", name)
    return Player(*scenes)


def script() -> str:
    """The player as one JavaScript module, its style sheet inside; it defines `minisim-player`."""
    colours = "".join(f"--{name}: {colour}; " for name, colour in look().items())
    sheet = f":host {{ {colours}}}\n{_file('player.css')}"
    quoted = json.dumps(sheet).replace("<", r"\u003c")
    return "\n".join([f"const STYLE = {quoted};", *map(_file, SCRIPTS)])


def different_arrivals(one: Scene, other: Scene) -> str:
    """What tells the arrivals of two scenes apart; empty if nothing does."""
    for key, what in (("title", "scenario"), ("demand", "demand"), ("seed", "seed")):
        if one[key] != other[key]:
            return f"{what} {one[key]} and {other[key]}"
    came = [{it["id"]: it["way"] for it in scene["tracks"]} for scene in (one, other)]
    for vehicle in sorted(came[0].keys() & came[1].keys()):
        ways = [
            scene["ways"][by[vehicle]]["name"] for scene, by in zip((one, other), came, strict=True)
        ]
        if ways[0] != ways[1]:
            return f"vehicle {vehicle} takes {ways[0]} and {ways[1]}"
    return ""


def template(name: str, **fields: str) -> str:
    """A template of this folder, with its fields filled in."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: fields[found[1]], _file(name))


def _file(name: str) -> str:
    return (resources.files("figures.player") / name).read_text(encoding="utf-8")
